#!/usr/bin/env python3
"""Tests the sample with MPI: mpi.py EBPO GENERATE MPIRUN MPI_INSIDE

It must give the results of the command on 1, 2 and 4 processes, byte for byte. An error must end all processes with
its message, and leave no results.
"""
import os
import random
import struct
import subprocess
import sys
import tempfile

ROWS = 600_001  # more rows than two processes handle at a time


def main():
    ebpo, generate, mpirun, inside = (os.path.abspath(path) for path in sys.argv[1:])
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        subprocess.run([generate, "--subdivide", "4", "m.ply"], check=True, stdout=subprocess.DEVNULL)
        subprocess.run([ebpo, "convert", "-q", "m.ply", "m.ebpo.h5"], check=True)
        numbers = random.Random(1)
        some = b"".join(struct.pack("<3d", *(numbers.uniform(-1, 1) for _ in range(3))) for _ in range(5000))
        with open("p.raw", "wb") as file:
            file.write((some * (ROWS // 5000 + 1))[:24 * ROWS])
        want = subprocess.run([ebpo, "inside", "--raw", "m.ebpo.h5", "p.raw"], check=True,
                              capture_output=True).stdout
        wrong = []

        def run(processes, *arguments):
            return subprocess.run([mpirun, "--oversubscribe", "--allow-run-as-root", "-n", str(processes),
                                   inside, *arguments], capture_output=True, text=True, timeout=120)

        for processes in (1, 2, 4):
            done = run(processes, "m.ebpo.h5", "p.raw", "a.raw")
            with open("a.raw", "rb") as file:
                if done.returncode or file.read() != want:
                    wrong.append(f"{processes} processes: {done.returncode} {done.stderr}")
            os.remove("a.raw")
        with open("cut.raw", "wb") as file:
            file.write(some[:30])
        with open("nan.raw", "wb") as file:  # found after some results are written
            file.write(some * (ROWS // 5000) + struct.pack("<3d", 0, 0, float("nan")))
        for arguments, message in ((("no.ebpo.h5", "p.raw", "a.raw"), "no.ebpo.h5: "),
                                   (("m.ebpo.h5", "cut.raw", "a.raw"), "does not contain rows of three doubles"),
                                   (("m.ebpo.h5", "no.raw", "a.raw"), "no.raw: "),
                                   (("m.ebpo.h5", "nan.raw", "a.raw"),
                                    f"points from index {2 << 18} on: point {ROWS - 1 - (2 << 18)} has"),
                                   (("m.ebpo.h5", "p.raw", "a.raw", "2x"), "usage: ")):
            done = run(2, *arguments)
            if not done.returncode or message not in done.stderr or os.path.exists("a.raw"):
                wrong.append(f"{arguments}: {done.returncode} {done.stderr}")
        os.link("p.raw", "same.raw")
        for name in ("p.raw", "same.raw", "m.ebpo.h5"):
            size, done = os.path.getsize(name), run(2, "m.ebpo.h5", "p.raw", name)
            if not done.returncode or "would overwrite" not in done.stderr or os.path.getsize(name) != size:
                wrong.append(f"{name}: {done.returncode} {done.stderr}")
        print("\n".join(wrong) or "OK")
        os.chdir("/")
    return 1 if wrong else 0


sys.exit(main())
