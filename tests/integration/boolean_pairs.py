#!/usr/bin/env python3
"""Tests meshes of Boolean results of difficult small solids: boolean_pairs.py EBPO [PAIRS [SEED [FIRST]]]

Solids have coplanar faces, common edges and vertices, self-intersections and nested shells, and sizes from 1e-150 to
1e150. The second solid of a pair may be equal to the first one, moved by one ulp, refined, reversed, turned or nested.
All four operations must give closed meshes. At 1,000 points, most of them close to faces, the winding number of each
result must be 1 where the expression of the solids holds, else 0. Winding numbers are computed here with integers, from
crossings of vertical rays. Points that are not farther from all faces than rounding moves vertices are omitted, as are
rays through edges.
"""
import json
import math
import os
import pathlib
import random
import struct
import subprocess
import sys
import tempfile

import boolean_models
from boolean_models import OPERATORS, open_edges, pose, random_rotation

POINTS, GRID = 1000, 16
SCALES = (1, 1, 1, 0.1, 1e-30, 1e30, 1e-150, 1e150, 2.0 ** -500, 2.0 ** 500)
RULES = {"nonzero": lambda w: w != 0, "evenodd": lambda w: w % 2 == 1, "positive": lambda w: w > 0}


# --- solids: lists of vertices and of faces ---

def make_box(low, high):
    faces = [(0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4), (2, 6, 7), (2, 7, 3), (0, 4, 6),
             (0, 6, 2), (1, 3, 7), (1, 7, 5)]
    return [tuple((high if i >> k & 1 else low)[k] for k in range(3)) for i in range(8)], faces


def reverse(solid):
    return solid[0], [face[::-1] for face in solid[1]]


def join(*solids):
    vertices, faces = [], []
    for v, f in solids:
        faces += [tuple(i + len(vertices) for i in face) for face in f]
        vertices += v
    return vertices, faces


def subtract(a, b):
    return tuple(x - y for x, y in zip(a, b))


def determinant(a, b, c):
    return (a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0]))


def random_box(rng, size):
    low = [float(rng.randint(0, size - 1)) for _ in range(3)]
    return make_box(low, [x + rng.randint(1, size) for x in low])


def random_tetrahedron(rng, size):
    while True:
        v = [tuple(float(rng.randint(0, size)) for _ in range(3)) for _ in range(4)]
        volume = determinant(*(subtract(v[i], v[0]) for i in (1, 2, 3)))
        if volume:
            solid = v, [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]
            return solid if volume > 0 else reverse(solid)


def random_octahedron(rng, size):
    centre, radius = [float(rng.randint(0, size)) for _ in range(3)], float(rng.randint(1, size))
    vertices = [tuple(c + (r if i == k else 0) for i, c in enumerate(centre)) for k in range(3) for r in (-radius, radius)]
    faces = [(x, y, z) if (x + y + z) % 2 else (z, y, x) for x in (0, 1) for y in (2, 3) for z in (4, 5)]
    return vertices, faces


def refine(rng, solid, count):
    """Divide edges and faces at points that need not be in their planes after rounding."""
    v, f = list(solid[0]), list(solid[1])
    for _ in range(count):
        i = rng.randrange(len(f))
        a, b, c = f[i]
        new = len(v)
        other = [j for j in range(len(f)) if j != i and (b, a) in zip(f[j], f[j][1:] + f[j][:1])]
        if rng.random() < 0.5 and other:
            v.append(tuple((x + y) / 2 for x, y in zip(v[a], v[b])))
            opposite = f[other[0]][(f[other[0]].index(b) + 2) % 3]
            f[i], f[other[0]] = (a, new, c), (b, new, opposite)
            f += [(new, b, c), (new, a, opposite)]
        else:
            v.append(tuple((x + y) / 4 + z / 2 for x, y, z in zip(v[a], v[b], v[c])))
            f[i] = (a, b, new)
            f += [(b, c, new), (c, a, new)]
    return v, f


