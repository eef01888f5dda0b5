#!/usr/bin/env python3
"""Measures ebpo_open with two builds of the library, locally and by URL.

    tests/bench/opening.py BEFORE/lib/libebpo.so AFTER/lib/libebpo.so MODEL.ebpo.h5... [--rounds 5] [--count 100]

A round runs before, after, after, before, each in a new process. A process opens and closes a file COUNT times (by
URL a tenth of that; this process runs the server) and takes the median. The table has the least of these medians, and
the median of the rounds' ratios. Requests and bytes are those of one opening. The files are in the page cache.
"""
import argparse
import ctypes
import json
import pathlib
import statistics
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
import ranges_server  # noqa: E402


def child(library, name, count):
    """Print the median time in nanoseconds of `count` openings."""
    ebpo, file, times = ctypes.CDLL(library), ctypes.c_void_p(), []
    ebpo.ebpo_close.argtypes = [ctypes.c_void_p]
    for _ in range(count):
        begin = time.perf_counter_ns()
        if ebpo.ebpo_open(name.encode(), ctypes.byref(file), None) != 0:
            sys.exit(f"{library}: {name} cannot be opened")
        times.append(time.perf_counter_ns() - begin)
        ebpo.ebpo_close(file)
    print(json.dumps(statistics.median(times)))


def timed(library, name, count):
    return json.loads(subprocess.run([sys.executable, __file__, "--child", library, name, str(count)],
                                     check=True, capture_output=True, text=True).stdout)


def in_turns(libraries, name, count, rounds):
    """Return the least medians of both libraries in microseconds, and the median ratio."""
    found, ratios = ([], []), []
    for _ in range(rounds):
        turn = ([], [])
        for i in (0, 1, 1, 0):
            turn[i].append(timed(libraries[i], name, count))
        ratios.append(sum(turn[1]) / sum(turn[0]))
        for i in (0, 1):
            found[i].extend(turn[i])
    return min(found[0]) / 1e3, min(found[1]) / 1e3, statistics.median(ratios)


class Counted:
    """Counts the requests and bytes of one opening."""

    def __init__(self, data):
        self.requests = self.bytes = 0
        handler, first = ranges_server.Handler, ranges_server.Handler.do_GET

        def counting(request):
            found = request.headers.get("Range", "")
            begin, end = found[6:].split("-") if found else (0, len(data) - 1)
            self.requests += 1
            self.bytes += int(end) - int(begin) + 1
            first(request)

        handler.do_GET = counting
        self.url = ranges_server.serve(data)
        self.undo = lambda: setattr(handler, "do_GET", first)

    def once(self, library):
        self.requests = self.bytes = 0
        timed(library, self.url, 1)
        return self.requests, self.bytes


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("libraries", nargs=2)
    parser.add_argument("models", nargs="+", type=pathlib.Path)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--count", type=int, default=100)
    given = parser.parse_args()
    print("| file | MB | before, us | after, us | ratio | URL: before, us | after, us | ratio | requests | bytes |\n"
          "|---|---|---|---|---|---|---|---|---|---|")
    for model in given.models:
        before, after, ratio = in_turns(given.libraries, str(model), given.count, given.rounds)
        server = Counted(model.read_bytes())
        requests = [server.once(library) for library in given.libraries]
        far = in_turns(given.libraries, server.url, max(given.count // 10, 1), given.rounds)
        server.undo()
        print(f"| {model.name} | {model.stat().st_size / 1e6:.1f} | {before:.0f} | {after:.0f} | {ratio:.2f} "
              f"| {far[0]:.0f} | {far[1]:.0f} | {far[2]:.2f} | {requests[0][0]}, {requests[1][0]} "
              f"| {requests[0][1]:,}, {requests[1][1]:,} |", flush=True)


if sys.argv[1:2] == ["--child"]:
    child(sys.argv[2], sys.argv[3], int(sys.argv[4]))
else:
    main()
