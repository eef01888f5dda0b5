#!/usr/bin/env python3
"""Compares the inside of meshes with holes to that of the same meshes closed, and to libigl.

    tests/bench/open_surfaces.py MODEL.ply... [--border EDGES] [--subdivide N] [--count N] [--rounds N] [--json FILE]

MODEL.ply is binary, with float vertices and triangles. A mesh with holes is compared to itself with caps as faces. A
closed mesh gets holes until its border has about EDGES edges: the faces around random vertices are removed.
--subdivide divides each face into four, N times. Points are uniform in the bounding box.

The programs take turns. The table has processor times for each point and the median of the ratios of the rounds.
Needs numpy, the Python package `ebpo`, and for a comparison `igl` (PyPI: libigl). EBPO_LIBRARY names the library.
"""
import argparse
import json
import pathlib
import statistics
import tempfile
import time

import ebpo
import numpy as np

try:
    import igl
except ImportError:
    igl = None


def read_ply(path):
    data = pathlib.Path(path).read_bytes()
    end = data.index(b"end_header\n") + 11
    counts = [int(line.split()[2]) for line in data[:end].split(b"\n") if line.startswith(b"element")]
    points = np.frombuffer(data, "<f4", 3 * counts[0], end).reshape(-1, 3).astype(float)
    rows = np.frombuffer(data, np.dtype([("n", "u1"), ("at", "<i4", 3)]), counts[1], end + 12 * counts[0])
    assert (rows["n"] == 3).all()
    return points, rows["at"].copy()


def subdivide(points, faces):
    """Divides each face into four."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    unique, number = np.unique(edges, axis=0, return_inverse=True)
    a, b, c = number.reshape(3, -1) + len(points)
    points = np.concatenate([points, points[unique].mean(axis=1).astype("f4").astype(float)])
    i, j, k = faces.T
    return points, np.stack([i, a, c, a, j, b, c, b, k, a, b, c], axis=1).reshape(-1, 3).astype("i4")


def border(faces):
    """Returns the directed edges whose reverse is not used."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    most = edges.max() + 1
    key, back = edges[:, 0] * most + edges[:, 1], edges[:, 1] * most + edges[:, 0]
    return edges[~np.isin(key, back)]


def with_holes(faces, wanted, seed=1):
    """Removes the faces around random vertices that share no face."""
    random, used, removed = np.random.default_rng(seed), np.zeros(faces.max() + 1, bool), np.zeros(faces.max() + 1, bool)
    order = np.argsort(faces.reshape(-1), kind="stable")
    first = np.searchsorted(faces.reshape(-1)[order], np.arange(faces.max() + 2))
    edges = 0
    for v in random.permutation(faces.max() + 1):
        around = faces[order[first[v]:first[v + 1]] // 3]
        if edges >= wanted or used[around].any():
            continue
        used[around] = True
        removed[v] = True
        edges += len(around)
    return faces[~removed[faces].any(axis=1)]


def caps(faces):
    """Returns triangles that close the border."""
    out, after = [], {}
    for a, b in border(faces):
        after.setdefault(int(a), []).append(int(b))
    for start in list(after):
        while after[start]:
            walk, at = [start], {start: 0}
            while True:
                b = after[walk[-1]].pop()
                if b in at:  # a simple loop
                    loop = walk[at[b]:]
                    out += [(loop[0], loop[i + 1], loop[i]) for i in range(1, len(loop) - 1)]
                    for v in loop[1:]:
                        del at[v]
                    del walk[at[b] + 1:]
                    if len(walk) == 1:
                        break
                else:
                    at[b] = len(walk)
                    walk.append(b)
    return np.array(out, "i4").reshape(-1, 3)


def seconds(run):
    begin = time.process_time()
    result = run()
    return time.process_time() - begin, result


def measure(path, options, folder):
    points, faces = read_ply(path)
    for _ in range(options.subdivide):
        points, faces = subdivide(points, faces)
    holed = faces if len(border(faces)) else with_holes(faces, options.border)
    closed = np.concatenate([holed, caps(holed)])
    assert len(border(holed)) and not len(border(closed))
    used = points[np.unique(holed)]
    query = np.random.default_rng(1).uniform(used.min(axis=0), used.max(axis=0), (options.count, 3))
    row = {"model": pathlib.Path(path).stem, "faces": len(holed), "border": len(border(holed))}
    models = {}
    for name, mesh in ("holed", holed), ("closed", closed):
        file = pathlib.Path(folder) / f"{name}.ebpo.h5"
        spent, _ = seconds(lambda m=mesh, f=file: ebpo.convert((points.astype("f4"), m), str(f), overwrite=True))
        row[f"convert_{name}"] = spent
        models[name] = ebpo.open(str(file), threads=1)
    runs = {name: (lambda m=m: m.inside(query)) for name, m in models.items()}
    for run in runs.values():
        run()
    times = {name: [] for name in runs}
    if igl:
        row["igl_prepare"], _ = seconds(lambda: igl.fast_winding_number(points, holed.astype(np.int64), query[:1]))
        runs["igl"] = lambda: igl.fast_winding_number(points, holed.astype(np.int64), query)
        times["igl"] = []
    for _ in range(options.rounds):
        for name, run in runs.items():
            spent, result = seconds(run)
            times[name].append(spent - (row["igl_prepare"] if name == "igl" else 0))
            if name == "igl":
                row["igl_differs"] = int((np.asarray(models["holed"].inside(query)) != (np.abs(result) > 0.5)).sum())
    for name in runs:
        row[f"{name}_ns"] = statistics.median(times[name]) / len(query) * 1e9
        row[f"{name}_ratio"] = statistics.median(t / h for t, h in zip(times[name], times["holed"]))
    row["over_closed"] = 1 / row["closed_ratio"]
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("models", nargs="+")
    parser.add_argument("--border", type=int, default=10000)
    parser.add_argument("--subdivide", type=int, default=0)
    parser.add_argument("--count", type=int, default=1000000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--json")
    options = parser.parse_args()
    rows = []
    for path in options.models:
        with tempfile.TemporaryDirectory() as folder:
            rows.append(measure(path, options, folder))
        r = rows[-1]
        print(f"{r['model']}: {r['faces']} faces, {r['border']} border edges: {r['holed_ns']:.1f} ns, closed "
              f"{r['closed_ns']:.1f} ns, ratio {r['over_closed']:.2f}" +
              (f"; libigl {r['igl_ns']:.0f} ns, {r['igl_ratio']:.1f} times, {r['igl_differs']} of {options.count} points "
               "differ" if igl else ""), flush=True)
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
