#!/usr/bin/env python3
"""Remakes docs/measured/tables.md: sizes and build rates of real models.

    tests/bench/tables.py EBPO MODELS_DIR [LARGE.ply] > docs/measured/tables.md

EBPO: the tool. MODELS_DIR: a folder of PLY files with the names used below. LARGE.ply: a generated model of several
million faces. Sizes are the same on every machine; seconds are not.
"""
import contextlib
import io
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

from query_page import reflow

EBPO, MODELS = sys.argv[1], pathlib.Path(sys.argv[2])
LARGE = sys.argv[3:4]
SOLIDS = ["bunny_closed", "armadillo", "dragon100k", "lucy100k", "igea", "skull", "thingi73416",
          "thingi99865"]
found = {"size": [], "ratio": [], "rate": [], "violations": 0}


def run(*arguments, **options):
    return subprocess.run(arguments, check=True, capture_output=True, text=True, **options).stdout


def convert(model, target, *options):
    start, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    run(EBPO, "convert", "-q", *options, str(model), target)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    wall = time.monotonic() - start
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads(run(EBPO, "info", "--json", target)), wall, cpu


def plain_ply(info):
    return info["vertices"] * (24 if info["double_coordinates"] else 12) + info["faces"] * 13


def row(*cells):
    print("| " + " | ".join(str(cell) for cell in cells) + " |")


def head(*cells):
    row(*cells)
    row(*["---"] * len(cells))


def size_table(folder):
    print("## Size\n\nThe columns from *B/face* to *maps* are B per face, in total and by part. "
          "*Plain PLY*: 12 B per vertex and 13 B per face.\n")
    head("model", "faces", "file", "B/face", "vertices", "faces", "lists and tree", "planes",
         "maps", "of plain PLY",
         "without maps")
    for name in SOLIDS:
        info, _, _ = convert(MODELS / f"{name}.ply", f"{folder}/{name}.ebpo.h5")
        small, _, _ = convert(MODELS / f"{name}.ply", f"{folder}/small.ebpo.h5", "--parts",
                              "-maps")
        n, b = info["faces"], info["bytes"]
        found["size"].append(b["file"] / n)
        found["ratio"].append(b["file"] / plain_ply(info))
        planes = 4 * sum(level["planes"] for level in info["levels"])
        row(name, n, b["file"], f"{b['file'] / n:.2f}", f"{b['vertices'] / n:.2f}",
            f"{b['faces'] / n:.2f}",
            f"{(b['levels'] - planes) / n:.2f}", f"{planes / n:.2f}", f"{b['maps'] / n:.2f}",
            f"{b['file'] / plain_ply(info):.3f}", f"{small['bytes']['file'] / plain_ply(info):.3f}")


def speed_table(folder):
    print("\n## Build and verify\n\nWhole commands on all cores.\n")
    head("model", "faces", "convert s", "CPU s", "faces/s", "peak MB", "verify s")
    for path in [MODELS / f"{name}.ply" for name in SOLIDS] + [pathlib.Path(p) for p in LARGE]:
        target = f"{folder}/speed.ebpo.h5"
        best = min((convert(path, target) for _ in range(1 if path in map(pathlib.Path, LARGE)
                                                         else 3)), key=lambda r: r[1])
        info, wall, cpu = best
        peak = peak_memory(EBPO, "convert", "-q", str(path), target)
        start = time.monotonic()
        report = json.loads(run(EBPO, "verify", "--json", target, "--against", str(path)))
        found["rate"].append(info["faces"] / wall)
        found["violations"] += report["violations"]
        row(path.stem, info["faces"], f"{wall:.2f}", f"{cpu:.2f}", f"{info['faces'] / wall:,.0f}",
            f"{peak:.0f}",
            f"{time.monotonic() - start:.2f}")


def peak_memory(*command):
    pid = os.spawnvp(os.P_NOWAIT, command[0], command)
    _, status, usage = os.wait4(pid, 0)
    assert status == 0
    return usage.ru_maxrss / 1024


def main():
    body = io.StringIO()
    with contextlib.redirect_stdout(body), tempfile.TemporaryDirectory() as folder:
        size_table(folder)
        speed_table(folder)
    sizes, ratios, rates = (found[k] for k in ("size", "ratio", "rate"))
    print(reflow("# Sizes and build times\n\n"
          f"- A file takes {min(sizes):.2f} to {max(sizes):.2f} B per face, {min(ratios):.3f} to "
          f"{max(ratios):.3f} of a plain binary PLY.\n"
          f"- `ebpo convert` builds {min(rates):,.0f} to {max(rates):,.0f} faces per second on all "
          "cores.\n"
          f"- `ebpo verify` finds {found['violations']} violations.\n\n"
          "Made by `tests/bench/tables.py EBPO MODELS_DIR a5.ply > docs/measured/tables.md`, with "
          "`ebpo-generate --base armadillo.ply --subdivide 3 a5.ply`. Sizes do not depend on the "
          "machine.\n"))
    print(body.getvalue(), end="")


main()