def random_solid(rng):
    size = rng.choice((2, 3, 4))
    kind = rng.choice(("box", "tetrahedron", "octahedron", "boxes", "two", "shells", "three"))
    if kind == "box":
        solid = random_box(rng, size)
    elif kind == "tetrahedron":
        solid = random_tetrahedron(rng, size)
    elif kind == "octahedron":
        solid = random_octahedron(rng, size)
    elif kind == "boxes":
        solid = join(random_box(rng, size), random_box(rng, size))
    elif kind == "two":
        solid = join(random_tetrahedron(rng, size), rng.choice((random_box, random_octahedron))(rng, size))
    elif kind == "shells": # a reversed or a repeated shell
        outer = random_box(rng, size)
        solid = join(outer, rng.choice((reverse(random_box(rng, size)), outer)))
    else:
        solid = join(*(random_tetrahedron(rng, size) for _ in range(3)))
    if rng.random() < 0.5:
        solid = refine(rng, solid, rng.randint(1, 12))
    if rng.random() < 0.25:
        moved = rng.choice((0.25, 0.5, 2.0 ** -20, 2.0 ** -45))
        solid = [tuple(x + rng.choice((0, 0, moved, -moved)) for x in v) for v in solid[0]], solid[1]
    return solid


def move_by_ulps(rng, solid):
    part = rng.choice((0.1, 0.5, 1))
    moved = {v: tuple(math.nextafter(x, rng.choice((-9e300, 9e300))) if x and rng.random() < part else x for x in v)
             for v in solid[0]}
    return [moved[v] for v in solid[0]], solid[1]


def random_pair(rng):
    a = random_solid(rng)
    kind = rng.choice(("free", "free", "free", "equal", "ulps", "ulps", "nested", "refined", "reversed", "turned"))
    b = {"free": lambda: random_solid(rng), "equal": lambda: a, "ulps": lambda: move_by_ulps(rng, a),
         "nested": lambda: ([tuple(x / 2 + 0.25 for x in v) for v in a[0]], a[1]),
         "refined": lambda: refine(rng, a, 10), "reversed": lambda: reverse(a),
         "turned": lambda: ([(y, z, x) for x, y, z in a[0]], a[1])}[kind]()
    scale = rng.choice(SCALES)
    shift = [rng.choice((1, 1 / 3, 1e8 / 3)) if rng.random() < 0.15 else 0] * 3
    return kind, scale, [([tuple((x + d) * scale for x, d in zip(v, shift)) for v in s[0]], s[1]) for s in (a, b)]


def random_pose(rng, scale, before):
    """Return the rotation, the scale and the translation; often exact quarter turns, or nearly the pose `before`."""
    if before and rng.random() < 0.3:
        return *before[:2], [math.nextafter(t, 9e300) for t in before[2]]
    rotation = random_rotation(rng)
    if rng.random() < 0.3:
        k = rng.randrange(3)
        rotation = [[float(j == (i + k) % 3) for j in range(3)] for i in range(3)]
    return rotation, rng.choice((1.0, 0.5, rng.uniform(0.7, 1.3))), [rng.choice((0, 1, rng.gauss(0, 0.3))) * scale
                                                                     for _ in range(3)]


# --- exact winding numbers ---

