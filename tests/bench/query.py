#!/usr/bin/env python3
"""Remakes docs/measured/queries.md: questions to real models, beside Embree, CGAL and the figures
of the two theses.

    tests/bench/query.py BUILD_DIR MODEL.ply... [--count N] [--faces-from-generator M [--base
    BASE.ply]] -o docs/measured/queries.md

BUILD_DIR: a release build configured with -Dpeers=enabled (tools/install-deps.sh --bench installs
what that needs). Each model is converted once (kept in --work); every figure is the median of
--rounds runs (a third of that above a million faces) in which the programs take turns, one thread
each, on one core. The modes are measured on the largest model below a million faces.

What is asked of `ebpo bench FILE --query inside|distance|ray|ray-any|ray-all --points
uniform|path|camera|segments|degenerate --seed S --count N --json`: --save-points and --save-answers
(both in the peers' layout: tests/bench/peers/peer.hpp; inside: 0 out, 1 in, 2 on the surface), --mode,
--level, --memory BYTES, --prefetch; in its JSON the keys of OURS below.
"""
import argparse
import array
import json
import math
import os
import pathlib
import re
import shlex
import statistics
import subprocess
import sys

SECTIONS = ["inside", "distance", "ray", "opening", "modes", "distance-modes", "out-of-core",
            "leaves"]
PEERS = ["embree", "cgal"]
RAYS = ["uniform", "camera", "segments", "degenerate"]
QUESTIONS = {"ray": "first hit", "ray-any": "any hit", "ray-all": "all hits"}
CUT = 4 # level, of the second way of opening
# Of --count; the peers take up to 200 us for the nearest point of a point far away.
SHARE = {("distance", "uniform"): 10, ("distance", "path"): 2}

# Where `ebpo bench --json` has what.
OURS = {"mean": "ns.mean", "p50": "ns.p50", "p99": "ns.p99", "p999": "ns.p999", "max": "ns.max",
        "batch": "batch_ns", "open": "cold_open_seconds",
        "first": "cold_first_answer_seconds", "read": "cold_bytes_read",
        "peak": "peak_memory_bytes", "memory": "model.memory",
        "memory_peak": "model.memory_peak", "loads": "model.loads"}
PEER = {"mean": "clocked_mean_ns", "batch": "mean_ns", "p50": "p50_ns", "p99": "p99_ns",
        "p999": "p999_ns", "max": "max_ns", "first": "first_answer_s", "peak": "peak_mb"}

# EBP 2017, table 25: microseconds for a test, mean of three models of 26 to 28 million faces,
# random points and a continuous path.
EBP_MODES = {"cache": (1769.11, 256.33), "nodes": (1153.04, 340.56), "subtree": (1264.36, 324.76),
             "cache-plain": (1985.27, 289.64), "nodes-plain": (2389.29, 369.21),
             "subtree-plain": (2607.71, 347.91)}
# EBP 2017, table 26: the same down to level 1, 2, ..., for cache, nodes and subtree; levels to 5
# were in memory.
EBP_LEVELS = [(2.87, 4.45, 3.01, 4.42, 2.87, 4.42), (3.79, 6.07, 3.80, 6.14, 3.81, 6.05),
              (4.20, 6.93, 4.22, 6.92, 4.24, 6.91),
              (4.37, 7.48, 4.37, 7.47, 4.40, 7.47), (4.51, 7.81, 4.50, 7.79, 4.53, 7.78),
              (1872.97, 199.56, 344.70, 234.28, 348.64, 233.94),
              (1931.26, 213.43, 359.03, 294.41, 360.20, 238.28),
              (2128.13, 218.35, 362.53, 322.64, 387.58, 241.00),
              (2121.11, 218.97, 366.25, 347.58, 471.53, 243.81),
              (2122.89, 219.86, 372.98, 372.35, 580.54, 249.05),
              (2467.64, 227.36, 466.90, 423.54, 810.08, 334.14)]
# EBP 2017, table 28: nearest point; envelopes down to level 1, 2, ... (table 27's numbers of the
# levels; table 28 counts from 0).
EBP_DISTANCE = {"recursive": (680.03, 7.612), "leaves": (694.994, 9.269)}
EBP_DISTANCE_LEVELS = [(87.911, 73.668), (25.624, 23.895), (7.595, 9.783), (10.469, 8.252),
                       (9.446, 5.524), (9.293, 4.807),
                       (5286.377, 44.979), (4799.680, 43.943), (4778.741, 44.022),
                       (4781.919, 43.845), (4678.370, 45.809)]
