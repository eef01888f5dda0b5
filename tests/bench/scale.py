#!/usr/bin/env python3
"""Remakes docs/measured/scale.md: generated models of growing size, built, verified, decoded, opened and queried within a
memory budget, compared with Embree and CGAL.

    tests/bench/scale.py BUILD_DIR [--sizes 0.1,1,8,28] [--memory 1GiB] [--rounds N] -o
    docs/measured/scale.md [--json FILE]

BUILD_DIR: a release build configured with -Dtests=enabled -Dpeers=enabled (tools/install-deps.sh --tests --bench
installs the required packages). ebpo-generate makes the models, which are kept in --work. 28 million faces need 1 GB
with all derived files, and as much for temporary files. Run it on an idle machine. The results are medians of the
rounds, in which the programs take turns. The handwritten end of an existing page is kept.
"""
import argparse
import json
import os
import pathlib
import re
import shlex
import statistics
import sys

import measured
from measured import MIB, Failed
from query_page import Page, figure, handwritten, ratio, reflow

QUERY_BUDGET = 256 * MIB
OPENINGS = 5
LARGE = 2000000  # models with at least this many faces have a third of the rounds
GOALS = {"build_seconds": 150, "growth": 1.3, "first_levels": 1e6, "ratio_full": 0.60,
         "ratio_without_maps": 0.50, "decode": 300e6, "verify_times_build": 2,
         "first_result": 0.050, "p999": 1e6}