class Exact:
    """Faces with coordinates as integers, in units of 2^`exponent`, in a grid over x and y."""

    def __init__(self, vertices, faces, exponent):
        whole = [to_integers(v, exponent) for v in vertices]
        self.exponent, self.corners = exponent, [[whole[i] for i in face] for face in faces]
        self.boxes = [tuple(side(vertices[i][k] for i in face) for k in range(3) for side in (min, max))
                      for face in faces]
        self.low = [min((box[2 * k] for box in self.boxes), default=0) for k in range(2)]
        self.size = [max((box[2 * k + 1] for box in self.boxes), default=0) - self.low[k] or 1 for k in range(2)]
        self.cells = [[[] for _ in range(GRID)] for _ in range(GRID)]
        for face in zip(self.boxes, self.corners):
            for row in self.cells[self.cell(face[0][0], 0):self.cell(face[0][1], 0) + 1]:
                for cell in row[self.cell(face[0][2], 1):self.cell(face[0][3], 1) + 1]:
                    cell.append(face)

    def cell(self, x, axis):
        """Return the number of the cell; it never decreases with x."""
        return int(max(0, min(1, (x - self.low[axis]) / self.size[axis])) * (GRID - 1))

    def winding(self, point):
        """Return the winding number; None: the ray from the point upward meets an edge, or a face has the point."""
        x, y, z = point
        p, winding = to_integers(point, self.exponent), 0
        for (x0, x1, y0, y1, _, z1), corners in self.cells[self.cell(x, 0)][self.cell(y, 1)]:
            if not (x0 <= x <= x1 and y0 <= y <= y1 and z <= z1):
                continue
            d = [subtract(c, p) for c in corners]
            minors = [d[i][0] * d[i - 2][1] - d[i][1] * d[i - 2][0] for i in range(3)]
            if min(minors) < 0 < max(minors):
                continue
            height = sum(m * d[i - 1][2] for i, m in enumerate(minors)) # times sum(minors)
            if 0 in minors or height == 0:
                return None
            if (height > 0) == (minors[0] > 0):
                winding += 1 if minors[0] > 0 else -1
        return winding

    def is_near(self, point, margin):
        """Return True if a face may have a distance of at most the margin from the point."""
        p, whole = to_integers(point, self.exponent), to_integers((margin,), self.exponent)[0] + 1
        (a0, a1), (b0, b1), (c0, c1) = ((x - 2 * margin, x + 2 * margin) for x in point)
        for row in self.cells[self.cell(a0, 0):self.cell(a1, 0) + 1]:
            for cell in row[self.cell(b0, 1):self.cell(b1, 1) + 1]:
                for (x0, x1, y0, y1, z0, z1), corners in cell:
                    if x0 <= a1 and x1 >= a0 and y0 <= b1 and y1 >= b0 and z0 <= c1 and z1 >= c0:
                        u, v, w = (subtract(q, corners[0]) for q in (corners[1], corners[2], p))
                        normal = [u[k - 2] * v[k - 1] - u[k - 1] * v[k - 2] for k in range(3)]
                        height = sum(n * x for n, x in zip(normal, w))
                        if height * height <= whole * whole * sum(n * n for n in normal):
                            return True
        return False


def to_integers(numbers, exponent):
    """Divide doubles by 2^exponent; bits below are dropped."""
    out = []
    for x in numbers:
        mantissa, power = math.frexp(x)
        shift, mantissa = power - 53 - exponent, int(mantissa * 2 ** 53)
        out.append(mantissa << shift if shift >= 0 else mantissa >> -shift)
    return out


def last_bit(numbers):
    """Return the exponent of a power of two of which all numbers are multiples."""
    return min((math.frexp(x)[1] - 53 for x in numbers if x), default=0)


# --- a pair ---

def write_ply(path, solid):
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(solid[0])}\nproperty double x\n"
            f"property double y\nproperty double z\nelement face {len(solid[1])}\n"
            "property list uchar int vertex_indices\nend_header\n")
    path.write_bytes(head.encode() + b"".join(struct.pack("<3d", *v) for v in solid[0])
                     + b"".join(struct.pack("<B3i", 3, *f) for f in solid[1]))


def make_points(rng, solids):
    """Return points near the faces of the solids, and some others, as doubles."""
    vertices = [v for s in solids for v in s[0]]
    low, high = ([side(v[k] for v in vertices) for k in range(3)] for side in (min, max))
    size = max(h - l for l, h in zip(low, high))
    points = []
    for _ in range(POINTS):
        v, f = rng.choice(solids)
        if f and rng.random() < 0.75:
            s, t = sorted((rng.random(), rng.random()))
            near = size * 10.0 ** rng.randint(-15, -1)
            a, b, c = (v[i] for i in rng.choice(f))
            points.append(tuple(s * x + (t - s) * y + (1 - t) * z + rng.gauss(0, near) for x, y, z in zip(a, b, c)))
        else:
            points.append(tuple(l + (h - l) * rng.uniform(-0.1, 1.1) for l, h in zip(low, high)))
    return points


