#!/usr/bin/env python3
"""Remakes docs/measured/queries.md: questions to real models, beside Embree, CGAL and the figures
of the two theses, and what became of the goals.

    tests/bench/query.py BUILD_DIR MODEL.ply... [--grow BASE.ply:FACES]... [--count N]
    -o docs/measured/queries.md

BUILD_DIR: a release build configured with -Dpeers=enabled (tools/install-deps.sh --bench installs
what that needs). Each model is converted once (kept in --work, as are the questions); the programs
hold a model while they are asked in turns, one thread each, on one core; figures are medians of
--rounds turns (half of that above two million faces) of processor time. Another core meanwhile
judges answers by rational arithmetic and counts cache misses (valgrind). Questions under a budget
are asked of the largest model, after that.
"""
import argparse
import concurrent.futures
import os
import pathlib
import shlex
import statistics
import sys

from query_goals import goals_table
from query_page import Page, figure, quotient, ratio, us
from query_programs import Bench, Model, NAMES, Server, differences, grown, lengths_of, middle
import query_checks
import query_thesis

SECTIONS = ["rays", "distance", "inside", "memory", "budget", "modes", "distance-modes", "opening",
            "leaves", "answers", "misses"]
RAYS = ["uniform", "camera", "segments", "degenerate"]
QUESTIONS = {"ray": "first hit", "ray-any": "any hit", "ray-all": "all hits"}
CUT = 4 # level, of the second way of opening
SHARE = {("distance", "uniform"): 20} # of --count
BUDGET = 256 << 20
TAILS = [("ray", "uniform"), ("distance", "uniform"), ("distance", "path"), ("inside", "uniform"),
         ("inside", "path")]


# ---- asking in turns ----

def cells_of(model, query):
    """(points, query) in which a structure is asked."""
    if query == "rays":
        return [(points, q) for points in RAYS for q in QUESTIONS]
    return [(points, query) for points in ("uniform", "path")]


def ways_of(peer, points, query):
    """How a program is asked: a word for the page, and its options."""
    if peer == "cgal":
        return {"cgal": []} if query != "ray" or points == "uniform" else {}
    if query in ("ray-any", "ray-all") and peer == "cgal":
        return {}
    warm = ["--warm"] if query == "distance" else []
    if peer == "embree":
        return {"embree": [], **({"embree warm": warm} if warm and points == "path" else {})}
    ways = {"ebpo": warm, "base": warm + ["--base"], "batch": warm + ["--batch"]}
    if warm and points == "path":
        ways |= {"cold": [], "unsigned": ["--warm", "--unsigned"]}
    return ways


