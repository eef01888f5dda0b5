#!/usr/bin/env python3
"""Contacts and distances of two copies of a model, compared with FCL: docs/measured/collide.md.

    tests/bench/collide.py BUILD OUT.md MODEL.ply=MODEL.ebpo.h5 ... [--poses 4] [--rounds 5]
                           [--crossing A.ebpo.h5=B.ebpo.h5=SIZE=BYTES] ...

BUILD is a release build with -Dpeers=enabled: its pairs_ebpo makes the poses and runs the queries,
pairs_fcl runs them with FCL. Both run on one thread, in turns, query by query; a time is the minimum
of --rounds in processor time, and the mean over the poses of one kind. The pairs of faces are compared
pose by pose. A crossing is a scenario of the EBP thesis: B, with a diagonal of SIZE times A's, goes
through A in steps (crossing_ebpo); BYTES is each model's budget, 0: everything is in memory. The
handwritten end of an existing page is kept.
"""
import argparse
import os
import pathlib
import statistics
import struct
import subprocess
import sys
import tempfile

from query_page import handwritten, reflow

# Query, FCL's name for it, kinds of poses.
ROWS = [
    ("first contact", "first", "first", ("slight", "deep", "slight-turned", "deep-turned")),
    ("none", "first", "first", ("none",)),
    ("all pairs", "all", "all", ("slight", "deep", "slight-turned", "deep-turned")),
    ("distance, exact", "distance", "distance", ("apart",)),
    ("distance, within 1e-12", "within", "distance", ("apart",)),
]


def run(command):
    return subprocess.run(list(map(str, command)), check=True, capture_output=True, text=True).stdout


def run_query(program, model, poses, query, rounds, pairs=None):
    """Return the cost of construction, and (kind, microseconds, value) for each pose."""
    lines = run([program, model, poses, query, rounds] + ([pairs] if pairs else [])).splitlines()
    made = lines[0].split()
    results = [(kind, float(us), float(value)) for kind, us, value in map(str.split, lines[1:])]
    return (float(made[1]), int(made[2])), results


def read_pairs(path):
    data = pathlib.Path(path).read_bytes()
    at = 0
    while at < len(data):
        (count,) = struct.unpack_from("<Q", data, at)
        numbers = struct.unpack_from(f"<{2 * count}Q", data, at + 8)
        yield set(zip(numbers[::2], numbers[1::2]))
        at += 8 + 16 * count


def compare_pairs(ours, theirs):
    """Return the number of all pairs, of pairs that only we report, and of pairs that only they report."""
    out = [0, 0, 0]
    for a, b in zip(read_pairs(ours), read_pairs(theirs)):
        out[0] += len(a)
        out[1] += len(a - b)
        out[2] += len(b - a)
    return out


def mean(results, kind):
    return statistics.mean(us for k, us, _ in results if k == kind)


def faces(ply):
    with open(ply, "rb") as stream:
        for line in stream:
            if line.startswith(b"element face"):
                return int(line.split()[2])
    raise SystemExit(f"{ply}: no faces")


def measure(build, ply, tree, args, folder):
    programs = build / "tests/bench/peers"
    poses = folder / "poses"
    poses.write_text(run([programs / "pairs_ebpo", tree, "make", args.poses]))
    got = {}
    for ours, theirs in sorted({(row[1], row[2]) for row in ROWS}):
        got["ours", ours] = run_query(programs / "pairs_ebpo", tree, poses, ours, args.rounds,
                                      folder / f"ours.{ours}")
        if ("theirs", theirs) not in got:
            got["theirs", theirs] = run_query(programs / "pairs_fcl", ply, poses, theirs, args.fcl_rounds,
                                              folder / f"theirs.{theirs}")
    return got, compare_pairs(folder / "ours.all", folder / "theirs.all")


