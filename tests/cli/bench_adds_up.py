#!/usr/bin/env python3
"""bench_adds_up.py POINTS.raw [INFO.json]: checks that the output of ebpo bench --json on standard input is
consistent and agrees with the saved points.

With INFO.json (ebpo info --json) the points are a path: steps are at most a tenth of the mean edge plus
the swing, and points are within the box and its margin.
"""
import array
import json
import math
import sys

bench = json.load(sys.stdin)
wide = 6 if bench["query"].startswith("ray") else 3
points = array.array("d", open(sys.argv[1], "rb").read())
wrong = []


def check(name, good):
    if not good:
        wrong.append(name)


ns = bench["ns"]
check("quantiles ascend", 0 <= ns["p50"] <= ns["p99"] <= ns["p999"] <= ns["max"]
      and 0 < ns["mean"] <= ns["max"])
check("as many points as counted", len(points) == wide * bench["count"])
check("as many results as points", sum(bench["results"].values()) == bench["count"])
check("opening precedes the first result",
      0 < bench["cold_open_seconds"] <= bench["cold_first_result_seconds"])
check("bytes were read", 0 < bench["cold_bytes_read"]
      and 0 < bench["bytes_read"] == bench["model"]["bytes_read"])
check("batch", bench["batch_ns"] > 0)
check("budget", not bench["model"]["budget"]
      or bench["model_at_end"]["memory_peak"] <= bench["model"]["budget"])
if len(sys.argv) > 2:
    mesh = json.load(open(sys.argv[2], encoding="utf-8"))["report"]
    low, high = mesh["min"], mesh["max"]
    diagonal = math.dist(low, high)
    rows = [points[i:i + 3] for i in range(0, len(points), 3)]
    step = mesh["mean_edge"] / 10 + 0.02 * diagonal * 0.1
    check("steps are short", all(math.dist(a, b) <= step for a, b in zip(rows, rows[1:])))
    check("the path moves", max(math.dist(rows[0], r) for r in rows) > 0.1 * diagonal)
    check("points are near the box",
          all(l - 0.011 * diagonal <= c <= h + 0.011 * diagonal for r in rows
              for l, c, h in zip(low, r, high)))
print("; ".join(wrong) or "fine")
