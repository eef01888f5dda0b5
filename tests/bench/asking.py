#!/usr/bin/env python3
"""What the command adds to the library: asking many questions by `ebpo inside` and `ebpo distance`.

    tests/bench/asking.py EBPO MODEL.ebpo.h5 [--count N] [--turns T] [--before EBPO]

Points are uniform in the model's box (`ebpo bench --save-points`). In turns: the library alone
(`ebpo bench`, all questions at once on one thread), then the command with raw and with text input,
with one and with two threads, each time with as much memory as it wants (--memory 64GiB). The
library's time is that of the clock, so the machine should do nothing else. Other times are the
processors', user and system, without those of one question, in ns a point: the least of the turns.
Wall clocks are those of the same runs.
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
    done = subprocess.run([ebpo, "bench", "--json", "--query", query, "--points", raw, "--raw",
                           model], capture_output=True, check=True, text=True)
    return json.loads(done.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("ebpo")
    parser.add_argument("model")
    parser.add_argument("--count", type=int, default=1000000)
    parser.add_argument("--turns", type=int, default=9)
    parser.add_argument("--before", help="an older ebpo, for comparison")
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
                            ("one question", [*plain, one]),
                            ("raw, 1 thread", [*plain, raw, "--raw", "--threads", "1"]),
                            ("raw, 2 threads", [*plain, raw, "--raw", "--threads", "2"]),
                            ("text, 1 thread", [*plain, text, "--threads", "1"]),
                            ("text, 2 threads", [*plain, text, "--threads", "2"])):
                        found.setdefault((query, program, name), []).append(
                            run(command, f"{folder}/out"))
                found.setdefault((query, "library"), []).append(
                    library(a.ebpo, a.model, query, raw)["batch_ns"])
        print("| question | program | how | CPU, ns a point | wall, ns a point | CPU / library |\n"
              "|---|---|---|---|---|---|")
        for key, values in found.items():
            if len(key) == 2 or key[2] == "one question":
                continue
            opened = found[key[0], key[1], "one question"]
            alone = min(found[key[0], "library"])
            cpu, wall = ((min(v[i] for v in values) - min(v[i] for v in opened)) / a.count * 1e9
                         for i in (0, 1))
            print(f"| {key[0]} | {'before' if key[1] == a.before else 'now'} | {key[2]} | "
                  f"{cpu:.0f} | {wall:.0f} | {cpu / alone:.2f} |")
        for query in "inside", "distance":
            print(f"\n{query}, the library alone, one thread: "
                  f"{min(found[query, 'library']):.0f} ns a point, median "
                  f"{statistics.median(found[query, 'library']):.0f}")


main()