def run(*command):
    return subprocess.run([str(c) for c in command], capture_output=True, text=True)


def run_pair(ebpo, rng, label, folder):
    """Return failures, and the number of points tested."""
    kind, scale, solids = random_pair(rng)
    rules, arguments, files, before = [rng.choice(["nonzero"] * 4 + ["evenodd", "positive"]) for _ in solids], [], [], None
    posed = list(solids)
    for k, name in enumerate("AB"):
        write_ply(folder / f"{name}.ply", solids[k])
        files.append(folder / f"{name}.ebpo.h5")
        done = run(ebpo, "convert", "-q", "--threads", 1, "--leaf-faces", rng.choice((1, 4, 16)), "--parts=-maps", "--weld",
                   "--rule", rules[k], folder / f"{name}.ply", files[k])
        if done.returncode:
            return [f"{label}: convert {name}: {done.stderr}"], 0
        if rng.random() < 0.3:
            before = rotation, size, shift = random_pose(rng, scale, before)
            numbers = [x for row, t in zip(rotation, shift) for x in (*row, t)] + [size]
            arguments += ["--pose", f"{name} " + " ".join(f"{x:.17g}" for x in numbers)]
            posed[k] = pose(solids[k][0], rotation, size, shift), solids[k][1]
    label += f" ({kind}, {scale:g}, {' '.join(rules)}, {len(arguments) // 2} poses)"
    results, failures = {}, []
    for operator in OPERATORS:
        out = folder / "out.ply"
        done = run(ebpo, "boolean", f"A {operator} B", *files, *arguments, "-o", out, "--double", "--json",
                   "--threads", 1)
        if done.returncode not in (0, 5):
            failures.append(f"{label}: {operator}: {done.returncode}: {done.stderr}")
            continue
        vertices, faces = boolean_models.read_ply(out)
        if open_edges(faces) or (done.returncode == 5) != (not faces):
            failures.append(f"{label}: {operator}: open edges, or a wrong exit code ({done.returncode})")
        results[operator] = vertices, faces, json.loads(done.stdout)["displacement"]
    points = make_points(rng, [*posed, *(r[:2] for r in results.values())])
    exponent = last_bit(x for s in (*posed, *results.values(), (points,)) for v in s[0] for x in v)
    operands = [Exact(*s, exponent) for s in posed]
    exact = {operator: (Exact(*r[:2], exponent), r[2] * 1.000001) for operator, r in results.items()}
    tested = 0
    for point in points:
        windings = [o.winding(point) for o in operands]
        if None in windings:
            continue
        inside = [RULES[rule](w) for rule, w in zip(rules, windings)]
        close = {}
        for operator, (result, margin) in exact.items():
            if margin not in close:
                close[margin] = margin > 0 and any(o.is_near(point, margin) for o in operands)
            winding = result.winding(point)
            if close[margin] or winding is None or (margin > 0 and result.is_near(point, margin)):
                continue
            tested += 1
            if winding != OPERATORS[operator](*inside):
                failures.append(f"{label}: {operator}: at {point}: {windings}, {winding}")
    return failures, tested


def main():
    ebpo = sys.argv[1]
    scale = float(os.environ.get("EBPO_TEST_SCALE", 1))
    pairs = int(sys.argv[2]) if len(sys.argv) > 2 else max(3, round(6 * scale))
    seed, first = (int(sys.argv[i]) if len(sys.argv) > i else 0 for i in (3, 4))
    tested = failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(first, first + pairs):
            failures, points = run_pair(ebpo, random.Random(f"{seed} {number}"), f"pair {number}", pathlib.Path(folder))
            tested += points
            failed += bool(failures)
            for failure in failures[:4]:
                print(failure, flush=True)
            if number % 10 == 9:
                print(f"{number + 1 - first} pairs, {tested} points, {failed} failed", flush=True)
    print(f"{pairs} pairs, {tested} points of results, {failed} pairs failed")
    return 1 if failed or tested < POINTS * pairs else 0


sys.exit(main())
