#!/usr/bin/env python3
"""Measures the overhead of Python, and other Python packages: bench_python.py MODEL.ebpo.h5

    PYTHONPATH=build/tools/python tests/bench/bench_python.py bunny.ebpo.h5 [--points 1000000] [--threads N]
                                                               [--rounds 9]

First measures Model.inside, and ebpo_inside_many for the same points on as many threads. Each of these threads has a
context and a share of the points, and writes to an existing array. The two run in turns in one process; the ratio is
the median of the rounds.

Then measures Open3D's RaycastingScene and trimesh, if they are installed: the ratio of their times to those of Model in
the same round, and the number of their results that differ from the exact ones. The points are in the model's box, or
within a millionth of its size of a face. Compared are inside, distances (a difference above a millionth of that size),
and whether a ray hits a face.
"""
import argparse
import statistics
import threading
import time
import timeit

import numpy as np

import ebpo
from ebpo import _declared as c
from ebpo._library import Handle, call
from ebpo.queries import cores


def seconds(function, *arguments):
    began = time.perf_counter()
    result = function(*arguments)
    return time.perf_counter() - began, result


class Plain:
    """ebpo_inside_many on threads, as in a C program."""

    def __init__(self, model, points, threads):
        self.points, self.out = points, np.zeros(len(points), np.dtype(c.ebpo_inside_result))
        self.contexts = [Handle.made("ebpo_context_new", model.model, free="ebpo_context_free", keep=(model.model,))
                         for _ in range(threads)]

    def part(self, i):
        begin, end = (len(self.points) * k // len(self.contexts) for k in (i, i + 1))
        call("ebpo_inside_many", self.contexts[i], self.points[begin:].ctypes.data, end - begin,
             None, self.out[begin:].ctypes.data)

    def __call__(self):
        others = [threading.Thread(target=self.part, args=(i,)) for i in range(1, len(self.contexts))]
        for thread in others:
            thread.start()
        self.part(0)
        for thread in others:
            thread.join()
        return self.out["where"]


def cost(model, points, threads, rounds):
    plain, ratios = Plain(model, points, threads), []
    for number in range(rounds + 1):
        order = [("c", plain), ("python", lambda: model.inside(points, threads=threads))]
        times = {}
        for name, function in order[::1 if number % 2 else -1]:
            times[name], result = seconds(function)
        if number:  # the first round only warms up
            ratios.append(times["python"] / times["c"])
    assert np.array_equal(model.inside(points), plain.out["where"] != c.EBPO_OUT)
    print(f"Model.inside / ebpo_inside_many, {len(points)} points, {threads} threads: {statistics.median(ratios):.2f} "
          f"({min(ratios):.2f} to {max(ratios):.2f}, {rounds} rounds)")
    each = min(timeit.repeat(lambda: model.inside(points[0]), number=1000, repeat=5)) / 1000
    print(f"Model.inside, one point a call: {each * 1e6:.0f} microseconds")


def open3d(mesh):
    import open3d as o3d
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(np.array(mesh.vertices, dtype=np.float32)),
                        o3d.core.Tensor(np.array(mesh.faces)))

    def single(*parts):
        return o3d.core.Tensor(np.hstack(parts).astype(np.float32))

    return {"inside": lambda points: scene.compute_occupancy(single(points)).numpy() > 0,
            "distance": lambda points: scene.compute_distance(single(points)).numpy(),
            "ray": lambda points: scene.cast_rays(single(points, along(points)))["t_hit"].numpy()}


def trimesh(mesh):
    import trimesh as package
    other = package.Trimesh(mesh.vertices, mesh.faces, process=False)
    return {"inside": other.contains,
            "distance": lambda points: other.nearest.on_surface(points)[1],
            "ray": lambda points: np.where(other.ray.intersects_any(points, along(points)), 0, np.inf)}


def along(points):
    return np.tile([1., .5, .25], (len(points), 1))


def wrong(query, result, exact, size):
    """Return which results are wrong: another truth value, or a distance with more than a rounding error."""
    if query == "inside":
        return result != exact
    if query == "ray":
        return np.isinf(result) != np.isinf(exact)
    return abs(result - exact) > 1e-6 * size


def compare(model, sets, rounds):
    mesh = model.mesh()
    size = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    ours = {"inside": model.inside, "distance": lambda points: model.distance(points, signed=False).distance,
            "ray": lambda points: model.ray(points, along(points)).t}
    print("| package | query | points | time / Model's | wrong results |\n|---|---|---|---|---|")
    for name, make in (("Open3D", open3d), ("trimesh", trimesh)):
        try:
            theirs = make(mesh)
        except ImportError as error:
            print(f"| {name} | | | | not available: {error} |")
            continue
        for query, where, points in ((q, w, p) for q in ours for w, p in sets.items()):
            ratios = []
            for _ in range(rounds):
                took, exact = seconds(ours[query], points)
                their, result = seconds(theirs[query], points)
                ratios.append(their / took)
            count = int(wrong(query, result, exact, size).sum())
            print(f"| {name} | {query} | {len(points)} {where} | {statistics.median(ratios):.2f} | {count} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model")
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--threads", type=int, default=cores())
    parser.add_argument("--rounds", type=int, default=9)
    options = parser.parse_args()
    model = ebpo.open(options.model)
    random = np.random.default_rng(1)
    vertices, faces = model.mesh()
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    points = random.uniform(low, high, (options.points, 3))
    cost(model, points, options.threads, options.rounds)
    chosen = vertices[faces[random.integers(0, len(faces), options.points // 10)]].mean(axis=1).astype(float)
    near = chosen + random.normal(0, 1e-6 * np.linalg.norm(high - low), chosen.shape)
    compare(model, {"in its box": points[:options.points // 10], "close to faces": near}, 3)


if __name__ == "__main__":
    main()
