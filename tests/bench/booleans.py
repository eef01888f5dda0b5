#!/usr/bin/env python3
"""Measures meshes of Boolean operations beside manifold3d and CGAL's corefinement, and writes the page of results.

    tests/bench/booleans.py BUILD_DIR MODEL.ply [--subdivide 1,2] [--python PYTHON] [--corefine-below 2] [--rounds 3]
        [-o docs/measured/booleans.md]
    tests/bench/booleans.py BUILD_DIR MODEL.ply --picture docs/pictures/booleans.png

The model is subdivided, and a copy of it, turned and moved, is subtracted from it and united with it. PYTHON has the
packages manifold3d and numpy. CGAL's program is tests/bench/peers/peer_corefine of a build with -Dpeers=enabled; it
takes part below the given subdivision. Rounds interleave the programs. Times are processor times, because they depend
less on other load; peaks are of resident memory. --picture measures nothing, and draws A - B with the faces of A and
of B in two colours.
"""
import argparse
import math
import os
import pathlib
import statistics
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import measured

ROOT = pathlib.Path(__file__).resolve().parents[2]
TURN, SHIFT = (0.1, 0.2, 0.3, 0.9), (0.04, 0.03, -0.05)
DEEP = (0.2, 0.1, 0.35)
NAMES = {"ours": "`ebpo`, PLY", "limited": "with `--memory 512M`", "model": "`ebpo`, .ebpo.h5", "manifold": "manifold3d",
         "corefine": "CGAL"}


def matrix(shift):
    x, y, z, w = (c / math.hypot(*TURN) for c in TURN)
    rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    return " ".join(repr(c) for row, t in zip(rows, shift) for c in (*row, t))


def commands(arguments, work, mesh, level, operator, pose):
    """Return the command of each program."""
    build, model = arguments.build, mesh.with_suffix(".ebpo.h5")
    ours = [build / "tools/ebpo", "boolean", f"A {operator} B", model, model, "--pose", f"B {pose} 1", "-o"]
    peers = [mesh, mesh, operator, pose]
    corefine = build / "tests/bench/peers/peer_corefine"
    out = {"ours": [*ours, work / "o.ply"], "limited": [*ours, work / "l.ply", "--memory", "512M"],
           "model": [*ours, work / "o.ebpo.h5"]}
    if arguments.python:
        out["manifold"] = [arguments.python, ROOT / "tests/bench/peers/boolean_manifold.py", *peers, work / "m.ply"]
    if corefine.exists() and level < arguments.corefine_below:
        out["corefine"] = [corefine, *peers, work / "c.off"]
    return out


def measure(arguments, work, level):
    mesh = work / f"m{level}.ply"
    measured.run(arguments.build / "samples/ebpo-generate", "--base", arguments.model, "--subdivide", level, mesh)
    measured.run(arguments.build / "tools/ebpo", "convert", "-q", mesh, mesh.with_suffix(".ebpo.h5"))
    facts = measured.run_json(arguments.build / "tools/ebpo", "info", "--json", mesh.with_suffix(".ebpo.h5"))["report"]
    shift = [t * max(facts["box_size"]) for t in SHIFT]
    rows = []
    for operator in "-|":
        programs = commands(arguments, work, mesh, level, operator, matrix(shift))
        runs = {name: [] for name in programs}
        for _ in range(arguments.rounds):
            for name, command in programs.items():
                runs[name].append(measured.run(*command))
        same = (work / "o.ply").read_bytes() == (work / "l.ply").read_bytes()
        rows.append((facts["faces"], operator, runs, same))
    return rows


def draw(arguments, work):
    """Draw the difference of the model and its turned copy; faces have the colours of their operands."""
    build, model, out = arguments.build, work / "m.ebpo.h5", work / "o.ply"
    measured.run(build / "tools/ebpo", "convert", "-q", arguments.model, model)
    size = max(measured.run_json(build / "tools/ebpo", "info", "--json", model)["report"]["box_size"])
    pose = matrix([t * size for t in DEEP])
    measured.run(build / "tools/ebpo", "boolean", "A - B", model, model, "--pose", f"B {pose} 1",
                 "--operand-colours", "-o", out)
    measured.run(build / "tools/ebpo", "render", out, "-o", arguments.picture, "--mesh", "--view", arguments.view,
                 "--size", "900x700")


