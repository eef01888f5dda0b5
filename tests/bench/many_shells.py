"""Makes a model for `ebpo check`: N small octahedra in a cylinder of about M faces, which is 20 radii long.

    many_shells.py N M OUT.ply [lean]        lean: tilts the cylinder against the axes
"""
import sys

import numpy as np

n, m, out = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
k = m // 4
a = 2 * np.pi * np.arange(k) / k
ring = np.stack([np.cos(a), np.sin(a)], 1)
v = np.concatenate([np.c_[ring, np.full(k, -10)], np.c_[ring, np.full(k, 10)], [[0, 0, -10], [0, 0, 10]]])
i, j = np.arange(k), (np.arange(k) + 1) % k
f = np.concatenate([np.c_[i, j, k + j], np.c_[i, k + j, k + i], np.c_[np.full(k, 2 * k), j, i], np.c_[np.full(k, 2 * k + 1), k + i, k + j]])
r = np.random.default_rng(1)
s = 0.2 / n ** (1 / 3)
at = r.uniform(-1, 1, (3 * n, 3)) * [0.95, 0.95, 9.9]
at = at[(at[:, 0] ** 2 + at[:, 1] ** 2) < 0.9][:n]
o = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]) * s
of = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
v = np.concatenate([v, (at[:, None] + o[None]).reshape(-1, 3)])
f = np.concatenate([f, (np.arange(len(at))[:, None, None] * 6 + 2 * k + 2 + of[None]).reshape(-1, 3)])
if len(sys.argv) > 4:
    v = v @ np.array([[1, 0, 0], [0, .8, -.6], [0, .6, .8]])
q = np.zeros(len(f), [('n', 'u1'), ('v', '<i4', 3)])
q['n'], q['v'] = 3, f
head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(v)}"] + [f"property float {x}" for x in "xyz"]
head += [f"element face {len(f)}", "property list uchar int vertex_indices", "end_header\n"]
open(out, "wb").write("\n".join(head).encode() + v.astype("<f4").tobytes() + q.tobytes())