def study(name, count, got, pairs):
    """Return the values of one model for the page."""
    cells = {(title, kind): (mean(got["ours", ours][1], kind), mean(got["theirs", theirs][1], kind))
             for title, ours, theirs, kinds in ROWS for kind in kinds}
    deep = [(us, n) for k, us, n in got["ours", "all"][1] if k.startswith("deep") and n]
    apart = [(x[2], y[2]) for x, y in zip(got["ours", "distance"][1], got["theirs", "distance"][1])]
    return {"name": name, "faces": count, "cells": cells, "ours": got["ours", "all"][0],
            "theirs": got["theirs", "all"][0], "pairs": pairs,
            "deep": sum(u for u, _ in deep) / sum(n for _, n in deep),
            "off": max(abs(x - y) / max(x, y, 1e-300) for x, y in apart if x or y)}


def speeds(models, *titles):
    """Returns the range of FCL's time divided by ours."""
    found = [b / a for m in models for (title, _), (a, b) in m["cells"].items() if title in titles]
    return f"{min(found):.1f} to {max(found):.1f}"


def missed(models):
    """Return the missed goals of all models, one line for each model."""
    out = []
    for m in models:
        slow = [f"{' '.join(dict.fromkeys((title, kind)))} {b / a:.1f}" for (title, kind), (a, b) in m["cells"].items()
                if b / a < (16.7 if title.startswith("distance") else 10)]
        slow += [f"{m['deep']:.2f} us for a deep pair"] if m["deep"] > 0.4 else []
        out += [f"- {m['name']}: {'; '.join(slow)}"] if slow else []
    return out or ["- none"]


def head(models, made):
    wrong = sum(m["pairs"][1] + m["pairs"][2] for m in models)
    distance = "distance, exact"
    lines = ["# Collision compared with FCL", "",
             f"- A first contact is {speeds(models, 'first contact')} times as fast as FCL's, all "
             f"pairs {speeds(models, 'all pairs')} times, an exact distance "
             f"{speeds(models, distance)} times.",
             f"- {wrong} pairs differ from FCL's.",
             f"- Models need {min(m['ours'][1] / m['faces'] for m in models):.0f} to "
             f"{max(m['ours'][1] / m['faces'] for m in models):.0f} B per face in memory; FCL "
             "needs "
             f"{max(m['theirs'][1] / m['faces'] for m in models):.0f}.", "",
             "## Missed goals", "",
             "The goals are ten times FCL's speed for contacts, 0.4 us for a pair of deep poses, "
             "and eight times PQP's speed for a distance. PQP itself is not measured. If PQP takes "
             "0.27 to 0.48 of FCL's time, this goal is 17 to 30 times FCL's speed. Values are FCL's "
             "time divided by ours.", "", *missed(models), "", "## Measurement", "", *made,
             "## Poses", "",
             "The table has the processor time in us and, in parentheses, FCL's time divided by "
             "ours. A time is the minimum of the rounds and the mean over the poses. *slight*, "
             "*deep*: penetration of 1 and 20 % of the diagonal; "
             "*none*: a gap of 2 %; *apart*: a distance of 1 %.", "",
             "| query | poses | " + " | ".join(f"{m['name']}, {m['faces']:,} faces" for m in models) + " |",
             "|---|---|" + "---|" * len(models)]
    for title, _, _, kinds in ROWS:
        for kind in kinds:
            both = [m["cells"][title, kind] for m in models]
            lines.append(f"| {title} | {kind} | "
                         + " | ".join(f"{a:.1f} ({b / a:.1f})" for a, b in both) + " |")
    lines += ["", "*off*: maximum relative difference of distances.", "",
              "| model | opening, s | FCL build, s | MB | FCL, MB | us per deep pair | pairs | "
              "off |",
              "|---|---|---|---|---|---|---|---|"]
    for m in models:
        lines.append(f"| {m['name']} | {m['ours'][0]:.2f} | {m['theirs'][0]:.2f} | "
                     f"{m['ours'][1] / 1e6:.1f} | {m['theirs'][1] / 1e6:.1f} | {m['deep']:.2f} | "
                     f"{m['pairs'][0]:,} | {m['off']:.1e} |")
    return lines + [""]