EBP_PATH_MEAN = 256


# ---- running ----

class Bench:
    def __init__(self, options):
        self.options = options
        self.build = pathlib.Path(options.build)
        self.ebpo = self.build / "tools" / "ebpo"
        self.work = pathlib.Path(options.work or self.build / "bench-query")
        self.work.mkdir(parents=True, exist_ok=True)
        self.load = []

    def rounds(self, model):
        return self.options.rounds if model.faces < 1000000 else max(1, self.options.rounds // 3)

    def run(self, *command, pinned=True):
        command = [str(c) for c in command]
        if pinned:
            command = ["taskset", "-c", str(self.options.core)] + command
        if self.options.verbose:
            print("+", shlex.join(command), file=sys.stderr)
        self.load.append(os.getloadavg()[0])
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{shlex.join(command)}: {done.stderr.strip() or done.returncode}")
        return done.stdout

    def ours(self, model, query, *arguments, points="uniform", pinned=True):
        return json.loads(self.run(self.ebpo, "bench", model.file, "--query", query, "--points",
                                   points, "--seed", 1, "--json",
                                   *arguments, pinned=pinned))

    def peer(self, peer, model, query, points, *arguments):
        """None when the peer cannot take the model (CGAL wants closed manifolds for inside)."""
        try:
            return json.loads(self.run(self.build / "tests" / "bench" / "peers" / f"peer_{peer}",
                                       model.ply, query, points, *arguments))
        except RuntimeError as error:
            print(f"query.py: {error}", file=sys.stderr)
            return None


class Model:
    def __init__(self, bench, ply):
        self.ply, self.name = pathlib.Path(ply), pathlib.Path(ply).stem
        self.file = bench.work / f"{self.name}.ebpo.h5"
        if not self.file.exists() or self.file.stat().st_mtime < self.ply.stat().st_mtime:
            bench.run(bench.ebpo, "convert", "-q", self.ply, self.file, pinned=False)
        self.info = json.loads(bench.run(bench.ebpo, "info", "--json", self.file, pinned=False))
        self.faces = self.info["faces"]
        self.diagonal = math.hypot(*self.info["box_size"])


def generated(bench):
    """A model of many faces, scan-like: `ebpo-generate` cuts the base's faces into four until there
    are enough."""
    faces, base = bench.options.faces_from_generator, bench.options.base
    target = bench.work / f"{pathlib.Path(base).stem if base else 'sphere'}_{faces}.ply"
    if not target.exists():
        bench.run(bench.build / "samples" / "ebpo-generate", *(["--base", base] if base else []),
                  "--faces", faces, target, pinned=False)
    return target


def at(report, name):
    """A figure of one of our reports or of a peer's."""
    for key in (PEER if "peer" in report else OURS)[name].split("."):
        report = report[key]
    return report


def median(reports, name):
    """None when a program could not answer."""
    values = [at(r, name) for r in reports if r is not None]
    return statistics.median(values) if values else None


# ---- answers ----

def inside_of(path):
    return pathlib.Path(path).read_bytes()


def hits_of(path):
    """Distances or ray parameters, and faces, of 16 bytes each."""
    data = pathlib.Path(path).read_bytes()
    values, faces = array.array("d", data)[0::2], array.array("q", data)[1::2]
    return values, faces


def lengths_of(path):
    """Of the rays' directions."""
    data = array.array("d", pathlib.Path(path).read_bytes())
    return [math.hypot(*data[i + 3:i + 6]) for i in range(0, len(data), 6)]


def differences(query, ours, theirs, tolerance, lengths=None):
    """How many answers differ. inside: of points that are not on the surface. ray-any: one has a
    hit. ray-all: their number. distance, ray: by more than `tolerance`, or one has none; `lengths`:
    of what the parameters of rays count."""
    if query == "inside":
        return sum(a != b for a, b in zip(inside_of(ours), inside_of(theirs)) if a != 2)
    (a, a_faces), (b, b_faces) = hits_of(ours), hits_of(theirs)
    tolerance = 0.5 if query == "ray-all" else tolerance
    units = lengths if query == "ray" and lengths else [1] * len(a)
    none = [(x < 0) != (y < 0) for x, y in zip(a_faces, b_faces)]
    return sum(n or (f >= 0 and not abs(abs(x) - y) * u <= tolerance)
               for n, f, x, y, u in zip(none, a_faces, a, b, units))


# ---- markdown ----

class Page:
    def __init__(self):
        self.lines = []

    def text(self, *lines):
        self.lines += list(lines) + [""]

    def table(self, head, rows):
        self.lines.append("| " + " | ".join(head) + " |")
        self.lines.append("|" + "---|" * len(head))
        self.lines += ["| " + " | ".join(str(c) for c in row) + " |" for row in rows] + [""]


def figure(value, digits=3):
    """About three digits; a dash where there is none."""
    if value is None:
        return "-"
    if isinstance(value, str):
        return value
    if value == 0 or abs(value) >= 100:
        return f"{value:,.0f}"
    return f"{value:.{digits}g}"


def us(nanoseconds):
    return figure(None if nanoseconds is None else nanoseconds / 1000)


def ratio(ours, theirs):
    return figure(ours / theirs, 2) if ours is not None and theirs else "-"


# ---- sections ----

def compare(bench, model, query, points):
    """Reports of all programs on the same points, in turns."""
    count = max(1, bench.options.count // SHARE.get((query, points), 1))
    raw = bench.work / f"{model.name}.{query}.{points}.raw"
    answers = {who: bench.work / f"answers.{who}" for who in ["ebpo"] + PEERS}
    reports = {who: [] for who in ["ebpo", "embree", "embree warm", "cgal"]}
    for _ in range(bench.rounds(model)):
        reports["ebpo"].append(bench.ours(model, query, "--count", count, "--save-points", raw,
                                          "--save-answers", answers["ebpo"],
                                          points=points))
        for peer in PEERS:
            reports[peer].append(bench.peer(peer, model, query, raw, "--answers", answers[peer]))
        if query == "distance" and points == "path":
            reports["embree warm"].append(bench.peer("embree", model, query, raw, "--warm"))
    wrong = {p: None if None in reports[p] else differences(query, answers["ebpo"], answers[p],
                                                            1e-6 * model.diagonal)
             for p in PEERS}
    return count, reports, wrong


def section_query(bench, page, models, query, title, note):
    page.text(f"## {title}", "", note)
    tails = []
    for points in ["uniform", "path"]:
        rows, warm = [], query == "distance" and points == "path"
        for model in models:
            count, reports, wrong = compare(bench, model, query, points)
            one, batch = ({who: median(runs, name) for who, runs in reports.items()}
                          for name in ["mean", "batch"])
            rivals = ["embree"] + (["embree warm"] if warm else []) + ["cgal"]
            rows.append([model.name, f"{model.faces:,}"] + [us(one[who])
                                                            for who in ["ebpo"] + rivals]
                        + [ratio(one["ebpo"], one[who])
                           for who in rivals] + [us(batch["ebpo"]), us(batch["embree"])]
                        + [ratio(batch["ebpo"], batch["embree"])] + [figure(wrong[p])
                                                                     for p in PEERS])
            tails += tail_rows(model, points, reports)
        page.text(f"{points.capitalize()} points, {count:,} for "
                  f"each model, us for one: each call by the clock, then "
                  "all together without.")
        names = ["Embree"] + (["Embree, warm"] if warm else []) + ["CGAL"]
        page.table(["model", "faces", "ours"] + names + [f"ours / {name}" for name in names]
                   + ["ours, batch", "Embree, loop", "batch / loop", "Embree differs",
                      "CGAL differs"], rows)
    page.text("How long single calls take, us; the clock's own cost is taken off.")
    page.table(["model", "points", "program", "p50", "p99", "p99.9", "max"], tails)


def tail_rows(model, points, reports):
    rows = []
    for who, runs in reports.items():
        if any(r is not None for r in runs):
            rows.append([model.name, points,
                         "ours" if who == "ebpo"
                         else who] + [us(median(runs, n)) for n in ["p50", "p99", "p999", "max"]])
    return rows


def compare_rays(bench, model, query, points):
    """Means of single calls, ours all together, and how many answers of the peers differ."""
    raw = bench.work / f"{model.name}.{points}.rays.raw"
    peers = PEERS if (query, points) == ("ray", "uniform") else ["embree"]
    answers = {who: bench.work / f"answers.{who}" for who in ["ebpo"] + peers}
    reports = {who: [] for who in answers}
    end = ["--tmax", 1] if points == "segments" else []
    for _ in range(bench.rounds(model)):
        reports["ebpo"].append(bench.ours(model, query, "--count", bench.options.count,
                                          "--save-points", raw, "--save-answers", answers["ebpo"],
                                          points=points))
        for peer in peers:
            reports[peer].append(bench.peer(peer, model, query, raw, "--answers", answers[peer],
                                            *end))
    wrong = {p: None if None in reports[p]
             else differences(query, answers["ebpo"], answers[p], 1e-6 * model.diagonal,
                              lengths_of(raw)) for p in peers}
    return reports, wrong


def section_rays(bench, page, models):
    page.text("## Rays", "",
              "*uniform*: from points in the box, directions uniform. *camera*: one eye, through "
              "the pixels of a picture. *segments*: uniform, a twentieth of the diagonal long. "
              "*degenerate*: in turns to a vertex, to the middle of an edge, from a vertex, along "
              "an axis through a vertex. Embree: robust scene of high quality, in single "
              "precision; all hits by a filter function, sorted and each face once, as ours. "
              "*differs*: the first hit by more than a millionth of the box's diagonal, only one "
              "hits, or another number of hits. Ours are exact: a ray through a vertex meets all "
              "faces around it, which single precision seldom says of degenerate rays. us for "
              "one: each call by the clock, then all together without.")
    rows = []
    for points in RAYS:
        for query, question in QUESTIONS.items():
            for model in models:
                if not re.search(bench.options.rows, f"{model.name} {points} {question}"):
                    continue
                reports, wrong = compare_rays(bench, model, query, points)
                one, batch = ({who: median(runs, name) for who, runs in reports.items()}
                              for name in ["mean", "batch"])
                rows.append([model.name, f"{model.faces:,}", points, question]
                            + [us(one.get(who)) for who in ["ebpo"] + PEERS]
                            + [ratio(one["ebpo"], one.get(p)) for p in PEERS]
                            + [us(batch["ebpo"]), us(batch["embree"]),
                               ratio(batch["ebpo"], batch["embree"])]
                            + [figure(wrong.get(p)) for p in PEERS])
    page.table(["model", "faces", "rays", "question", "ours", "Embree", "CGAL", "ours / Embree",
                "ours / CGAL", "ours, batch", "Embree, loop", "batch / loop", "Embree differs",
                "CGAL differs"], rows)


def section_opening(bench, page, models):
    page.text("## Opening", "",
              "From a cold file to the first answer: the system is asked to forget the file "
              "(posix_fadvise) before each run. Peers load "
              "the PLY and build their tree. Ours either decodes everything first (on one core "
              "here), or keeps the levels down to the cut level and loads what the answer needs. "
              "Seconds; peak memory in MB.")
    rows = []
    for query in ["inside", "distance"]:
        for model in sorted(models, key=lambda m: m.faces):
            raw = bench.work / f"{model.name}.{query}.opening.raw"
            runs = {who: [] for who in ["ebpo", "cut"] + PEERS}
            for _ in range(bench.rounds(model)):
                runs["ebpo"].append(bench.ours(model, query, "--count", 100, "--save-points", raw))
                runs["cut"].append(bench.ours(model, query, "--count", 1, "--cut-level", CUT))
                for peer in PEERS:
                    runs[peer].append(bench.peer(peer, model, query, raw, "--cold", "--count", 1))
            first = {who: median(runs[who], "first") for who in runs}
            peak = [median(runs["ebpo"], "peak") / 2**20] + [median(runs[p], "peak") for p in PEERS]
            rows.append([model.name, f"{model.faces:,}", query,
                         figure(model.ply.stat().st_size / 2**20),
                         figure(model.file.stat().st_size / 2**20),
                         figure(median(runs["ebpo"], "read") / 2**20),
                         figure(median(runs["cut"],
                                       "read") / 2**20)] + [figure(first[who]) for who in runs]
                        + [ratio(first[ours], first[p]) for ours in ["ebpo", "cut"]
                           for p in PEERS] + [" / ".join(figure(p) for p in peak)])
    page.table(["model", "faces", "question", "PLY MB", "file MB", "MB read, all",
                f"MB read, cut level {CUT}", "ours, all in memory", f"ours, cut level {CUT}",
                "Embree", "CGAL",
                "all / Embree", "all / CGAL", "cut / Embree", "cut / CGAL",
                "peak MB: all / Embree / CGAL"], rows)


def small_budget(bench, model):
    """A tenth of what the model takes in memory, or the least that the program takes where that is
    more; and the percentage."""
    whole = at(bench.ours(model, "inside", "--count", 100), "memory")
    budget = whole // 10
    try:
        bench.ours(model, "inside", "--count", 100, "--memory", budget)
    except RuntimeError as error:
        least = re.search(r"give at least (\d+)", str(error))
        if not least:
            raise
        budget = int(least[1])
    return budget, f"{budget / 2**20:,.1f} MB, {100 * budget / whole:.0f} % of the decoded size"


def middling(models):
    """The largest one that opens in a moment: the tables of modes open it a hundred times."""
    return max(models, key=lambda m: m.faces if m.faces < 1000000 else 1 / m.faces)


def both_points(bench, model, query, count, *arguments):
    """Medians for uniform points and a path."""
    reports = {points: [bench.ours(model, query, "--count", count, *arguments, points=points)
                        for _ in range(bench.rounds(model))]
               for points in ["uniform", "path"]}
    return reports


def deepest(model, most):
    return min(len(model.info["levels"]) - 1, most)


def section_modes(bench, page, models):
    model = middling(models)
    (budget, words), count = small_budget(bench, model), max(1, bench.options.count // 100)
    page.text("## Modes of the EBP thesis", "",
              f"Point in solid, {model.name} ({model.faces:,} faces), {count:,} points, us; with "
              f"a budget "
              f"of {words}. Beside EBP 2017, table 25: means of three models of 26 to 28 million "
              f"faces, on another machine. "
              "*plain*: without envelopes.")
    rows = []
    for mode, thesis in EBP_MODES.items():
        runs = both_points(bench, model, "inside", count, "--mode", mode, "--memory", budget)
        rows.append([f"`{mode}`"] + [us(median(runs[p], "mean")) for p in runs]
                    + [figure(median(runs[p], "loads"))
                       for p in runs] + [figure(t) for t in thesis])
    page.table(["mode", "uniform", "path", "subtrees loaded, uniform", "path", "EBP, random",
                "EBP, path"], rows)
    page.text("The same down to a level (`--level`), uniform / path, beside EBP 2017, table 26.")
    rows = []
    for level in range(1, deepest(model, len(EBP_LEVELS)) + 1):
        cells = []
        for i, mode in enumerate(["cache", "nodes", "subtree"]):
            runs = both_points(bench, model, "inside", count, "--mode", mode, "--level", level,
                               "--memory", budget)
            cells += [" / ".join(us(median(runs[p], "mean"))
                                 for p in runs), " / ".join(map(figure,
                                                                EBP_LEVELS[level - 1][2 * i:2 * i + 2]))]
        rows.append([level] + cells)
    page.table(["level", "`cache`", "EBP", "`nodes`", "EBP", "`subtree`", "EBP"], rows)


def section_distance_modes(bench, page, models):
    model = middling(models)
    (budget, words), count = small_budget(bench, model), max(1, bench.options.count // 200)
    page.text("## Distance modes of the EBP thesis", "",
              f"{model.name}, {count:,} points, us; *exact* gives the minimum, the others do not "
              f"promise it. Everything in memory, and with a budget of {words}. Beside EBP 2017, "
              f"table 28.")
    kinds = [(f"`{mode}`", ["--mode", mode], EBP_DISTANCE.get(mode, ("-", "-")))
             for mode in ["exact", "recursive", "leaves"]]
    kinds += [(f"`envelope`, level {n}", ["--mode", "envelope", "--level", n],
               EBP_DISTANCE_LEVELS[n - 1])
              for n in range(1, deepest(model, len(EBP_DISTANCE_LEVELS)) + 1)]
    rows = []
    for name, arguments, thesis in kinds:
        every = both_points(bench, model, "distance", count, *arguments)
        tenth = both_points(bench, model, "distance", count, *arguments, "--memory", budget)
        rows.append([name] + [us(median(runs[p], "mean")) for runs in (every, tenth)
                              for p in runs] + [figure(t) for t in thesis])
    page.table(["mode", "uniform", "path", "budget, uniform", "budget, path", "EBP, random",
                "EBP, path"], rows)


def section_out_of_core(bench, page, models):
    page.text("## Out of core", "",
              "A continuous path along the surface with a budget of 10 % of the decoded size (or "
              "the least that is possible, "
              f"where that is more), us; the thesis' mean is {EBP_PATH_MEAN} us (EBP 2017, table "
              f"25: subtree cache, envelopes). With prefetching "
              "all cores may be used.")
    rows = []
    for model in sorted(models, key=lambda m: m.faces):
        budget, words = small_budget(bench, model)
        for query in ["inside", "distance"]:
            count = max(1, bench.options.count // SHARE.get((query, "path"), 1))
            for prefetch in [[], ["--prefetch"]]:
                runs = [bench.ours(model, query, "--count", count, "--memory", budget, *prefetch,
                                   points="path", pinned=not prefetch)
                        for _ in range(bench.rounds(model))]
                rows.append([model.name, f"{model.faces:,}", query, "yes" if prefetch else "no",
                             words.split(" of the")[0]]
                            + [us(median(runs, n)) for n in ["mean", "p50", "p99", "p999", "max"]]
                            + [figure(median(runs, "loads")),
                               figure(median(runs, "memory_peak") / 2**20),
                               ratio(median(runs, "mean") / 1000, EBP_PATH_MEAN)])
    page.table(["model", "faces", "question", "prefetch", "budget", "mean", "p50", "p99", "p99.9",
                "max", "subtrees loaded", "peak MB",
                "mean / thesis"], rows)


def section_leaves(bench, page, models):
    page.text("## Leaves by kind", "",
              "Percent of the leaves. All kinds but *general* answer by the signs of planes; a "
              "general leaf with "
              "a wall that no face meets by one segment. *Gain*: uniform points that fall into "
              "leaves of the kind, ns for one, as the same leaves "
              "taken as general ones and by the planes (`tests/bench/bench_leaves MODEL.ebpo.h5`).")
    rows, gains = [], []
    for model in models:
        *kinds, last = json.loads(bench.run(bench.build / "tests" / "bench" / "bench_leaves",
                                            model.file, "--json"))
        leaves = sum(kind["leaves"] for kind in kinds)
        rows.append([model.name, f"{model.faces:,}", f"{leaves:,}"]
                    + [figure(100 * n / max(1, leaves))
                       for n in [kind["leaves"] for kind in kinds] + [last["one_wall"]]])
        for kind in kinds[1:]:
            if kind["points"]:
                gains.append([model.name, kind["kind"], f"{kind['points']:,}",
                              figure(kind["ns_as_general"]), figure(kind["ns"]),
                              figure(kind["ns_as_general"] / kind["ns"])])
    page.table(["model", "faces", "leaves", "general", "one plane", "two planes", "convex set",
                "concave set", "general, one wall free"], rows)
    page.table(["model", "kind", "points of 2,000,000", "as general, ns", "by planes, ns", "gain"],
               gains)


# ---- the page ----

def processor():
    for line in open("/proc/cpuinfo"):
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return "unknown processor"


def command_line(options):
    words = ["tests/bench/query.py", "BUILD_DIR"] + [pathlib.Path(m).name for m in options.models]
    words += ["--count", str(options.count), "--rounds", str(options.rounds)]
    if options.sections != ",".join(SECTIONS):
        words += ["--sections", options.sections] + (["--update"] if options.update else [])
    if options.rows:
        words += ["--rows", options.rows]
    if options.faces_from_generator:
        words += ["--faces-from-generator", str(options.faces_from_generator)]
        words += ["--base", pathlib.Path(options.base).name] if options.base else []
    return shlex.join(words + ["-o", "docs/measured/queries.md"])


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", metavar="BUILD_DIR")
    parser.add_argument("models", metavar="MODEL.ply", nargs="+")
    parser.add_argument("--count", type=int, default=1000000,
                        help="points for each question (distance: a tenth, paths of it a half; "
                             "default 1,000,000)")
    parser.add_argument("--faces-from-generator", type=int, metavar="M",
                        help="also a generated model of at least M faces")
    parser.add_argument("--base", metavar="BASE.ply",
                        help="what the generated model begins with (default: a sphere)")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--core", type=int, default=os.cpu_count() - 1,
                        help="the core on which everything runs")
    parser.add_argument("--work",
                        help="where converted models and points are kept (default "
                             "BUILD_DIR/bench-query)")
    parser.add_argument("--sections", default=",".join(SECTIONS),
                        help="comma list of " + ", ".join(SECTIONS))
    parser.add_argument("--rows", default="", metavar="REGEX",
                        help="of the rays' table only the rows whose 'model rays question' matches, "
                             "such as 'bunny.* camera any hit'")
    parser.add_argument("--update", action="store_true",
                        help="replace only these sections of an existing OUTPUT")
    parser.add_argument("-v", "--verbose", action="store_true", help="print the commands")
    parser.add_argument("-o", "--output", required=True)
    return parser.parse_args()


def sections(bench, page, models, wanted):
    if "inside" in wanted:
        section_query(bench, page, models, "inside", "Point in solid",
                      "Ours is exact in double; Embree counts the hits of a ray in single "
                      "precision (robust scene); CGAL's "
                      "`Side_of_triangle_mesh` is exact. *differs*: answers that are not ours, of "
                      "the points that are not on the surface.")
    if "distance" in wanted:
        section_query(bench, page, models, "distance", "Nearest point",
                      "Ours is exact, signed, in double; Embree's point query is in single "
                      "precision. *warm*: the search starts from the "
                      "last answer, as ours does. *differs*: by more than a millionth of the "
                      "box's diagonal.")
    for name, section in [("ray", section_rays), ("opening", section_opening), ("modes", section_modes),
                          ("distance-modes", section_distance_modes),
                          ("out-of-core", section_out_of_core), ("leaves", section_leaves)]:
        if name in wanted:
            section(bench, page, models)


def main():
    options = parse()
    wanted = options.sections.split(",")
    unknown = set(wanted) - set(SECTIONS)
    if unknown:
        sys.exit(f"query.py: no section is called {', '.join(sorted(unknown))}; there are "
                 f"{', '.join(SECTIONS)}")
    bench, page = Bench(options), Page()
    plies = list(options.models) + ([generated(bench)] if options.faces_from_generator else [])
    models = [Model(bench, ply) for ply in plies]
    for section in SECTIONS: # the page is whole after each
        if section in wanted:
            sections(bench, page, models, [section])
            write(options, bench, page)


def write(options, bench, page):
    head = Page()
    head.text("# Queries", "",
              f"Made by `{command_line(options)}`; nothing here was typed in but the theses' "
              f"figures, which the script names. {processor()}, "
              f"one thread on one core, medians of {options.rounds} runs (a third of that above a "
              f"million faces) in which the programs take turns; load average of the machine "
              f"meanwhile "
              f"{statistics.median(bench.load):.1f} (median), {max(bench.load):.1f} (most). "
              f"Compare within a row.")
    text = "\n".join(head.lines + page.lines).rstrip("\n") + "\n"
    out = pathlib.Path(options.output)
    out.write_text(updated(out.read_text(), text) if options.update and out.exists() else text)


def updated(old, new):
    """The old page with the new one's sections in their places, each with the new one's head."""
    head, *made = new.split("\n## ")
    note = head.split("\n\n", 1)[1].strip()
    fresh = {section.split("\n", 1)[0]: section for section in made}
    first, *sections = old.split("\n## ")
    kept = []
    for section in sections:
        title = section.split("\n", 1)[0]
        if title in fresh:
            name, body = fresh.pop(title).split("\n", 1)
            section = f"{name}\n\n*{note.replace('*', '')}*\n{body.rstrip()}\n"
        kept.append(section.rstrip("\n") + "\n")
    return "\n## ".join([first] + kept + list(fresh.values()))


if __name__ == "__main__":
    main()
