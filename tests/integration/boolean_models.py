#!/usr/bin/env python3
"""Tests meshes of Boolean results of real models at random poses: boolean_models.py EBPO FOLDER [CASES [SEED]]

Each result must be closed: every directed edge as often as its reverse, by indices. At points near its faces and at
random ones, its winding number must be 1 where the expression of the posed models holds, else 0. Winding numbers are
computed here with integers, from crossings of vertical rays. Points that are not farther from all faces than rounding
moves vertices are omitted, as are rays through edges. FOLDER contains PLY files.
"""
import collections
import fractions
import math
import os
import pathlib
import random
import struct
import subprocess
import sys
import tempfile

MODELS = ["bunny_closed", "armadillo", "dragon100k", "lucy100k", "selfint_A", "cheese_g133", "fertility",
          "twin7081_left", "twin7081_right", "cad_adis16480", "skull", "xyzrgb_dragon28k", "thingi99865"]
OPERATORS = {"|": lambda a, b: a or b, "&": lambda a, b: a and b, "-": lambda a, b: a and not b,
             "^": lambda a, b: a != b}
POINTS, GRID = 40, 128


def read_ply(path):
    """Return vertices and faces of a binary PLY file of triangles."""
    data = path.read_bytes()
    body = data.index(b"end_header\n") + 11
    lines = [line.split() for line in data[:body].decode().split("\n")]
    count = {line[1]: int(line[2]) for line in lines if line[:1] == ["element"]}
    coordinate = "d" if ["property", "double", "x"] in lines else "f"
    row = struct.Struct("<3" + coordinate)
    face = struct.Struct("<x3I" + ("BI" if ["property", "uchar", "operand"] in lines else ""))
    middle = body + row.size * count["vertex"]
    vertices = [v for v in row.iter_unpack(data[body:middle])]
    return vertices, [f[:3] for f in face.iter_unpack(data[middle:middle + face.size * count["face"]])]


def random_rotation(rng):
    q = [rng.gauss(0, 1) for _ in range(4)]
    x, y, z, w = (c / math.hypot(*q) for c in q)
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]


def pose(vertices, rotation, scale, shift):
    """Pose vertices with the order of operations that the library documents."""
    matrix = [[c * scale for c in row] for row in rotation]
    return [tuple(((m[0] * x + m[1] * y) + m[2] * z) + t for m, t in zip(matrix, shift)) for x, y, z in vertices]


class Solid:
    """Faces in a grid over x and y."""

    def __init__(self, vertices, faces):
        self.vertices, self.faces = vertices, faces
        self.low = [min((v[k] for v in vertices), default=0) for k in range(3)]
        self.high = [max((v[k] for v in vertices), default=0) for k in range(3)]
        self.cells = collections.defaultdict(list)
        for number, face in enumerate(faces):
            corners = [vertices[i] for i in face]
            first, last = ([self.cell(side(c[k] for c in corners), k) for k in range(2)] for side in (min, max))
            for i in range(first[0], last[0] + 1):
                for j in range(first[1], last[1] + 1):
                    self.cells[i, j].append(number)

    def cell(self, x, axis):
        size = self.high[axis] - self.low[axis] or 1
        return max(0, min(GRID - 1, int((x - self.low[axis]) / size * GRID)))

    def winding(self, point, margin):
        """Return the winding number; None: a ray through an edge, or a face within the margin above or below."""
        if any(not l <= x <= h for x, l, h in zip(point, self.low, self.high)):
            return 0
        p, winding = [fractions.Fraction(x) for x in point], 0
        for number in self.cells.get((self.cell(point[0], 0), self.cell(point[1], 1)), ()):
            corners = [self.vertices[i] for i in self.faces[number]]
            if any(min(c[k] for c in corners) > point[k] or max(c[k] for c in corners) < point[k] for k in range(2)):
                continue
            d = [[fractions.Fraction(x) - y for x, y in zip(c, p)] for c in corners]
            minors = [d[i][0] * d[(i + 1) % 3][1] - d[i][1] * d[(i + 1) % 3][0] for i in range(3)]
            if min(minors) < 0 < max(minors):
                continue
            if 0 in minors:
                return None
            height = sum(m * d[(i + 2) % 3][2] for i, m in enumerate(minors)) / sum(minors)
            if abs(height) <= margin:
                return None
            if height > 0:
                winding += 1 if minors[0] > 0 else -1
        return winding