def run_crossing(build, a, b, size, memory, query, steps):
    """Return the cost of opening, and (microseconds, pairs, loads, bytes) for each step."""
    lines = run([build / "tests/bench/peers/crossing_ebpo", a, b, steps, query, size,
                 memory]).splitlines()
    made = lines[0].split()
    return ((float(made[1]), int(made[2])),
            [(float(us), int(n), int(loads), int(read)) for us, n, loads, read in map(str.split, lines[1:])])


CROSSINGS_HEAD = [
    "## One model through another", "",
    "Scenarios 5.6 and 5.7 of the EBP thesis: the second model moves along x through the first, "
    "with an offset of 1 % of the diagonal from the center. Each step is queried once; processor "
    "time includes loading. [theses.md](theses.md) explains which values of the thesis are comparable.", "",
    "| models | budget each | first contact, us: mean, worst | pairs a step | "
    "all pairs, us: mean, worst | us per pair | loads a step | MB read a step |",
    "|---|---|---|---|---|---|---|---|"]


def mean_worst(steps):
    times = [step[0] for step in steps]
    return f"{statistics.mean(times):,.1f}, {max(times):,.1f}"


def crossing_row(build, crossing, args):
    a, b, size, memory = crossing.split("=")
    _, first = run_crossing(build, a, b, size, memory, "first", args.steps)
    _, every = run_crossing(build, a, b, size, memory, "all", args.steps)
    pairs, us = sum(step[1] for step in every), sum(step[0] for step in every)
    names = " through ".join(pathlib.Path(p).name.split(".")[0] for p in (b, a))
    return (f"| {names}" + (f", {size} of its size" if float(size) not in (0, 1) else "") +
            f" | {int(memory) >> 20 or 'none'}{' MiB' if int(memory) else ''} | "
            f"{mean_worst(first)} | {pairs / len(every):,.0f} | {mean_worst(every)} | "
            f"{us / max(pairs, 1):.2f} | {statistics.mean(s[2] for s in every):.1f} | "
            f"{statistics.mean(s[3] for s in every) / 1e6:.1f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("models", nargs="+", metavar="PLY=EBPO")
    parser.add_argument("--poses", type=int, default=4, help="poses of each kind, straight and turned")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--fcl-rounds", type=int, default=2)
    parser.add_argument("--crossing", action="append", default=[], metavar="A=B=SIZE=BYTES")
    parser.add_argument("--steps", type=int, default=40, help="steps of each crossing")
    args = parser.parse_args()
    names = " ".join("=".join(pathlib.Path(p).name for p in m.split("=")) for m in args.models)
    made = [f"    tests/bench/collide.py BUILD collide.md {names} --poses {args.poses} "
            f"--rounds {args.rounds} --fcl-rounds {args.fcl_rounds} --steps {args.steps}" +
            "".join(" --crossing " + "=".join(pathlib.Path(p).name for p in c.split("=")) for c in args.crossing),
            "",
            "Both programs are release builds with one thread; FCL is that of Debian (BVHModel of "
            "OBBRSS, double). The load average is "
            f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} processors.", ""]
    models, rows, end = [], [], handwritten(args.out)

    def write():
        lines = head(models, made) + (CROSSINGS_HEAD + rows + [""] if rows else [])
        args.out.write_text(reflow("\n".join(lines).rstrip("\n") + "\n" + end))
    for model in args.models:
        ply, tree = model.split("=")
        with tempfile.TemporaryDirectory() as folder:
            got, pairs = measure(args.build, ply, tree, args, pathlib.Path(folder))
        models.append(study(pathlib.Path(ply).stem, faces(ply), got, pairs))
        write()
    for crossing in args.crossing:
        rows.append(crossing_row(args.build, crossing, args))
        write()
    return 0


if __name__ == "__main__":
    sys.exit(main())
