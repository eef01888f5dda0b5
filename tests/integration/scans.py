#!/usr/bin/env python3
"""Judges points inside models with holes: winding_judge.c evaluates them without the library.

    scans.py EBPO JUDGE FOLDER POINTS FULL [MODEL...]

FOLDER contains PLY files. `shapes` in its place: small surfaces that are made here, and 200 sets of random faces. Of
each model POINTS points (of a set: a twentieth) are judged by exact rays and solid angles of a cone over the border;
FULL of these also by sums over all faces. All results must be equal: with the model in memory, in 256 MB, and by URL in
256 MB (not of a set). EBPO_TEST_SCALE reduces both counts, and the number of sets.

A model of 25 million faces with 10^5 border edges:

    ebpo-generate --base lucy100k.ply --subdivide 4 lucy.ply
    winding_judge holes lucy.ply 200 48 >FOLDER/holed.ply
    scans.py EBPO JUDGE FOLDER 10000 100 holed
"""
import array
import math
import mmap
import os
import pathlib
import random
import struct
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "support"))
import ranges_server

EBPO, JUDGE, FOLDER = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
SCALE = float(os.environ.get("EBPO_TEST_SCALE", "1"))
POINTS, FULL = (max(1, int(float(count) * SCALE)) for count in sys.argv[4:6])
SHAPES = FOLDER.name == "shapes"
MODELS = sys.argv[6:] or ["blade", "bunny", "dragon_vrip", "motorbike"]


def run(*arguments, stdout=None):
    return subprocess.run([str(a) for a in arguments], stdout=stdout or subprocess.PIPE, check=True).stdout


def grid(columns, rows, at, faces=lambda i, j: True):
    """Returns the triangles of a grid of points at(i, j)."""
    out = []
    for i in range(columns):
        for j in range(rows):
            if faces(i, j):
                a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
                out += [(a, b, c), (a, c, d)]
    return out


def band(i, j):
    """Returns a point of a Moebius strip, whose ends join after half a turn."""
    turn, side = 2 * math.pi * (i % 24) / 24, (j - 1) * (-1) ** (i // 24)
    r = 2 + 0.6 * side * math.cos(turn / 2)
    return r * math.cos(turn), r * math.sin(turn), 0.6 * side * math.sin(turn / 2)


def ball(i, j):
    turn, down = 2 * math.pi * (i % 16) / 16, math.pi * j / 16
    return math.sin(down) * math.cos(turn), math.sin(down) * math.sin(turn), math.cos(down)


def shapes(count):
    """Yields names and lists of triangles."""
    yield "sheet", grid(5, 5, lambda i, j: (i, j, 0))
    yield "moebius", grid(24, 2, band)
    yield "half_sphere", [t for t in grid(16, 8, ball) if len(set(t)) == 3]
    yield "cube_corner", [tuple(p[k:] + p[:k] for p in t) for k in range(3) for t in grid(2, 2, lambda i, j: (i, j, 0))]
    for seed in range(count):
        unit = random.Random(seed).random
        yield f"soup{seed}", [tuple((unit(), unit(), unit()) for _ in range(3)) for _ in range(2 + seed % 40)]


def write_ply(path, triangles):
    """Writes triangles; equal positions, rounded to float, are one vertex. No coordinate is near 0: doubles next to 0
    are beyond the 320 bits of the judge."""
    index = {}
    rounded = [[tuple(array.array("f", (x + 5, y + 6, z + 7))) for x, y, z in t] for t in triangles]
    faces = [[index.setdefault(p, len(index)) for p in t] for t in rounded]
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(index)}\nproperty float x\nproperty float y\n"
            f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    path.write_bytes(head.encode() + b"".join(struct.pack("<3f", *p) for p in index) +
                     b"".join(struct.pack("<B3i", 3, *f) for f in faces))


def judge(name, source, count=POINTS):
    """Judges points in a model. Returns the number of problems."""
    with tempfile.TemporaryDirectory() as folder:
        file, points, results = (pathlib.Path(folder) / n for n in ("m.ebpo.h5", "points", "m.npy"))
        subprocess.run([EBPO, "convert", "--quiet", str(source), str(file)], check=True, stderr=subprocess.DEVNULL)
        with open(points, "wb") as out:
            run(JUDGE, "points", source, count, 1, stdout=out)
        inside = (EBPO, "inside", "--raw", "--npy")
        with open(results, "wb") as out:
            run(*inside, file, points, stdout=out)
        others = {"in 256 MB": run(*inside, "--memory", "256M", file, points)}
        if not name.startswith("soup"):
            with open(file, "rb") as f:
                server = ranges_server.start(mmap.mmap(f.fileno(), 0, access=mmap.ACCESS_READ))
            others["by URL"] = run(*inside, "--memory", "256M", ranges_server.url_of(server), points)
            server.shutdown()
        begin = time.time()
        done = subprocess.run([JUDGE, "check", str(source), str(points), str(results), str(FULL)],
                              stdout=subprocess.PIPE, text=True)
        print(f"{name}: {count} points, {done.stdout.strip()} ({time.time() - begin:.0f} s)", flush=True)
        problems = done.returncode != 0
        for how, other in others.items():
            if results.read_bytes() != other:
                print(f"{name}: results {how} differ")
                problems += 1
        return problems


def main():
    if not SHAPES:
        return sum(judge(name, FOLDER / f"{name}.ply") for name in MODELS)
    problems = 0
    with tempfile.TemporaryDirectory() as folder:
        for name, triangles in shapes(max(1, int(200 * SCALE))):
            source = pathlib.Path(folder) / f"{name}.ply"
            write_ply(source, triangles)
            problems += judge(name, source, POINTS // 20 + 1 if name.startswith("soup") else POINTS)
    return problems


sys.exit(main() > 0)
