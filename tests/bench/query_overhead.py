#!/usr/bin/env python3
"""Measures the overhead of `ebpo inside` and `ebpo distance` over the library, for many queries.

    tests/bench/query_overhead.py EBPO MODEL.ebpo.h5 [--count N] [--turns T] [--before EBPO]
                          [--large LARGE.ebpo.h5]

Points are uniform in the model's box (`ebpo bench --save-points`). In turns it runs the library alone
(`ebpo bench` on one thread; for two threads, two processes with all points at the same time), then
the command with raw and with text input, with one and with two threads and --memory 64GiB. Times of
the command exclude those of one query and are the minimum of the turns, in ns per point. Wall-clock
times need an idle machine; on a busy one, compare the processor times. --large queries one point of
that model in a new process with the default memory.
"""
import argparse
import array
import json
import pathlib
import resource
import statistics
import subprocess
import tempfile
import time


def run(command, out):
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    with open(out, "wb") as f:
        subprocess.run(command, stdin=subprocess.DEVNULL, stdout=f, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
            time.monotonic() - begin)


def library(ebpo, model, query, raw):
    """Returns the library's ns per point on one thread, and on two."""
    command = [ebpo, "bench", "--json", "--query", query, "--points", raw, "--raw", model]

    def of(processes):
        return max(json.loads(p.communicate()[0])["batch_ns"] for p in processes)

    def begin():
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    return of([begin()]), of([begin(), begin()]) / 2


def query_large(ebpo, model, folder, turns):
    """Query one point after the other, each in a new process."""
    raw, out = f"{folder}/large.raw", f"{folder}/out"
    subprocess.run([ebpo, "bench", "--count", "20", "--save-points", raw, model],
                   stdout=subprocess.DEVNULL, check=True)
    xyz = array.array("d", pathlib.Path(raw).read_bytes())
    print(f"\nOne point of {pathlib.Path(model).name} "
          f"({pathlib.Path(model).stat().st_size / 1e6:.0f} MB), in ms:\n\n"
          "| query | minimum, wall-clock | median, wall-clock | median, CPU |\n"
          "|---|---|---|---|")
    for query in "inside", "distance":
        times = []
        for i in range(20 * turns):
            point = f"{folder}/point.txt"
            pathlib.Path(point).write_text(" ".join(map(repr, xyz[3 * (i % 20):3 * (i % 20) + 3])),
                                           encoding="ascii")
            times.append(run([ebpo, query, model, point], out))
        cpu, wall = ([1000 * t[k] for t in times] for k in (0, 1))
        print(f"| {query} | {min(wall):.0f} | {statistics.median(wall):.0f} | "
              f"{statistics.median(cpu):.0f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("ebpo")
    parser.add_argument("model")
    parser.add_argument("--count", type=int, default=1000000)
    parser.add_argument("--turns", type=int, default=9)
    parser.add_argument("--before", help="an older ebpo, for comparison")
    parser.add_argument("--large", help="a large model, in which one point is queried")
    a = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        raw, text, one = (str(pathlib.Path(folder, n)) for n in ("p.raw", "p.txt", "one.txt"))
        subprocess.run([a.ebpo, "bench", "--count", str(a.count), "--save-points", raw, a.model],
                       stdout=subprocess.DEVNULL, check=True)
        xyz = array.array("d", pathlib.Path(raw).read_bytes())
        with open(text, "w", encoding="ascii") as f:
            f.writelines(f"{xyz[3 * i]!r} {xyz[3 * i + 1]!r} {xyz[3 * i + 2]!r}\n"
                         for i in range(a.count))
        pathlib.Path(one).write_text("0 0 0\n", encoding="ascii")
        found = {}
        for _ in range(a.turns):
            for query in "inside", "distance":
                for program in filter(None, (a.ebpo, a.before)):
                    plain = [program, query, "--memory", "64GiB", a.model]
                    for name, command in (
                            ("one query", [*plain, one]),
                            ("raw, 1 thread", [*plain, raw, "--raw", "--threads", "1"]),
                            ("raw, 2 threads", [*plain, raw, "--raw", "--threads", "2"]),
                            ("text, 1 thread", [*plain, text, "--threads", "1"]),
                            ("text, 2 threads", [*plain, text, "--threads", "2"])):
                        found.setdefault((query, program, name), []).append(
                            run(command, f"{folder}/out"))
                found.setdefault((query, "library"), []).append(
                    library(a.ebpo, a.model, query, raw))
        print("| query | program | input | CPU, ns per point | wall-clock, ns per point | "
              "CPU / library on one thread | wall-clock / library on as many |\n"
              "|---|---|---|---|---|---|---|")
        for key, values in found.items():
            if len(key) == 2 or key[2] == "one query":
                continue
            opened = found[key[0], key[1], "one query"]
            alone = [min(v[i] for v in found[key[0], "library"]) for i in (0, 1)]
            cpu, wall = ((min(v[i] for v in values) - min(v[i] for v in opened)) / a.count * 1e9
                         for i in (0, 1))
            print(f"| {key[0]} | {'before' if key[1] == a.before else 'now'} | {key[2]} | "
                  f"{cpu:.0f} | {wall:.0f} | {cpu / alone[0]:.2f} | "
                  f"{wall / alone['2' in key[2]]:.2f} |")
        for query in "inside", "distance":
            one, two = (min(v[i] for v in found[query, "library"]) for i in (0, 1))
            print(f"\n{query}, the library alone: {one:.0f} ns per point on one thread, {two:.0f} on two")
        if a.large:
            query_large(a.ebpo, a.large, folder, a.turns)


main()
