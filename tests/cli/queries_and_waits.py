#!/usr/bin/env python3
"""queries_and_waits.py MODEL: queries `ebpo inside MODEL` with one point after the other through a pipe, and
waits for each result before the next point.
"""
import subprocess
import sys

with subprocess.Popen(["ebpo", "inside", sys.argv[1]], stdin=subprocess.PIPE,
                      stdout=subprocess.PIPE, text=True) as ebpo:
    for point, result in [("0.5 0.5 0.5", "IN 1"), ("2 0 0", "OUT 0"), ("1 1 1", "ON 0")] * 3:
        ebpo.stdin.write(point + "\n")
        ebpo.stdin.flush()
        if ebpo.stdout.readline() != result + "\n":
            sys.exit(f"{point}: not {result}")
    ebpo.stdin.write("0.25 0.5 0.75")  # the last line may lack its line end
    ebpo.stdin.close()
    print("fine" if ebpo.stdout.read() == "IN 1\n" and ebpo.wait() == 0 else "not fine")
