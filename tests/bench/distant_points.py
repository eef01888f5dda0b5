#!/usr/bin/env python3
"""Measures distance queries from far away: tests/bench/distant_points.py EBPO MODELS... [--count N] [--seed S]

MODELS are .ebpo.h5 files, which are kept completely in memory. Each row has N points. One thread queries them one
after the other with `ebpo bench`; no query starts from the previous result. The rows: around the model, at one
size of its box from the center; far away, at 16 to 1e300 sizes in random directions; and far away along axes and
diagonals, where a side of the model may face the point.
"""
import argparse
import itertools
import json
import math
import os
import random
import subprocess
import tempfile

FAR = (16, 1e3, 1e6, 1e20, 1e100, 1e300)


def unit(v):
    length = math.sqrt(sum(x * x for x in v))
    return [x / length for x in v]


def random_directions(count, rng):
    return [unit([rng.gauss(0, 1) for _ in range(3)]) for _ in range(count)]


def even_directions(count):
    ways = [unit(v) for v in itertools.product((-1, 0, 1), repeat=3) if any(v)]
    return [ways[i % len(ways)] for i in range(count)]


def bench(ebpo, model, points, folder):
    path = os.path.join(folder, "points.txt")
    with open(path, "w", encoding="ascii") as f:
        f.writelines(" ".join(repr(x) for x in p) + "\n" for p in points)
    return json.loads(subprocess.run(
        [ebpo, "bench", "--json", "--query", "distance", "--no-warm", "--points", path, model],
        check=True, capture_output=True, text=True).stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("ebpo")
    parser.add_argument("models", nargs="+")
    parser.add_argument("--count", type=int, default=5200)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    print("| model | faces | points | median, us | 99 %, us | 99.9 %, us | most, us |")
    print("|---|---:|---|---:|---:|---:|---:|")
    for model in given.models:
        info = json.loads(subprocess.run([given.ebpo, "info", "--json", model], check=True,
                                         capture_output=True, text=True).stdout)
        low, size = info["box_origin"], info["box_size"]
        middle = [a + s / 2 for a, s in zip(low, size)]
        ways = random_directions(given.count, random.Random(given.seed))
        rows = (("one size away", ways, (1,)), ("far, random", ways, FAR),
                ("far, axes and diagonals", even_directions(given.count), FAR))
        for name, ways, away in rows:
            points = [[m + min(away[i % len(away)] * max(size), 1e307) * w
                       for m, w in zip(middle, way)] for i, way in enumerate(ways)]
            with tempfile.TemporaryDirectory() as folder:
                ns = bench(given.ebpo, model, points, folder)["ns"]
            times = " | ".join(f"{ns[k] / 1000:.1f}" for k in ("p50", "p99", "p999", "max"))
            print(f"| {os.path.basename(model)} | {info['faces']:,} | {name} | {times} |", flush=True)


main()