def middle(runs, key):
    return statistics.median(run[key] for run in runs)


def table(results, key, unit, digits):
    """Return a table of medians: a row for each operation, a column for each program."""
    yield "| " + " | ".join(["faces", "operation", *NAMES.values()]) + " |"
    yield "|---" * (2 + len(NAMES)) + "|"
    for faces, operator, runs, _ in results:
        cells = [f"{middle(runs[name], key) / unit:,.{digits}f}" if name in runs else "" for name in NAMES]
        yield "| " + " | ".join([f"{faces:,}", "difference" if operator == "-" else "union", *cells]) + " |"


def goals(results):
    """Return rows of goals that are missed, and of those that are met."""
    last = [r for r in results if "manifold" in r[2]][-2:]
    rows = []
    for key, limit, text in (("cpu", 0.5, "processor time / manifold3d, PLY"), ("peak", 0.25, "peak / manifold3d, PLY")):
        worst = max((middle(r[2]["ours"], key) / middle(r[2]["manifold"], key) for r in last), default=math.nan)
        rows.append((worst <= limit, f"| {text}, largest model | {worst:.2f} ({limit}) |"))
    for name, limit in (("ours", 10), ("model", 35)):
        worst = max(middle(r[2][name], "wall") for r in results[-2:])
        rows.append((worst <= limit, f"| {NAMES[name]}, largest model, wall-clock s | {worst:.1f} ({limit}) |"))
    return [text for good, text in rows if not good], [text for good, text in rows if good]


def page(arguments, results):
    missed, met = goals(results)
    tail = ""
    if arguments.output.exists():
        tail = arguments.output.read_text().partition("<!-- Written by hand")[2]
    yield "# Boolean operations as meshes"
    yield ""
    yield "`ebpo boolean -o` is exact but for one rounding of new vertices; manifold3d computes in floating point, and"
    yield "CGAL's corefinement with exact predicates and constructions in doubles. [Guide](../guide/booleans.md)."
    yield ""
    yield "## Goals"
    yield ""
    for title, rows in (("missed", missed), ("met", met)):
        if rows:
            yield f"| {title} | measured (goal) |"
            yield "|---|---|"
            yield from rows
            yield ""
    yield "## Measurement"
    yield ""
    yield f"Made by `tests/bench/booleans.py BUILD_DIR {arguments.model.name} --subdivide {arguments.subdivide} --rounds"
    yield f"{arguments.rounds} --python PYTHON --corefine-below {arguments.corefine_below}` on {measured.machine()}."
    yield f"The load average was {os.getloadavg()[2]:.0f}. B is A, turned and moved"
    yield "by a twentieth of its size. Times and peaks are of whole commands, reading and writing included, on all cores;"
    yield "medians of the rounds. `ebpo` reads .ebpo.h5 files, the others PLY files; CGAL writes OFF."
    yield ""
    yield "Processor seconds:"
    yield ""
    yield from table(results, "cpu", 1, 1)
    yield ""
    yield "Peaks in MiB:"
    yield ""
    yield from table(results, "peak", measured.MIB, 0)
    yield ""
    if all(r[3] for r in results):
        yield "The PLY files with and without a limit of memory are equal byte for byte."
    if tail:
        yield ""
        yield "<!-- Written by hand" + tail.rstrip()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=lambda p: pathlib.Path(p).resolve())
    parser.add_argument("model", type=pathlib.Path)
    parser.add_argument("--subdivide", default="1,2")
    parser.add_argument("--python")
    parser.add_argument("--corefine-below", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("-o", dest="output", type=pathlib.Path, default=ROOT / "docs/measured/booleans.md")
    parser.add_argument("--picture", type=pathlib.Path)
    parser.add_argument("--view", default="30,20")
    arguments = parser.parse_args()
    results = []
    with tempfile.TemporaryDirectory() as folder:
        if arguments.picture:
            draw(arguments, pathlib.Path(folder))
            return
        for level in arguments.subdivide.split(","):
            results += measure(arguments, pathlib.Path(folder), int(level))
    arguments.output.write_text("\n".join(page(arguments, results)) + "\n")


main()
