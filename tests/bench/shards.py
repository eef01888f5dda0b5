#!/usr/bin/env python3
"""shards.py EBPO MODEL [--rows N] [--folder F] [--rounds N] [--memory SIZE]: compares one process with two.

Makes N uniform points in the model's box as raw doubles (24 bytes each; F/uniform-N.raw is kept) and classifies them
as inside or outside. One process does it for all points, then two processes at the same time for half of them each, in
turns. Each process has one thread. Prints a line of JSON: points per second; the parallel efficiency (time of one /
(2 * time of two), with and without opening the model); and the bytes that each process reads in all calls (rchar of
/proc) and from the disk. Compares the results byte for byte. Needs numpy.
"""
import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import time

import numpy

BLOCK = 1 << 20


def make_points(path, rows, low, high):
    if os.path.exists(path) and os.path.getsize(path) == 24 * rows:
        return
    random = numpy.random.default_rng(20261127)
    with open(path + ".part", "wb") as file:
        for at in range(0, rows, BLOCK):
            part = random.random((min(BLOCK, rows - at), 3))
            (numpy.array(low) + part * (numpy.array(high) - numpy.array(low))).tofile(file)
    os.rename(path + ".part", path)


def io_of(pid):
    """Return the bytes that a process has read. It has ended but is not waited for."""
    with open(f"/proc/{pid}/io", encoding="ascii") as file:
        return {key: int(value) for key, value in (line.split(":") for line in file)}


def run(command, shards, out):
    """Return the seconds and, for each process, the bytes read and the seconds of opening the model."""
    begun, processes, each = time.monotonic(), [], []
    for i in range(shards):
        processes.append(subprocess.Popen(command + ["--shard", f"{i}/{shards}", "-o", f"{out}.{i}"],
                                          stderr=subprocess.PIPE, text=True))
    for process in processes:
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        read = io_of(process.pid)
        stats = process.stderr.read()
        if process.wait() != 0:
            sys.exit(f"{command}: {process.returncode}")
        each.append({"rchar": read["rchar"], "disk": read["read_bytes"],
                     **{key: float(re.search(rf"\b{key} ([0-9.]+)", stats)[1])
                        for key in ("bytes_read", "loads", "open_seconds")}})
    return time.monotonic() - begun, each


def same(one, parts):
    whole = open(one, "rb")
    for name in parts:
        with open(name, "rb") as part:
            while piece := part.read(1 << 22):
                if whole.read(len(piece)) != piece:
                    return False
    return whole.read(1) == b""


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("ebpo")
    parser.add_argument("model")
    parser.add_argument("--rows", type=int, default=10 ** 7)
    parser.add_argument("--folder", default=".")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--memory", default="0")
    o = parser.parse_args()
    facts = json.loads(subprocess.run([o.ebpo, "info", "--json", o.model], check=True,
                                      capture_output=True).stdout)
    low = facts["box_origin"]
    high = [a + b for a, b in zip(low, facts["box_size"])]
    points = os.path.join(o.folder, f"uniform-{o.rows}.raw")
    make_points(points, o.rows, low, high)
    command = [o.ebpo, "inside", "--raw", "--stats", "--force", "--threads", "1", "--memory", o.memory,
               o.model, points]
    seconds, querying, out = {1: [], 2: []}, {1: [], 2: []}, os.path.join(o.folder, "results")
    for _ in range(o.rounds):
        for shards in (1, 2):
            took, each = run(command, shards, f"{out}.{shards}")
            seconds[shards].append(took)
            querying[shards].append(took - max(t["open_seconds"] for t in each))
            print(json.dumps({"processes": shards, "seconds": took, "each": each}), flush=True)
    if not same(f"{out}.1.0", [f"{out}.2.0", f"{out}.2.1"]):
        sys.exit("the results of two processes differ from those of one")
    one, two = statistics.median(seconds[1]), statistics.median(seconds[2])
    print(json.dumps({"rows": o.rows, "points_a_second_one": o.rows / one,
                      "points_a_second_two": o.rows / two, "efficiency": one / (2 * two),
                      "efficiency_without_opening":
                          statistics.median(querying[1]) / (2 * statistics.median(querying[2]))}))


if __name__ == "__main__":
    main()