class Scale:
    def __init__(self, options):
        self.options = options
        self.build = pathlib.Path(options.build)
        self.ebpo = self.build / "tools" / "ebpo"
        self.work = pathlib.Path(options.work or self.build / "bench-scale")
        self.work.mkdir(parents=True, exist_ok=True)
        self.load, self.problems = [], []
        self.verify_options = ["--memory", options.memory, "--temp-dir",
                               self.work] if "--memory" in measured.run(self.ebpo, "verify", "--help")["printed"] else []

    def rounds(self, faces):
        return self.options.rounds if faces < LARGE else max(1, self.options.rounds // 3)

    def run(self, *command, cold=None, needs_json=True, accept=(0,)):
        """Run a command. When it fails, return None and add a line to the page."""
        if self.options.verbose:
            print("+", shlex.join(map(str, command)), file=sys.stderr)
        self.load.append(os.getloadavg()[0])
        held = measured.drop_from_memory(cold) if cold else None
        try:
            figures = (measured.run_json if needs_json else measured.run)(*command, accept=accept)
            return {**figures, "held_before": held}
        except (Failed, OSError, ValueError) as error:
            print(f"scale.py: {error}", file=sys.stderr)
            self.problems.append(str(error))
            return None

    def peer(self, name, ply):
        return self.run(self.build / "tests" / "bench" / "peers" / f"peer_{name}", ply, "build",
                        "--threads", 0, "--cold")


# ---- measuring ----

def generate(scale, millions):
    target = scale.work / f"{scale.options.base}_{millions:g}m.ply"
    command = ["ebpo-generate", "--base", scale.options.base, "--faces", str(round(millions * 1e6)),
               target.name]
    made = None
    if not target.exists():
        made = scale.run(scale.build / "samples" / "ebpo-generate", *command[1:-1], target,
                         needs_json=False)
        if not made:
            sys.exit("scale.py: no model, no results")
    return target, command, made


def build_all(scale, ply, file, faces):
    """Build with ours and the peers in turns, with a cold PLY each time."""
    runs = {"ebpo": [], "embree": [], "cgal": []}
    for _ in range(scale.rounds(faces)):
        runs["ebpo"].append(scale.run(scale.ebpo, "convert", "--json", "-q", "--memory",
                                      scale.options.memory, "--temp-dir", scale.work, ply, file,
                                      cold=ply))
        for peer in "embree", "cgal":
            runs[peer].append(scale.peer(peer, ply))
    return {name: [r for r in some if r] for name, some in runs.items()}


def sizes_of(scale, file, bare, first):
    """Return the sizes on the disk: files with and without maps, and the first levels."""
    info = scale.run(scale.ebpo, "info", "--json", file)["report"]
    scale.run(scale.ebpo, "subset", "-q", "--parts", "-maps", file, bare, needs_json=False)
    scale.run(scale.ebpo, "subset", "-q", "--levels", "0-5", file, first, needs_json=False)
    last = info["levels"][min(5, len(info["levels"]) - 1)]
    return {"info": info, "file": file.stat().st_size,
            "without_maps": bare.stat().st_size if bare.exists() else None,
            "plain_ply": info["vertices"] * (24 if info["double_coordinates"]
                                             else 12) + info["faces"] * 13,
            "first_levels": last["cumulative_bytes"],
            "first_levels_file": first.stat().st_size if first.exists() else None}


def run_query(scale, file, query, count, *arguments, seed=1):
    return scale.run(scale.ebpo, "bench", file, "--memory", QUERY_BUDGET, "--query", query,
                     "--points", "path", "--count", count, "--seed", seed, "--json", *arguments)


def measure_queries(scale, file, largest):
    """Measure opening with one query; for the largest model also a path, at full speed and at a haptic device's rate.

    The one query is near the surface, so it must load data, and at another position each time.
    """
    o = scale.options
    return {query: {"open": [run_query(scale, file, query, 1, seed=seed) for seed in range(1, OPENINGS + 1)],
                    "path": largest and run_query(scale, file, query, o.count, "--prefetch"),
                    "rate": largest and run_query(scale, file, query, o.rate_count, "--prefetch", "--rate", 1000)}
            for query in ("inside", "distance")}


def study(scale, millions, largest):
    ply, command, made = generate(scale, millions)
    file = ply.with_suffix(".ebpo.h5")
    others = [ply.with_suffix(f".{kind}.ebpo.h5") for kind in ("bare", "first")]
    faces = round(millions * 1e6)
    result = {"millions": millions, "command": command, "made": made,
              "ply_bytes": ply.stat().st_size}
    result["builds"] = build_all(scale, ply, file, faces)
    if not result["builds"]["ebpo"]:
        return result
    result["sizes"] = sizes_of(scale, file, *others)
    result["decode"] = scale.run(scale.build / "tests" / "bench" / "bench_decode", file, "--rounds",
                                 scale.options.rounds)
    verified = [scale.run(scale.ebpo, "verify", "--json", *scale.verify_options, file, cold=file,
                          accept=(0, 1)) for _ in range(scale.rounds(faces))]  # 1: violations, which are reported
    result["verify"] = [v for v in verified if v]
    result["queries"] = measure_queries(scale, file, largest)
    for path in others:
        path.unlink(missing_ok=True)
    return result


# ---- statistics ----

def middle(runs, *keys):
    """Return the median over the runs of a value; None without runs."""
    values = []
    for value in runs:
        for key in keys:
            value = value.get(key) if value else None
        if value is not None:
            values.append(value)
    return statistics.median(values) if values else None


def mib(count, digits=4):
    return figure(None if count is None else count / MIB, digits)


def divided(a, b):
    return a / b if a is not None and b else None


def faces_of(result):
    return result["sizes"]["info"]["faces"]


def built(result):
    return middle(result["builds"]["ebpo"], "wall")


def growth(results):
    """Return ratios of the seconds per face, for models of at least a million faces.

    The first ratio is that of the largest model to the smallest; the second is the worst of all pairs of a larger and a
    smaller model.
    """
    costs = [built(r) / faces_of(r) for r in results if faces_of(r) >= 0.9e6]
    if len(costs) < 2:
        return None, None
    return costs[-1] / costs[0], max(b / a for i, a in enumerate(costs) for b in costs[i + 1:])


# ---- the page ----

def section_build(page, scale, results):
    page.text("## Building", "",
              f"The times are those of the whole command `ebpo convert --memory {scale.options.memory}` "
              "with a cold PLY, all cores. The models are closed tori (`ebpo-generate --base torus "
              "--faces N`) without self-intersections. *Peak*: maximum resident memory, mapped files "
              "included. *Written*: bytes written to storage, with temporary files. *Verify*: "
              f"`ebpo verify {shlex.join(map(str, scale.verify_options[:2]))}`, cold file.")
    rows = []
    for r in results:
        ours, faces = r["builds"]["ebpo"], faces_of(r)
        rows.append([f"{r['millions']:g} M", f"{faces:,}", figure(built(r)),
                     figure(middle(ours, "cpu")), figure(1e6 * built(r) / faces),
                     mib(middle(ours, "peak")), mib(middle(ours, "storage_written")),
                     figure(middle(r["verify"], "wall")),
                     mib(middle(r["verify"], "peak"))])
    page.table(["model", "faces", "s", "CPU s", "us per face", "peak MiB", "written MiB",
                "verify s", "peak MiB"], rows)


def section_peers(page, results):
    page.text("### Trees in memory", "",
              "The trees are Embree 3's BVH (medium quality, robust, single precision, all cores) "
              "and CGAL's AABB tree (double, one core). The ratios include reading the "
              "cold PLY.")
    rows = []
    for r in results:
        row = [f"{r['millions']:g} M"]
        for peer in "embree", "cgal":
            runs = r["builds"][peer]
            row += [figure(middle(runs, "report", "build_s")), mib(middle(runs, "peak")),
                    ratio(built(r), middle(runs, "wall"))]
        rows.append(row)
    page.table(["model", "Embree build s", "peak MiB", "ours / Embree, whole",
                "CGAL build s", "peak MiB", "ours / CGAL, whole"], rows)


def section_size(page, results):
    page.text("## Size", "",
              "*Without maps*: `ebpo subset --parts -maps`. *Levels 0 to 5*: the first bytes of "
              "the file, up to the end of level 5. *Plain PLY*: 12 B per vertex and 13 B per "
              "face.")
    rows = []
    for r in results:
        s, faces = r["sizes"], faces_of(r)
        rows.append([f"{r['millions']:g} M", mib(s["file"]), f"{s['file'] / faces:.3f}",
                     f"{s['file'] / s['plain_ply']:.3f}", mib(s["without_maps"]),
                     figure(divided(s["without_maps"], s["plain_ply"])),
                     f"{s['first_levels']:,}"])
    page.table(["model", "file MiB", "B/face", "of plain PLY", "without maps MiB", "of plain PLY",
                "levels 0 to 5, bytes"], rows)


def with_longest(seconds):
    return (f"{figure(1e3 * statistics.median(seconds))} / {figure(1e3 * max(seconds))}" if seconds
            else "-")


def warm_seconds(report):
    """Return the seconds of the only query."""
    return report["open_seconds"] + report["ns"]["max"] * 1e-9


def opening_row(r, query):
    runs = r["queries"][query]["open"]
    reports = [run["report"] for run in runs if run]
    return [f"{r['millions']:g} M", query, with_longest([warm_seconds(f) for f in reports]),
            with_longest([f["cold_first_result_seconds"] for f in reports])]


def section_questions(page, results, options):
    page.text("## Opening and queries", "",
              f"The budget is {QUERY_BUDGET // MIB} MiB (`ebpo bench --memory "
              f"{QUERY_BUDGET}`), all cores. The table has the ms from opening to the "
              f"first exact result near the surface, as median and maximum of {OPENINGS} points; "
              "*warm*, *cold*: the file is or is not in the page cache.")
    page.table(["model", "query", "warm", "cold"],
               [opening_row(r, query) for r in results for query in ("inside", "distance")])
    page.text("The table has the us per query along a path on the surface of the largest model, "
              "with prefetch hints: "
              f"{options.count:,} queries without pauses, and {options.rate_count:,} at 1,000 Hz, the "
              "haptic rate.")
    rows = []
    for r in results[-1:]:
        for query in "inside", "distance":
            for kind, words in [("path", "without pauses"), ("rate", "1,000 Hz")]:
                run = r["queries"][query][kind]
                if run:
                    ns, model = run["report"]["ns"], run["report"]["model"]
                    rows.append([query, words] + [figure(ns[q] / 1000)
                                           for q in ("mean", "p50", "p99", "p999",
                                                     "max")] + [f"{model['loads']:,}",
                                                                mib(model["memory_peak"], 3)])
    page.table(["query", "rate", "mean", "p50", "p99", "p99.9", "max", "subtrees loaded",
                "model peak MiB"], rows)


def bytes_of(size):
    """Return the bytes of a size in the syntax of `ebpo convert --memory`."""
    number, power, binary = re.fullmatch("([0-9.]+)([KMGTkmgt]?)(i?)B?", size).groups()
    return int(float(number) * (1024 if binary else 1000)**" KMGT".index(power.upper() or " "))


def section_goals(page, scale, results):
    """Print the values of the largest model beside the goals."""
    r = results[-1]
    s, by_query = r["sizes"], r["queries"]
    first = [run["report"] for query in by_query.values() for run in query["open"] if run]
    tails = {kind: max((query[kind]["report"]["ns"]["p999"] for query in by_query.values()
                        if query[kind]), default=None) for kind in ("path", "rate")}
    budget = bytes_of(scale.options.memory)
    _, worst = growth(results)
    checks = [("build, s", built(r), GOALS["build_seconds"], "most"),
              ("build, peak MiB", max(run["peak"] for run in r["builds"]["ebpo"]) / MIB,
               budget / MIB, "most"), ("growth, worst pair", worst, GOALS["growth"],
                                       "most"), ("file size / plain PLY", s["file"] / s["plain_ply"],
                                                 GOALS["ratio_full"], "most"),
              ("file size / plain PLY, without maps", divided(s["without_maps"], s["plain_ply"]),
               GOALS["ratio_without_maps"], "most"), ("levels 0 to 5, bytes", s["first_levels"],
                                                      GOALS["first_levels"], "most"),
              ("decoding, 10^6 B/s a core", r["decode"]
               and r["decode"]["report"]["decoded_bytes_per_second"] / 1e6, GOALS["decode"] / 1e6,
               "least"),
              ("verifying, times the build", divided(middle(r["verify"], "wall"), built(r)),
               GOALS["verify_times_build"], "most"),
              ("verifying, peak MiB",
               divided(max((run["peak"] for run in r["verify"]), default=None), MIB), budget / MIB,
               "most"),
              ("violations", r["verify"][0]["report"]["violations"] if r["verify"] else None, 0,
               "most"),
              ("first result warm, ms", max((warm_seconds(f) for f in first), default=None),
               GOALS["first_result"], "most"),
              ("first result cold, ms",
               max((f["cold_first_result_seconds"] for f in first), default=None),
               GOALS["first_result"], "most"),
              ("p99.9 of a path without pauses, us", tails["path"], GOALS["p999"], "most"),
              ("p99.9 of a path at 1,000 Hz, us", tails["rate"], GOALS["p999"], "most")]
    rows = []
    for name, value, goal, side in checks:
        unit = 1e3 if name.endswith("ms") else 1e-3 if name.endswith("us") else 1
        met = ("-" if value is None else "yes"
               if (value <= goal if side == "most" else value >= goal) else "no")
        rows.append([name, figure(value if value is None else value * unit),
                     figure(goal * unit) if side == "most" else f"at least {figure(goal * unit)}", met])
    page.text("# Scale", "",
              f"- A model of {r['millions']:g} million faces is built in {figure(built(r))} s and "
              f"{figure(checks[1][1])} MiB; the file has {s['file'] / faces_of(r):.3f} B per face.",
              f"- With a budget of {QUERY_BUDGET // MIB} MiB its first exact result comes "
              "at "
              f"most {figure(1e3 * checks[11][1])} ms after opening the cold file." if checks[11][1]
              else "- The first result of a cold file is not measured.")
    page.text("## Goals", "",
              f"Goals are upper limits, except for decoding. All values except the growth are for the model of "
              f"{r['millions']:g} million faces. First results, tails and peaks are the worst values. Growth "
              "compares the seconds per face of a larger and a smaller model, from a million "
              "faces on.")
    for title, met in (("missed", "no"), ("not measured", "-"), ("met", "yes")):
        of_title = [[row[0], f"{row[1]} ({row[2]})"] for row in rows if row[3] == met]
        if of_title:
            page.table([title, "measured (goal)"], of_title)


def command_line(options):
    words = ["tests/bench/scale.py", "BUILD_DIR", "--sizes", options.sizes, "--memory",
             options.memory, "--rounds", str(options.rounds)]
    words += ["--base", options.base] if options.base != "torus" else []
    return shlex.join(words + ["-o", "docs/measured/scale.md"])


def write(scale, results):
    options, page = scale.options, Page()
    results = [r for r in results if "sizes" in r]
    if results:
        section_goals(page, scale, results)
    page.text("## Measurement", "",
              f"Made by `{command_line(options)}` on {measured.machine()}. Medians of "
              f"{options.rounds} rounds (a third of the rounds from {LARGE:,} faces on); "
              f"load average {statistics.median(scale.load):.1f} (median), "
              f"{max(scale.load):.1f} (maximum).")
    if results:
        section_build(page, scale, results)
        section_peers(page, results)
        section_size(page, results)
        section_questions(page, results, options)
    if scale.problems:
        page.text("## Failures", "",
                  *[f"- {p.replace(str(scale.work), 'WORK')}"
                    for p in dict.fromkeys(scale.problems)])
    pathlib.Path(options.output).write_text(reflow(
        "\n".join(page.lines).rstrip("\n") + "\n" + handwritten(options.output)))


# ---- the command ----

def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", metavar="BUILD_DIR")
    parser.add_argument("--sizes", default="0.1,1,8,28",
                        help="millions of faces (default 0.1,1,8,28)")
    parser.add_argument("--base", default="torus", choices=["torus", "sphere"],
                        help="the base of ebpo-generate; a sphere has 20 times a power of "
                             "four faces (default torus)")
    parser.add_argument("--memory", default="1GiB", help="budget of convert and verify (1GiB)")
    parser.add_argument("--rounds", type=int, default=3,
                        help="rounds for models below two million faces; larger ones have a third (default 3)")
    parser.add_argument("--count", type=int, default=1000000,
                        help="queries along a path (default 1,000,000)")
    parser.add_argument("--rate-count", type=int, default=20000,
                        help="queries of these at 1,000 per second (default 20,000)")
    parser.add_argument("--work", metavar="DIR",
                        help="folder for models and temporary files (default BUILD_DIR/bench-scale)")
    parser.add_argument("--json", metavar="FILE", help="file for all values of all runs")
    parser.add_argument("-v", "--verbose", action="store_true", help="print the commands")
    parser.add_argument("-o", "--output", required=True)
    return parser.parse_args()


def main():
    options = parse()
    scale, results = Scale(options), []
    sizes = sorted(float(s) for s in options.sizes.split(","))
    for millions in sizes:
        results.append(study(scale, millions, millions == sizes[-1]))
        write(scale, results)  # the page is complete after each model
        if options.json:
            pathlib.Path(options.json).write_text(json.dumps({"machine": measured.machine(),
                                                              "load": scale.load,
                                                              "problems": scale.problems,
                                                              "results": results}, indent=1, default=str) + "\n")


if __name__ == "__main__":
    main()