def in_turns(ways):
    """After each way of ours another program, so that none finds what it needs in the processor's
    caches because it was just asked the same."""
    others = [w for w in ways if w[0] != "ebpo"]
    turns = []
    for i, ours in enumerate(w for w in ways if w[0] == "ebpo"):
        turns += [ours, others[i % len(others)]]
    return turns + others[len(turns) // 2:]


def ask_cell(bench, model, servers, points, query):
    """Reports of all programs and ways on the same questions, in turns; answers that differ."""
    rays = query.startswith("ray")
    count = max(1, bench.options.count // SHARE.get((query, points), 1))
    raw = model.questions(points, count, rays)
    end = ["--tmax", 1] if points == "segments" else []
    told = {p: bench.work / f"answers.{p}" for p in servers}
    ways = {(p, way): words for p in servers for way, words in ways_of(p, points, query).items()
            if p != "cgal" or query in ("ray", "inside", "distance")}
    reports = {way: [] for _, way in ways}
    for turn in range(bench.rounds(model) + 1):
        for peer, way in in_turns(ways):
            words = ways[peer, way]
            save = ["--answers", told[peer]] if turn == 0 and way == peer else []
            report = servers[peer].ask(query, raw, *words, *end, *save)
            if turn > 0: # the first turn warms
                reports[way].append(report)
    wrong = {p: differences(query, told["ebpo"], told[p], 1e-6 * model.diagonal,
                            lengths_of(raw) if rays else None)
             for p in servers if p != "ebpo" and reports.get(p) and None not in reports[p]}
    tails = {}
    if (query, points) in TAILS:
        tails = {way: servers[peer].ask(query, raw, *words, "--clocked")
                 for (peer, way), words in ways.items() if way in ("ebpo", "embree", "cgal")}
    return {"ns": {way: middle(runs) for way, runs in reports.items()}, "wrong": wrong,
            "tails": tails, "count": count}


def ask_model(bench, model, wanted):
    """{(points, query): what ask_cell returns}, structure by structure: a peer has a tree for
    each."""
    results = {}
    for structure in wanted:
        servers = {}
        try:
            for peer in bench.peers(model):
                servers[peer] = Server(bench, peer, model, *building(peer, model)).__enter__()
            for points, query in cells_of(model, structure):
                results[points, query] = ask_cell(bench, model, servers, points, query)
        finally:
            for server in servers.values():
                server.__exit__()
    return results


def building(peer, model):
    """Large models are made on all cores where that is not what is measured."""
    return ["--threads", 0] if peer != "cgal" and model.faces > 2000000 else []


# ---- tables of times ----

def section_rays(page, results):
    page.text("## Rays", "",
              "*uniform*: from points in the box, directions uniform. *camera*: one eye, through "
              "the pixels of a picture. *segments*: uniform, a twentieth of the diagonal long. "
              "*degenerate*: in turns to a vertex, to the middle of an edge, from a vertex, along "
              "an axis through a vertex. Embree: robust scene of high quality, in single "
              "precision; all hits by a filter function, sorted and each face once, as ours. "
              "*base*: our kernels for any x86-64 (SSE2). *batch*: all in one call, one thread. "
              "*differs*: the first hit by more than a millionth of the box's diagonal, only one "
              "hits, or another number of hits. Ours are exact: a ray through a vertex meets all "
              "faces around it, which single precision seldom says of degenerate rays. us a ray.")
    rows = []
    for model, cells in results.items():
        for points in RAYS:
            for query, question in QUESTIONS.items():
                cell = cells.get((points, query))
                if cell:
                    rows.append([model.name, f"{model.faces:,}", points, question] + times(
                        cell, ["ebpo", "base", "batch", "embree", "cgal"],
                        [("ebpo", "embree"), ("base", "embree"), ("batch", "embree"),
                         ("ebpo", "cgal")]))
    page.table(["model", "faces", "rays", "question", "ours", "ours, base", "ours, batch", "Embree",
                "CGAL", "ours / Embree", "base / Embree", "batch / Embree", "ours / CGAL",
                "Embree differs", "CGAL differs"], rows)


def times(cell, ways, ratios):
    ns = cell["ns"]
    return ([us(ns.get(w)) for w in ways] + [ratio(ns.get(a), ns.get(b)) for a, b in ratios]
            + [figure(cell["wrong"].get(p)) for p in ("embree", "cgal")])


def section_points(page, results, query, title, note):
    page.text(f"## {title}", "", note)
    distance = query == "distance"
    ways = ["ebpo", "base", "batch"] + (["cold", "unsigned"] if distance else []) + ["embree"]
    ways += (["embree warm"] if distance else []) + ["cgal"]
    ratios = [("ebpo", "embree"), ("base", "embree"), ("batch", "embree")]
    ratios += ([("ebpo", "embree warm")] if distance else []) + [("ebpo", "cgal")]
    names = {"ebpo": "ours", "base": "ours, base", "batch": "ours, batch", "cold": "ours, not warm",
             "unsigned": "ours, no sign", "embree": "Embree", "embree warm": "Embree, warm",
             "cgal": "CGAL"}
    rows = [[model.name, f"{model.faces:,}", points] + times(cells[points, query], ways, ratios)
            for points in ("uniform", "path") for model, cells in results.items()
            if (points, query) in cells]
    page.table(["model", "faces", "points"] + [names[w] for w in ways]
               + [f"{names[a].replace('ours, ', '')} / {names[b]}" for a, b in ratios]
               + ["Embree differs", "CGAL differs"], rows)


def section_tails(page, results):
    page.text("How long single questions take, us by the clock, its own cost taken off.")
    page.table(["model", "question", "points", "program", "p50", "p99", "p99.9", "max"],
               [[model.name, query, points, NAMES[way]]
                + [us(report[n]) for n in ("p50_ns", "p99_ns", "p999_ns", "max_ns")]
                for query, points in TAILS for model, cells in results.items()
                for way, report in cells.get((points, query), {"tails": {}})["tails"].items()
                if report])


# ---- memory and loading ----

def measure_memory(bench, model):
    """Processor seconds on one thread, and wall seconds on all cores, of loading everything and of
    Embree's build, in turns; bytes."""
    reports = {(p, t): [] for p in ("ebpo", "embree") for t in (1, 0)}
    for _ in range(bench.rounds(model)):
        for (peer, threads), runs in reports.items():
            source = model.file if peer == "ebpo" else model.ply
            runs.append(query_checks.loads(bench.run(
                bench.program(peer), source, "build", "--threads", threads,
                core=None if threads else False)))
    kinds = query_checks.loads(bench.run(bench.build / "tests" / "bench" / "memory_kinds",
                                         model.file))
    return {"ours": middle(reports["ebpo", 1], "load_cpu_s"),
            "embree": middle(reports["embree", 1], "build_cpu_s"),
            "ours all": middle(reports["ebpo", 0], "load_s"),
            "embree all": middle(reports["embree", 0], "build_s"),
            "bytes": reports["ebpo", 1][0]["bytes"] / model.faces,
            "embree bytes": reports["embree", 1][0]["bytes"] / model.faces,
            "mesh": 12 * (1 + model.info["vertices"] / model.faces), "kinds": kinds}


def section_memory(page, memory):
    page.text("## Memory and loading", "",
              "Everything in memory. *Loading*: from the file, in the system's memory, to the "
              "first question; Embree: only the build of a robust scene, from a mesh that is in "
              "memory. Processor seconds on one thread, wall seconds on all cores. Embree's mesh "
              "(single precision) counts as its memory, too: point queries need it.")
    page.table(["model", "faces", "ours, B a face", "Embree's tree", "with its mesh", "ours / Embree",
                "ours, CPU s", "Embree, CPU s", "ours / Embree", "ours, all cores, s",
                "Embree, all cores, s", "ours / Embree"],
               [[model.name, f"{model.faces:,}", figure(m["bytes"]), figure(m["embree bytes"]),
                 figure(m["embree bytes"] + m["mesh"]),
                 ratio(m["bytes"], m["embree bytes"] + m["mesh"]), figure(m["ours"]),
                 figure(m["embree"]), ratio(m["ours"], m["embree"]), figure(m["ours all"]),
                 figure(m["embree all"]), ratio(m["ours all"], m["embree all"])]
                for model, m in memory.items()])
    names = list(dict.fromkeys(k for m in memory.values() for k in m["kinds"]))
    page.text("Ours by kind, B a face (`tests/bench/memory_kinds FILE`, before any question).")
    page.table(["model"] + names, [[model.name] + [figure(m["kinds"].get(n, 0) / model.faces)
                                                   for n in names]
                                   for model, m in memory.items()])


# ---- under a budget ----

def measure_budget(bench, model):
    """Each on a model that has just been opened; the file is in the system's memory."""
    rows = []
    with open(model.file, "rb") as f: # so that it is
        while f.read(1 << 24):
            pass
    for query, points, count in [("distance", "uniform", bench.options.count // 50),
                                 ("distance", "path", bench.options.count),
                                 ("inside", "uniform", bench.options.count),
                                 ("inside", "path", bench.options.count)]:
        raw = model.questions(points, max(1, count))
        with Server(bench, "ebpo", model, "--memory", BUDGET, "--threads", 0, core=False) as s:
            rows.append((query, points, s.ask(query, raw, "--clocked",
                                              *(["--warm"] if query == "distance" else []))))
    return rows


def section_budget(page, model, rows):
    page.text("## Under a budget", "",
              f"{model.name}, {model.faces:,} faces, {BUDGET >> 20} MiB, each on a model that has "
              "just been opened: nothing but its upper levels is in memory, the file is in the "
              "system's. *touched*: subtrees a question has looked into, found in memory or "
              "loaded. us by the clock; what works beside the questions may use all cores.")
    page.table(["question", "points", "questions", "touched", "loaded", "KiB read", "mean", "p50",
                "p99", "p99.9", "max", "peak MiB"],
               [[query, points, f"{r['count']:,}", figure((r["hits"] + r["loads"]) / r["count"]),
                 figure(r["loads"] / r["count"]), figure(r["bytes_read"] / r["count"] / 1024)]
                + [us(r[n]) for n in ("clocked_mean_ns", "p50_ns", "p99_ns", "p999_ns", "max_ns")]
                + [figure(r["memory_peak"] / 2**20)] for query, points, r in rows if r])


# ---- opening, leaves ----

def section_opening(bench, page, models):
    page.text("## Opening", "",
              "From a cold file to the first answer: the system is asked to forget the file "
              "(posix_fadvise) before each run. Peers load "
              "the PLY and build their tree. Ours either decodes everything first (on one core "
              "here), or keeps the levels down to the cut level and loads what the answer needs. "
              "Seconds; peak memory in MB.")
    rows = []
    for query in ["inside", "distance"]:
        for model in models:
            raw = model.questions("uniform", 100)
            runs = {who: [] for who in ["ebpo", "cut"] + bench.peers(model)[1:]}
            for _ in range(bench.rounds(model)):
                runs["ebpo"].append(bench.ours(model, query, "--count", 100))
                runs["cut"].append(bench.ours(model, query, "--count", 1, "--cut-level", CUT))
                for peer in bench.peers(model)[1:]:
                    runs[peer].append(query_checks.loads(bench.run(
                        bench.program(peer), model.ply, query, raw, "--cold", "--count", 1)))
            first = {who: middle(r, "cold_first_answer_seconds" if who in ("ebpo", "cut")
                                 else "first_answer_s") for who, r in runs.items()}
            rows.append([model.name, f"{model.faces:,}", query]
                        + [figure(size / 2**20) for size in
                           (model.ply.stat().st_size, model.file.stat().st_size,
                            middle(runs["ebpo"], "cold_bytes_read"),
                            middle(runs["cut"], "cold_bytes_read"))]
                        + [figure(first.get(who)) for who in ("ebpo", "cut", "embree", "cgal")]
                        + [ratio(first[who], first.get("embree")) for who in ("ebpo", "cut")]
                        + [" / ".join(map(figure, [middle(runs["ebpo"], "peak_memory_bytes") / 2**20,
                                                   middle(runs["embree"], "peak_mb")]))])
    page.table(["model", "faces", "question", "PLY MB", "file MB", "MB read, all",
                f"MB read, cut level {CUT}", "ours, all in memory", f"ours, cut level {CUT}",
                "Embree", "CGAL", "all / Embree", "cut / Embree", "peak MB: all / Embree"], rows)


def section_leaves(bench, page, models):
    page.text("## Leaves by kind", "",
              "Percent of the leaves. All kinds but *general* answer by the signs of planes; a "
              "general leaf with "
              "a wall that no face meets by one segment. *Gain*: uniform points that fall into "
              "leaves of the kind, ns for one, as the same leaves "
              "taken as general ones and by the planes (`tests/bench/bench_leaves MODEL.ebpo.h5`).")
    rows, gains = [], []
    for model in models:
        *kinds, last = query_checks.loads(bench.run(
            bench.build / "tests" / "bench" / "bench_leaves", model.file, "--json"))
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
    for what in options.grow:
        words += ["--grow", pathlib.Path(what).name]
    words += ["--count", str(options.count), "--rounds", str(options.rounds)]
    if options.sections != ",".join(SECTIONS):
        words += ["--sections", options.sections]
    return shlex.join(words + ["-o", "docs/measured/queries.md"])


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", metavar="BUILD_DIR")
    parser.add_argument("models", metavar="MODEL.ply", nargs="+")
    parser.add_argument("--grow", metavar="BASE.ply:FACES", action="append", default=[],
                        help="also a model of at least so many faces: BASE, its faces cut into four")
    parser.add_argument("--count", type=int, default=100000,
                        help="questions of each kind (distance far from the surface: a twentieth; "
                             "default 100,000)")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--core", type=int, default=os.cpu_count() - 1,
                        help="the core on which is measured")
    parser.add_argument("--side-core", type=int, default=0,
                        help="the core on which answers are judged and misses counted meanwhile")
    parser.add_argument("--judged", type=int, default=2000,
                        help="answers to each question that are judged by rational arithmetic")
    parser.add_argument("--work",
                        help="where models and questions are kept (default BUILD_DIR/bench-query)")
    parser.add_argument("--sections", default=",".join(SECTIONS),
                        help="comma list of " + ", ".join(SECTIONS))
    parser.add_argument("-v", "--verbose", action="store_true", help="print the commands")
    parser.add_argument("-o", "--output", required=True)
    return parser.parse_args()


class Made:
    """What has been measured so far; the page is whole after each step."""

    def __init__(self, bench):
        self.bench = bench
        self.results, self.memory, self.tables = {}, {}, {}
        self.budget, self.more = [], Page()
        self.found = {"answers": None, "misses": None}

    def publish(self, largest):
        page, wanted = Page(), self.bench.options.sections.split(",")
        if "rays" in wanted:
            section_rays(page, self.results)
        for query in ("distance", "inside"):
            if query in wanted:
                section_points(page, self.results, query, *POINTS[query])
        section_tails(page, self.results)
        if self.memory:
            section_memory(page, self.memory)
        if self.budget:
            section_budget(page, largest, self.budget)
        query_thesis.write(page, largest, self.tables)
        page.lines += self.more.lines
        query_checks.write(page, self.found)
        write(self.bench.options, self.bench, page,
              goals_table(self.results, self.memory, self.budget, self.tables, self.found))


POINTS = {
    "distance": ("Nearest point",
                 "Ours is exact, signed (*no sign*: unsigned), in double, and begins with the last "
                 "answer; Embree's point query is in single precision; *warm*: it searches no "
                 "farther than the last answer allows. fcpw could not be had here. *differs*: by "
                 "more than a millionth of the box's diagonal. us a point."),
    "inside": ("Point in solid",
               "Ours is exact in double; Embree counts the hits of a ray in single precision "
               "(robust scene); CGAL's `Side_of_triangle_mesh` is exact. *differs*: answers that "
               "are not ours, of the points that are not on the surface. us a point."),
}


def beside(bench, small, middling, wanted, found):
    """What the clock does not matter for."""
    if "answers" in wanted:
        found["answers"] = query_checks.judge_answers(bench, small)
    if "misses" in wanted:
        found["misses"] = query_checks.count_misses(bench, [small, middling])


def ask_models(bench, models, made, wanted):
    """In turns on one core, while another one is at what needs no clock."""
    below = [m for m in models if m.faces < 2000000]
    structures = [s for s in ("rays", "distance", "inside") if s in wanted]
    with concurrent.futures.ThreadPoolExecutor(1) as side:
        done = side.submit(beside, bench, models[0], below[-1], wanted, made.found)
        for model in models:
            made.results[model] = ask_model(bench, model, structures)
            made.publish(models[-1])
        if "opening" in wanted:
            section_opening(bench, made.more, below)
        if "leaves" in wanted:
            section_leaves(bench, made.more, below)
        done.result()


def main():
    options = parse()
    wanted = options.sections.split(",")
    unknown = set(wanted) - set(SECTIONS)
    if unknown:
        sys.exit(f"query.py: no section is called {', '.join(sorted(unknown))}; there are "
                 f"{', '.join(SECTIONS)}")
    bench = Bench(options)
    models = sorted((Model(bench, ply) for ply in
                     list(options.models) + [grown(bench, what) for what in options.grow]),
                    key=lambda m: m.faces)
    made = Made(bench)
    ask_models(bench, models, made, wanted)
    if "memory" in wanted:
        made.memory = {m: measure_memory(bench, m) for m in models}
        made.publish(models[-1])
    if "budget" in wanted:
        made.budget = measure_budget(bench, models[-1])
        made.publish(models[-1])
    made.tables = query_thesis.tables(bench, models[-1], wanted)
    made.publish(models[-1])


def write(options, bench, page, goals):
    head = Page()
    head.text("# Queries", "",
              f"Made by `{command_line(options)}`; nothing here was typed in but the theses' "
              f"figures and fcpw's shares, which the scripts name. {processor()}, "
              f"one thread on one core, medians of {options.rounds} turns (half of that above two "
              f"million faces), processor time where nothing else is said; load average of the "
              f"machine meanwhile {statistics.median(bench.load):.1f} (median), "
              f"{max(bench.load):.1f} (most). Compare within a row.")
    text = "\n".join(head.lines + goals.lines + page.lines).rstrip("\n") + "\n"
    pathlib.Path(options.output).write_text(text)


if __name__ == "__main__":
    main()
