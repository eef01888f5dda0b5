#!/usr/bin/env python3
"""Contacts and distances of two copies of a model, beside FCL: docs/measured/collide.md.

    tests/bench/collide.py BUILD OUT.md MODEL.ply=MODEL.ebpo.h5 ... [--poses 4] [--rounds 5]

BUILD is a release build with -Dpeers=enabled: its pairs_ebpo makes the poses and answers, pairs_fcl
answers with FCL. Both run on one thread, in turns, question by question; a time is the least of
--rounds, by the processor's clock. A column is the mean over poses of one kind. The pairs of faces are
compared pose by pose: how many only one of the two has.
"""
import argparse
import os
import pathlib
import platform
import statistics
import struct
import subprocess
import sys
import tempfile

# Question, FCL's name for it, kinds of poses.
ROWS = [
    ("first contact", "first", "first", ("slight", "deep", "slight-turned", "deep-turned")),
    ("none", "first", "first", ("none",)),
    ("all pairs", "all", "all", ("slight", "deep", "slight-turned", "deep-turned")),
    ("distance, exact", "distance", "distance", ("apart",)),
    ("distance, within 1e-12", "within", "distance", ("apart",)),
]


def run(command):
    return subprocess.run(list(map(str, command)), check=True, capture_output=True, text=True).stdout


def ask(program, model, poses, question, rounds, pairs=None):
    """What it took to be made, and (kind, microseconds, value) for each pose."""
    lines = run([program, model, poses, question, rounds] + ([pairs] if pairs else [])).splitlines()
    made = lines[0].split()
    answers = [(kind, float(us), float(value)) for kind, us, value in map(str.split, lines[1:])]
    return (float(made[1]), int(made[2])), answers


def read_pairs(path):
    data = pathlib.Path(path).read_bytes()
    at = 0
    while at < len(data):
        (count,) = struct.unpack_from("<Q", data, at)
        numbers = struct.unpack_from(f"<{2 * count}Q", data, at + 8)
        yield set(zip(numbers[::2], numbers[1::2]))
        at += 8 + 16 * count


def compare_pairs(ours, theirs):
    """Pairs in all, those only we have, those only they have."""
    out = [0, 0, 0]
    for a, b in zip(read_pairs(ours), read_pairs(theirs)):
        out[0] += len(a)
        out[1] += len(a - b)
        out[2] += len(b - a)
    return out


def mean(answers, kind):
    return statistics.mean(us for k, us, _ in answers if k == kind)


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
        got["ours", ours] = ask(programs / "pairs_ebpo", tree, poses, ours, args.rounds,
                                folder / f"ours.{ours}")
        if ("theirs", theirs) not in got:
            got["theirs", theirs] = ask(programs / "pairs_fcl", ply, poses, theirs, args.fcl_rounds,
                                        folder / f"theirs.{theirs}")
    return got, compare_pairs(folder / "ours.all", folder / "theirs.all")


def table(name, count, got, pairs):
    (our_time, our_bytes), (their_time, _) = got["ours", "all"][0], got["theirs", "all"][0]
    lines = [f"## {name}: {count:,} faces", "",
             f"Opening the file takes {our_time:.2f} s of the processor and {our_bytes / count:.0f} B a "
             f"face of memory; FCL builds its tree in {their_time:.2f} s at each start.", "",
             "| question | poses | us | FCL, us | FCL / ours |", "|---|---|---|---|---|"]
    for title, ours, theirs, kinds in ROWS:
        for kind in kinds:
            a, b = mean(got["ours", ours][1], kind), mean(got["theirs", theirs][1], kind)
            lines.append(f"| {title} | {kind} | {a:.1f} | {b:.1f} | **{b / a:.1f}** |")
    deep = [(us, n) for k, us, n in got["ours", "all"][1] if k.startswith("deep") and n]
    apart = [(x[2], y[2]) for x, y in zip(got["ours", "distance"][1], got["theirs", "distance"][1])]
    off = max(abs(x - y) / max(x, y, 1e-300) for x, y in apart if x or y)
    lines += ["", f"Deep pairs take {sum(u for u, _ in deep) / sum(n for _, n in deep):.2f} us each. "
              f"Of {pairs[0]:,} pairs in all poses {pairs[1]} only we have, {pairs[2]} only FCL has; "
              f"distances differ by {off:.1e} of themselves at most.", ""]
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("models", nargs="+", metavar="PLY=EBPO")
    parser.add_argument("--poses", type=int, default=4, help="of each kind, straight and turned")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--fcl-rounds", type=int, default=2)
    args = parser.parse_args()
    names = " ".join("=".join(pathlib.Path(p).name for p in m.split("=")) for m in args.models)
    lines = ["# Two models that meet, beside FCL", "",
             "Made by", "",
             f"    tests/bench/collide.py BUILD collide.md {names} --poses {args.poses} "
             f"--rounds {args.rounds} --fcl-rounds {args.fcl_rounds}", "",
             f"with a release build, FCL of Debian (BVHModel of OBBRSS, doubles), one thread each, load "
             f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} processors. Poses: slight and deep are in by 1 "
             "and 20 % of the diagonal, none is out by 2 %, apart is at a distance of 1 %. Times are the "
             "least of the rounds by the processor's clock, means over poses.", ""]
    for model in args.models:
        ply, tree = model.split("=")
        with tempfile.TemporaryDirectory() as folder:
            got, pairs = measure(args.build, ply, tree, args, pathlib.Path(folder))
        lines += table(pathlib.Path(ply).stem, faces(ply), got, pairs)
        args.out.write_text("\n".join(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
