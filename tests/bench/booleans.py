#!/usr/bin/env python3
"""Measures meshes of Boolean operations beside manifold3d and CGAL's corefinement, and writes the page of results.

    tests/bench/booleans.py BUILD_DIR MODEL.ply [--subdivide 1,2] [--python PYTHON] [--corefine-below 2] [--rounds 3]
        [-o docs/measured/booleans.md]

The model is subdivided, and a copy of it, turned and moved, is subtracted from it and united with it. PYTHON has the
packages manifold3d and numpy. CGAL's program is tests/bench/peers/peer_corefine of a build with -Dpeers=enabled; it
takes part below the given subdivision. Rounds interleave the programs. Times are processor times, because they depend
less on other load; peaks are of resident memory.
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
NAMES = {"ours": "`ebpo boolean`, PLY", "limited": "the same, `--memory 512M`", "model": "`ebpo boolean`, .ebpo.h5",
         "manifold": "manifold3d", "corefine": "CGAL's corefinement"}


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


def middle(runs, key):
    return statistics.median(run[key] for run in runs)


def table(results):
    yield "| faces | operation | program | processor s | of manifold3d | peak MiB | of manifold3d |"
    yield "|---|---|---|---|---|---|---|"
    for faces, operator, runs, _ in results:
        for name, of in runs.items():
            cpu, peak = middle(of, "cpu"), middle(of, "peak") / measured.MIB
            share = ["", ""]
            if "manifold" in runs and name != "manifold":
                share = [f"{cpu / middle(runs['manifold'], 'cpu'):.2f}",
                         f"{peak / (middle(runs['manifold'], 'peak') / measured.MIB):.2f}"]
            operation = "A - B" if operator == "-" else "union"
            yield f"| {faces:,} twice | {operation} | {NAMES[name]} | {cpu:.1f} | {share[0]} | {peak:,.0f} | {share[1]} |"


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
    yield f"{arguments.rounds} --python PYTHON --corefine-below {arguments.corefine_below}` on {measured.machine()};"
    yield f"load average {os.getloadavg()[2]:.0f}. B is A, turned and moved by a twentieth of its size."
    yield "Times and peaks are of whole commands, reading and writing included, on all cores; medians of the rounds."
    yield ""
    yield from table(results)
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
    arguments = parser.parse_args()
    results = []
    with tempfile.TemporaryDirectory() as folder:
        for level in arguments.subdivide.split(","):
            results += measure(arguments, pathlib.Path(folder), int(level))
    arguments.output.write_text("\n".join(page(arguments, results)) + "\n")


main()
