#!/usr/bin/env python3
"""Remakes docs/measured/tables.md: sizes, levels and build rates of real models, beside the figures
of the two theses.

    tests/bench/tables.py EBPO MODELS_DIR [LARGE.ply] > docs/measured/tables.md

EBPO: the tool; MODELS_DIR: a folder of PLY files with the names used below; LARGE.ply: a generated
model of several million faces. Sizes and volumes are the same on every machine; seconds are not.
"""
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

EBPO, MODELS = sys.argv[1], pathlib.Path(sys.argv[2])
LARGE = sys.argv[3:4]
SOLIDS = ["bunny_closed", "armadillo", "dragon100k", "lucy100k", "igea", "skull", "thingi73416",
          "thingi99865"]
# Envelope volume in percent of the model's, BP-Octree thesis (2008): figures for bunny (71,040
# faces) and armadillo (150,000 faces).
BP = {"bunny_closed": [171.41, 144.71, 119.92, 107.33, 103.11, 101.14, 100.55],
      "armadillo": [388.73, 214.88, 139.57, 116.78, 107.99, 103.45, 101.57, 100.92]}
# A prototype's figures for the dragon (202,000 faces), no coalescing: greedy with inheritance, and
# the hull of the solid in each cell.
DRAGON_GREEDY = [304, 203, 166, 134, 111, 103.6, 101.24, 100.46, 100.17]
DRAGON_LIMIT = [272, 188, 156, 125, 107, 102.3, 100.75, 100.24, 100.08]


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
    print("## Size\n\nB/face by part; *plain PLY* is 12 B a vertex and 13 B a face.\n")
    head("model", "faces", "file", "B/face", "vertices", "faces", "lists and tree", "planes",
         "maps", "of plain PLY",
         "without maps")
    for name in SOLIDS:
        info, _, _ = convert(MODELS / f"{name}.ply", f"{folder}/{name}.ebpo.h5")
        small, _, _ = convert(MODELS / f"{name}.ply", f"{folder}/small.ebpo.h5", "--without",
                              "maps")
        n, b = info["faces"], info["bytes"]
        planes = 4 * sum(level["planes"] for level in info["levels"])
        row(name, n, b["file"], f"{b['file'] / n:.2f}", f"{b['vertices'] / n:.2f}",
            f"{b['faces'] / n:.2f}",
            f"{(b['levels'] - planes) / n:.2f}", f"{planes / n:.2f}", f"{b['maps'] / n:.2f}",
            f"{b['file'] / plain_ply(info):.3f}", f"{small['bytes']['file'] / plain_ply(info):.3f}")


def volumes(info):
    return [level["percent_of_solid"] for level in info["levels"]]


def volume_rows(title, first, rows):
    print(f"\n{title}\n")
    length = max(len(values) for _, values in rows)
    head(first, *[f"L{i}" for i in range(length)])
    for label, values in rows:
        row(label, *[f"{v:.2f}" if v > 100 and v < 1000 or v < 100 else f"{v:.0f}" for v in values],
            *[""] * (length - len(values)))


def level_tables(folder):
    print("\n## Levels\n\nEnvelope volume in percent of the solid's volume.")
    for name in ["bunny_closed", "armadillo"]:
        default, _, _ = convert(MODELS / f"{name}.ply", f"{folder}/a.ebpo.h5")
        every, _, _ = convert(MODELS / f"{name}.ply", f"{folder}/b.ebpo.h5", "--leaf-faces", "0")
        volume_rows(f"{name} ({default['faces']} faces) beside the BP-Octree thesis", "method",
                    [("BP 2008", BP[name]), ("this, `--leaf-faces 0`", volumes(every)),
                     ("this, default (16)", volumes(default))])
    default, _, _ = convert(MODELS / "dragon100k.ply", f"{folder}/a.ebpo.h5")
    every, _, _ = convert(MODELS / "dragon100k.ply", f"{folder}/b.ebpo.h5", "--leaf-faces", "0")
    ratio = [(a - 100) / (b - 100) for a, b in zip(volumes(every), DRAGON_GREEDY)]
    volume_rows("dragon100k (100,000 faces) beside a prototype on the dragon with 202,000 faces, "
                "no coalescing", "method",
                [("prototype, greedy and inheritance", DRAGON_GREEDY),
                 ("prototype, hull in each cell: the limit", DRAGON_LIMIT),
                 ("this, `--leaf-faces 0`", volumes(every)),
                 ("this, default (16)", volumes(default))])
    print("\nExcess over 100 %, `--leaf-faces 0` against the prototype's greedy: "
          + ", ".join(f"L{i} {r:.2f}" for i, r in enumerate(ratio)) + ".")


def speed_table(folder):
    print("\n## Build and verify\n\nWhole commands: reading, checking, building, compressing, "
          "fsync; all cores of the machine.\n")
    head("model", "faces", "convert s", "CPU s", "faces/s", "peak MB", "verify s", "checks",
         "violations")
    for path in [MODELS / f"{name}.ply" for name in SOLIDS] + [pathlib.Path(p) for p in LARGE]:
        target = f"{folder}/speed.ebpo.h5"
        best = min((convert(path, target) for _ in range(1 if path in map(pathlib.Path, LARGE)
                                                         else 3)), key=lambda r: r[1])
        info, wall, cpu = best
        peak = peak_memory(EBPO, "convert", "-q", str(path), target)
        start = time.monotonic()
        report = json.loads(run(EBPO, "verify", "--json", target, "--against", str(path)))
        row(path.stem, info["faces"], f"{wall:.2f}", f"{cpu:.2f}", f"{info['faces'] / wall:,.0f}",
            f"{peak:.0f}",
            f"{time.monotonic() - start:.2f}", report["checks"], report["violations"])


def peak_memory(*command):
    pid = os.spawnvp(os.P_NOWAIT, command[0], command)
    _, status, usage = os.wait4(pid, 0)
    assert status == 0
    return usage.ru_maxrss / 1024


def main():
    print("# Tables\n\nMade by `tests/bench/tables.py EBPO MODELS_DIR LARGE.ply > "
          "docs/measured/tables.md` (a5: `ebpo-generate --base armadillo.ply --subdivide 3 "
          "a5.ply`); nothing here was typed in by hand but the "
          "two theses' and the prototype's figures, which the script names.\n")
    with tempfile.TemporaryDirectory() as folder:
        size_table(folder)
        level_tables(folder)
        speed_table(folder)


main()