def open_edges(faces):
    balance = collections.Counter()
    for face in faces:
        for i in range(3):
            a, b = face[i], face[(i + 1) % 3]
            if a == b:
                return 1
            balance[min(a, b), max(a, b)] += 1 if a < b else -1
    return sum(1 for n in balance.values() if n)


def make_point(rng, result, box):
    if result.faces and rng.random() < 0.7:
        a, b, c = (result.vertices[i] for i in rng.choice(result.faces))
        u, v = sorted((rng.random(), rng.random()))
        size = max(h - l for l, h in box) * 10 ** rng.uniform(-7, -2)
        return [u * x + (v - u) * y + (1 - v) * z + rng.gauss(0, size) for x, y, z in zip(a, b, c)]
    return [rng.uniform(l, h) for l, h in box]


def run_case(ebpo, models, rng, number, folder):
    names = [rng.choice(MODELS), rng.choice(MODELS)]
    if rng.random() < 0.2:
        names[1] = names[0]
    operator = rng.choice("|&-^")
    doubles = rng.random() < 0.5
    solids, arguments = [], []
    for k, name in enumerate(names):
        path = folder / f"{name}.ebpo.h5"
        if not path.exists():
            subprocess.run([ebpo, "convert", "-q", str(models / f"{name}.ply"), str(path)], check=True)
        vertices, faces = read_ply(models / f"{name}.ply")
        extent = max(max(v[i] for v in vertices) - min(v[i] for v in vertices) for i in range(3))
        rotation, scale = random_rotation(rng), rng.uniform(0.7, 1.3) / extent
        centre = pose([tuple(sum(v[i] for v in vertices) / len(vertices) for i in range(3))], rotation, scale,
                      (0, 0, 0))[0]
        shift = [rng.gauss(0, 0.2) * k - c for c in centre]
        kind = rng.random()
        if kind < 0.1 and k == 1 and names[0] == names[1]: # equal models at equal poses
            rotation, scale, shift = placed
        elif kind < 0.4 and k == 1 and names[0] == names[1]: # nearly equal ones
            rotation, scale = placed[:2]
            shift = [math.nextafter(t, 9) for t in placed[2]]
        placed = rotation, scale, shift
        numbers = [x for row, t in zip(rotation, shift) for x in (*row, t)] + [scale]
        arguments += ["--pose", f"{'AB'[k]} " + " ".join(f"{x:.17g}" for x in numbers)]
        solids.append(Solid(pose(vertices, rotation, scale, shift), faces))
    out = folder / "out.ply"
    command = [ebpo, "boolean", f"A {operator} B", *(str(folder / f"{n}.ebpo.h5") for n in names), *arguments,
               "-o", str(out), *(["--double"] if doubles else []), *(["--memory", "128M"] if number % 4 == 3 else [])]
    done = subprocess.run(command, capture_output=True, text=True)
    label = f"case {number}: {names[0]} {operator} {names[1]}"
    if done.returncode not in (0, 5):
        return f"{label}: {done.returncode}: {done.stderr}", 0
    result = Solid(*read_ply(out))
    if open_edges(result.faces):
        return f"{label}: open edges", 0
    box = [(min(s.low[i] for s in solids) - 0.1, max(s.high[i] for s in solids) + 0.1) for i in range(3)]
    margin, tested = (1e-14 if doubles else 1e-6), 0
    for _ in range(POINTS):
        point = make_point(rng, result, box)
        windings = [s.winding(point, margin) for s in (*solids, result)]
        if None in windings:
            continue
        right = OPERATORS[operator](windings[0] != 0, windings[1] != 0)
        if windings[2] != right:
            return f"{label}: at {point}: {windings}; {' '.join(command)}", tested
        tested += 1
    return None, tested


def main():
    ebpo, models = sys.argv[1], pathlib.Path(sys.argv[2])
    scale = float(os.environ.get("EBPO_TEST_SCALE", 1))
    cases = int(sys.argv[3]) if len(sys.argv) > 3 else max(2, round(40 * scale))
    rng, tested, failures = random.Random(int(sys.argv[4]) if len(sys.argv) > 4 else 1), 0, []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(cases):
            failure, points = run_case(ebpo, models, rng, number, pathlib.Path(folder))
            tested += points
            if failure:
                failures.append(failure)
                print(failure, flush=True)
    print(f"{cases} results, {tested} points, {len(failures)} failures")
    return 1 if failures or tested < 10 * cases else 0


if __name__ == "__main__":
    sys.exit(main())
