"""Checks of tests/bench/query.py that do not depend on time.

They judge results by rational arithmetic, and count cache misses with valgrind.
"""
import json
import re
import subprocess

from query_page import figure
from query_programs import NAMES

loads = json.loads
QUERIES = ["ray", "ray-any", "ray-all", "distance", "inside"]
# Data caches of 48 KiB and of 2 MiB, lines of 64 bytes.
CACHES = ["--cache-sim=yes", "--D1=49152,12,64", "--LL=2097152,16,64"]
MISSES = {("ray", "uniform"): 20000, ("distance", "uniform"): 2000, ("distance", "path"): 20000,
          ("inside", "path"): 20000}


# ---- results ----

def judge(bench, model, query, raw, which):
    peers = [p for p in bench.peers(model) if p != "cgal" or query not in ("ray-any", "ray-all")]
    core, files = bench.options.side_core, []
    for peer in peers:
        source = model.file if peer == "ebpo" else model.ply
        files.append(bench.work / f"judged.{peer}")
        bench.run(bench.program(peer), source, query, raw, "--results", files[-1], core=core)
    found = loads(bench.run(bench.build / "tests" / "bench" / "exact_judge", "judge", model.file,
                            query, raw, "inf", 1e-6 * model.diagonal, *files, core=core))
    return {"query": query, "which": which, "count": found["count"], "on": found["on"],
            "peers": dict(zip(peers, found["results"]))}


def judge_results(bench, model):
    count, rows = bench.options.judged, []
    for query in QUERIES:
        rays = query.startswith("ray")
        for points in ("uniform", "camera" if rays else "path"):
            rows.append(judge(bench, model, query, model.queries_of(points, count, rays), points))
        rows.append(judge(bench, model, query, model.hard(rays, count), "hard"))
    return model, rows


def write_results(page, model, rows):
    shown = [r for r in rows if r["which"] == "hard" or any(map(wrong, r["peers"].values()))]
    page.text("## Correctness", "",
              f"{model.name}, compared with rational arithmetic over all faces "
              "(`tests/bench/exact_judge`). *hard*: queries on, at and through vertices, edges and "
              "planes. *wrong*: another classification, hit or number of hits, or a distance or "
              "position that differs by more than 1e-6 of the diagonal. *not rounded*: results of "
              "ours with another value than the correctly rounded one, another first face or "
              "another sign. Embree rounds the query to single precision: its result is right for a nearby point or ray. "
              "Points on the surface count only for programs that report them. The "
              f"table omits {len(rows) - len(shown)} rows without a wrong result.")
    page.table(["query", "points", "count", "ours, wrong", "ours, not rounded", "Embree, wrong",
                "CGAL, wrong"],
               [[r["query"], r["which"], f"{r['count']:,}"]
                + [figure(wrong(r["peers"].get("ebpo"))), figure(r["peers"]["ebpo"]["bits"])]
                + [figure(wrong(r["peers"].get(p))) for p in ("embree", "cgal")] for r in shown])


def wrong(verdict):
    return None if verdict is None else verdict["decisions"] + verdict["values"]


# ---- cache misses ----

def cachegrind(bench, peer, model, query, raw, count):
    """Return instructions, and data misses of the first and the last level, of a whole run."""
    source = model.file if peer == "ebpo" else model.ply
    words = bench.command("valgrind", "--tool=cachegrind", *CACHES, "--cachegrind-out-file=/dev/null",
                          bench.program(peer), source, query, raw, "--count", count,
                          *(["--warm"] if query == "distance" and peer == "ebpo" else []),
                          core=bench.options.side_core)
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"valgrind: {done.stderr.strip()[-300:]}")
    return [int(re.search(rf"{name}\s*:\s*([\d,]+)", done.stderr)[1].replace(",", ""))
            for name in ("I +refs", "D1 +misses", "LLd misses")]


def count_misses(bench, models):
    rows = []
    for model in models:
        for (query, points), count in MISSES.items():
            raw = model.queries_of(points, count, query == "ray")
            for peer in ("ebpo", "embree"):
                few = cachegrind(bench, peer, model, query, raw, 1)
                all_of = cachegrind(bench, peer, model, query, raw, count)
                rows.append([model.name, query, points, NAMES[peer]]
                            + [(a - b) / (count - 1) for a, b in zip(all_of, few)])
    return rows


def write_misses(page, rows):
    page.text("## Cache misses", "",
              "Per query, counted by valgrind's cachegrind with data caches of 48 KiB and 2 MiB. "
              "Loading is excluded: a run with one query is subtracted.")
    page.table(["model", "query", "points", "program", "instructions", "misses of 48 KiB",
                "misses of 2 MiB"], [row[:4] + [figure(v) for v in row[4:]] for row in rows])


def write(page, found):
    if found["results"]:
        write_results(page, *found["results"])
    if found["misses"]:
        write_misses(page, found["misses"])
