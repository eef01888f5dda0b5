#!/usr/bin/env python3
"""Judges points inside real models with holes: winding_judge.c evaluates them without the library.

    scans.py EBPO JUDGE FOLDER POINTS FULL [MODEL...]

FOLDER contains PLY files. Of each model POINTS points are judged by exact rays and solid angles of a cone over the
border; FULL of these also by sums over all faces. All results must be equal, with the model in memory and in 256 MiB.
EBPO_TEST_SCALE reduces both counts.
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import time

EBPO, JUDGE, FOLDER = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
SCALE = float(os.environ.get("EBPO_TEST_SCALE", "1"))
POINTS, FULL = (max(1, int(float(count) * SCALE)) for count in sys.argv[4:6])
MODELS = sys.argv[6:] or ["blade", "bunny", "dragon_vrip", "motorbike"]

problems = 0


def run(*arguments, stdout=None):
    return subprocess.run([str(a) for a in arguments], stdout=stdout or subprocess.PIPE, check=True).stdout


for name in MODELS:
    source = FOLDER / f"{name}.ply"
    with tempfile.TemporaryDirectory() as folder:
        file, points, results, within = (pathlib.Path(folder) / n for n in ("m.ebpo.h5", "points", "m.npy", "w.npy"))
        subprocess.run([EBPO, "convert", "--quiet", str(source), str(file)], check=True, stderr=subprocess.DEVNULL)
        with open(points, "wb") as out:
            run(JUDGE, "points", source, POINTS, 1, stdout=out)
        for target, memory in ((results, []), (within, ["--memory", "256M"])):
            with open(target, "wb") as out:
                run(EBPO, "inside", "--raw", "--npy", *memory, file, points, stdout=out)
        begin = time.time()
        done = subprocess.run([JUDGE, "check", str(source), str(points), str(results), str(FULL)],
                              stdout=subprocess.PIPE, text=True)
        print(f"{name}: {POINTS} points, {done.stdout.strip()} ({time.time() - begin:.0f} s)", flush=True)
        problems += done.returncode != 0
        if results.read_bytes() != within.read_bytes():
            print(f"{name}: results in 256 MiB differ")
            problems += 1
sys.exit(problems > 0)
