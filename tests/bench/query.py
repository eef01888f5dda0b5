#!/usr/bin/env python3
"""Remakes docs/measured/queries.md: query times on real models, compared with Embree, CGAL and the results of the two
theses; and the goals.

    tests/bench/query.py BUILD_DIR MODEL.ply... [--grow BASE.ply:FACES]... [--count N]
    -o docs/measured/queries.md

BUILD_DIR: a release build configured with -Dpeers=enabled (tools/install-deps.sh --bench installs the required
packages). Each model is converted once; --work keeps models and queries. Each program keeps a model in memory. The
programs take turns, one thread each, on one core. The results are medians of the processor times of --rounds turns
(half as many above two million faces). Meanwhile another core judges results by rational arithmetic and counts cache
misses (valgrind). The largest model is then queried under a budget. The sections `leaves` (kinds of leaves) and
`misses` are not printed by default. The handwritten end of an existing page is kept.
"""
import argparse
import concurrent.futures
import os
import pathlib
import shlex
import statistics
import sys

from query_goals import goals_table, summary
from query_page import Page, figure, handwritten, ratio, reflow, us
from query_programs import Bench, Model, Server, differences, grown, lengths_of, middle
import query_checks

SECTIONS = ["rays", "packets", "distance", "inside", "memory", "budget", "opening",
            "results"]
MORE = ["leaves", "misses"]  # sections that are printed only if --sections names them
RAYS = ["uniform", "camera", "segments", "degenerate"]
RAY_QUERIES = {"ray": "first hit", "ray-any": "any hit", "ray-all": "all hits"}
CUT = 4 # the cut level, for the second method of opening
SHARE = {("distance", "uniform"): 20} # divisors of --count
BUDGET = 256 << 20
TAILS = [("ray", "uniform"), ("distance", "uniform"), ("distance", "path"), ("inside", "path")]


# ---- queries in turns ----

def cells_of(model, query):
    """Return the pairs (points, query) for a structure."""
    if query == "rays":
        return [(points, q) for points in RAYS for q in RAY_QUERIES]
    return [(points, query) for points in ("uniform", "path")]


def ways_of(peer, points, query):
    """Return the variants in which a program is queried: a word for the page, and options."""
    if peer == "cgal":
        return {"cgal": []} if query != "ray" or points == "uniform" else {}
    if query in ("ray-any", "ray-all") and peer == "cgal":
        return {}
    warm = ["--warm"] if query == "distance" else []
    if peer == "embree":
        return {"embree": [], **({"embree warm": warm} if warm and points == "path" else {})}
    ways = {"ebpo": warm, "base": warm + ["--base"], "batch": warm + ["--batch"]}
    if warm and points == "path":
        ways |= {"cold": []}
    return ways


def in_turns(ways):
    """Return the variants in an order with another program after each of ours.

    So no variant profits from processor caches that the same queries have just filled.
    """
    others = [w for w in ways if w[0] != "ebpo"]
    turns = []
    for i, ours in enumerate(w for w in ways if w[0] == "ebpo"):
        turns += [ours, others[i % len(others)]]
    return turns + others[len(turns) // 2:]


def query_cell(bench, model, servers, points, query):
    """Run the same queries with all programs and variants, in turns. Return reports, and counts of different results."""
    rays = query.startswith("ray")
    count = max(1, bench.options.count // SHARE.get((query, points), 1))
    raw = model.queries_of(points, count, rays)
    end = ["--tmax", 1] if points == "segments" else []
    saved = {p: bench.work / f"results.{p}" for p in servers}
    ways = {(p, way): words for p in servers for way, words in ways_of(p, points, query).items()
            if p != "cgal" or query in ("ray", "inside", "distance")}
    reports = {way: [] for _, way in ways}
    for turn in range(bench.rounds(model) + 1):
        for peer, way in in_turns(ways):
            words = ways[peer, way]
            save = ["--results", saved[peer]] if turn == 0 and way == peer else []
            report = servers[peer].run_query(query, raw, *words, *end, *save)
            if turn > 0: # the first turn only warms up
                reports[way].append(report)
    wrong = {p: differences(query, saved["ebpo"], saved[p], 1e-6 * model.diagonal,
                            lengths_of(raw) if rays else None)
             for p in servers if p != "ebpo" and reports.get(p) and None not in reports[p]}
    tails = {}
    if (query, points) in TAILS:
        tails = {way: servers[peer].run_query(query, raw, *words, "--clocked")
                 for (peer, way), words in ways.items() if way in ("ebpo", "embree", "cgal")}
    return {"ns": {way: middle(runs) for way, runs in reports.items()}, "wrong": wrong,
            "tails": tails, "count": count}


def query_equal(bench, model, server):
    """Query degenerate and uniform rays with equal numbers of crossings, in turns. Return their ratio for all hits."""
    files = model.equal_rays(bench.options.count)
    reports = {raw: [] for raw in files}
    for turn in range(bench.rounds(model) + 1):
        for raw, runs in reports.items():
            report = server.run_query("ray-all", raw)
            if turn > 0: # the first turn only warms up
                runs.append(report)
    uniform, degenerate = (middle(runs) for runs in reports.values())
    return degenerate / uniform


def query_one_model(bench, model, wanted):
    """Return {(points, query): result of query_cell}, structure by structure, because a peer has one tree for each."""
    results = {}
    for structure in wanted:
        servers = {}
        try:
            for peer in bench.peers(model):
                servers[peer] = Server(bench, peer, model, *building(peer, model)).__enter__()
            for points, query in cells_of(model, structure):
                results[points, query] = query_cell(bench, model, servers, points, query)
            if structure == "rays":
                results["equal", "ray-all"] = query_equal(bench, model, servers["ebpo"])
        finally:
            for server in servers.values():
                server.__exit__()
    return results


def building(peer, model):
    """Return the options for construction. Large models use all cores when construction is not measured."""
    return ["--threads", 0] if peer != "cgal" and model.faces > 2000000 else []


# ---- tables of times ----

def section_rays(page, results):
    page.text("## Rays", "",
              "*uniform*: from points in the box, in uniform directions. *camera*: from one eye "
              "through the pixels of a picture. *segments*: as uniform, with a length of 1/20 of the "
              "box diagonal. "
              "*degenerate*: to a vertex, to the middle of an edge, from a vertex, along an axis "
              "through a vertex. Embree: robust scene, high quality, single precision. *Embree "
              "differs, first*: first hits that differ by more than 1e-6 of the box diagonal or that "
              "only one program finds. *all*: rays with different numbers of hits; single "
              "precision rarely finds all faces around a vertex. *Equal crossings*: of each number of "
              "different t per ray, as many degenerate as uniform rays.")
    rows = []
    for model, cells in results.items():
        for points in RAYS:
            found = [cells[points, query] for query in ("ray", "ray-all")
                     if (points, query) in cells]
            if len(found) == 2:
                rows.append([model.name, points]
                            + [text for cell in found
                               for text in (us(cell["ns"].get("ebpo")),
                                            ratio(cell["ns"].get("ebpo"), cell["ns"].get("embree")))]
                            + [figure(cell["wrong"].get("embree")) for cell in found])
    page.table(["model", "rays", "first hit", "/ Embree", "all hits", "/ Embree",
                "Embree differs: first", "all"], rows)


def times(cell, ways, ratios):
    ns = cell["ns"]
    return ([us(ns.get(w)) for w in ways] + [ratio(ns.get(a), ns.get(b)) for a, b in ratios]
            + [figure(cell["wrong"].get("embree"))])


def section_points(page, results, query, title, note):
    page.text(f"## {title}", "", note)
    distance = query == "distance"
    ways = ["ebpo", "batch"] + (["cold"] if distance else []) + ["embree"]
    ways += (["embree warm"] if distance else []) + ["cgal"]
    ratios = [("ebpo", "embree")]
    names = {"ebpo": "ours", "batch": "ours, batch", "cold": "ours, not warm",
             "embree": "Embree", "embree warm": "Embree, warm", "cgal": "CGAL"}
    rows = [[model.name, points] + times(cells[points, query], ways, ratios)
            for points in ("uniform", "path") for model, cells in results.items()
            if (points, query) in cells]
    page.table(["model", "points"] + [names[w] for w in ways]
               + [f"{names[a]} / {names[b]}" for a, b in ratios] + ["Embree differs"], rows)


def section_tails(page, results):
    page.text("### Tails", "",
              "Wall-clock times of single queries, minus the cost of reading the clock.")
    models = list(results)
    page.table(["model", "query", "points", "p50", "p99", "p99.9", "max", "Embree p99.9"],
               [[model.name, query, points]
                + [us(tails["ebpo"][n]) for n in ("p50_ns", "p99_ns", "p999_ns", "max_ns")]
                + [us((tails.get("embree") or {}).get("p999_ns"))]
                for query, points in TAILS for model in dict.fromkeys(models[:1] + models[-1:])
                if (tails := results[model].get((points, query), {"tails": {}})["tails"]).get("ebpo")])


# ---- rays in one call ----

def measure_packets(bench, model):
    """Return the processor ns per camera ray, by the names of `ray_packets`: the least of seven rounds."""
    lines = bench.run(bench.build / "tests" / "bench" / "peers" / "ray_packets", model.file, model.ply,
                      model.queries_of("camera", bench.options.count, True), 7).splitlines()
    return {name.strip(): float(ns) for name, ns in (line.rsplit(None, 1) for line in lines)}


def section_packets(page, packets):
    page.text("## Rays in one call", "",
              "Processor ns per camera ray, the minimum of 7 rounds (`ray_packets MODEL MESH.ply RAYS 7`). *one call*: "
              "`ebpo_ray_first_many`.")
    page.table(["model", "single calls", "one call", "Embree", "Embree, 8 rays", "one call / 8 rays"],
               [[model.name] + [figure(p[way]) for way in ("single calls", "one call", "Embree", "Embree, 8 rays")]
                + [ratio(p["one call"], p["Embree, 8 rays"])] for model, p in packets.items()])


# ---- memory and loading ----

def measure_memory(bench, model):
    """Measure loading of a whole model and Embree's build, in turns: CPU seconds on one thread, wall-clock seconds on all
    cores, and bytes.
    """
    reports = {(p, t): [] for p in ("ebpo", "embree") for t in (1, 0)}
    for _ in range(bench.rounds(model)):
        for (peer, threads), runs in reports.items():
            source = model.file if peer == "ebpo" else model.ply
            runs.append(query_checks.loads(bench.run(
                bench.program(peer), source, "build", "--threads", threads,
                core=None if threads else False)))
    return {"ours": middle(reports["ebpo", 1], "load_cpu_s"),
            "embree": middle(reports["embree", 1], "build_cpu_s"),
            "ours all": middle(reports["ebpo", 0], "load_s"),
            "embree all": middle(reports["embree", 0], "build_s"),
            "bytes": reports["ebpo", 1][0]["bytes"] / model.faces,
            "embree bytes": reports["embree", 1][0]["bytes"] / model.faces,
            "mesh": 12 * (1 + model.info["vertices"] / model.faces)}


def section_memory(page, memory):
    page.text("## Memory and loading", "",
              "*Loading* ends when the first query can begin; the "
              "file is in the page cache. For Embree, loading is the build of a robust scene from "
              "a mesh in memory. *CPU s*: processor seconds on one thread; *all cores*: wall-clock "
              "seconds. Embree's point queries need its mesh.")
    page.table(["model", "faces", "ours, B per face", "Embree tree, B per face",
                "Embree tree and mesh, B per face", "ours / Embree with mesh",
                "ours, CPU s", "Embree, CPU s", "ours / Embree", "ours, all cores, s",
                "Embree, all cores, s", "ours / Embree"],
               [[model.name, f"{model.faces:,}", figure(m["bytes"]), figure(m["embree bytes"]),
                 figure(m["embree bytes"] + m["mesh"]),
                 ratio(m["bytes"], m["embree bytes"] + m["mesh"]), figure(m["ours"]),
                 figure(m["embree"]), ratio(m["ours"], m["embree"]), figure(m["ours all"]),
                 figure(m["embree all"]), ratio(m["ours all"], m["embree all"])]
                for model, m in memory.items()])


# ---- under a budget ----

def measure_budget(bench, model):
    """Measure queries under a budget, each on a newly opened model. The file is in the page cache."""
    rows = []
    with open(model.file, "rb") as f: # reads the file into the page cache
        while f.read(1 << 24):
            pass
    for query, points, count in [("distance", "uniform", bench.options.count // 50),
                                 ("distance", "path", bench.options.count),
                                 ("inside", "uniform", bench.options.count),
                                 ("inside", "path", bench.options.count)]:
        raw = model.queries_of(points, max(1, count))
        with Server(bench, "ebpo", model, "--memory", BUDGET, "--threads", 0, core=False) as s:
            rows.append((query, points, s.run_query(query, raw, "--clocked",
                                                      *(["--warm"] if query == "distance" else []))))
    return rows


def section_budget(page, model, rows):
    page.text("## Memory budget", "",
              f"{model.name}, {model.faces:,} faces, budget {BUDGET >> 20} MiB. Each row begins "
              "with a newly opened model; the file is in the page cache. *visited* and *loaded*: "
              "subtrees per query. *KiB read*: per query. Times are wall-clock times in us; background threads may use all cores.")
    page.table(["query", "points", "queries", "visited", "loaded", "KiB read", "mean", "p50",
                "p99", "p99.9", "max", "peak MiB"],
               [[query, points, f"{r['count']:,}", figure((r["hits"] + r["loads"]) / r["count"]),
                 figure(r["loads"] / r["count"]), figure(r["bytes_read"] / r["count"] / 1024)]
                + [us(r[n]) for n in ("clocked_mean_ns", "p50_ns", "p99_ns", "p999_ns", "max_ns")]
                + [figure(r["memory_peak"] / 2**20)] for query, points, r in rows if r])


# ---- opening, leaves ----

def section_opening(bench, page, models):
    page.text("## Opening", "",
              "Seconds from a cold file (`posix_fadvise` before each run) to the first result. "
              "Embree and CGAL load the PLY and build a tree. Ours decodes the whole file on one core (*all*), or only levels 0 to "
              f"{CUT} and the subtrees that the query needs (*cut*).")
    rows = []
    for query in ["inside", "distance"]:
        for model in models:
            raw = model.queries_of("uniform", 100)
            runs = {who: [] for who in ["ebpo", "cut"] + bench.peers(model)[1:]}
            for _ in range(bench.rounds(model)):
                runs["ebpo"].append(bench.ours(model, query, "--count", 100))
                runs["cut"].append(bench.ours(model, query, "--count", 1, "--cut-level", CUT))
                for peer in bench.peers(model)[1:]:
                    runs[peer].append(query_checks.loads(bench.run(
                        bench.program(peer), model.ply, query, raw, "--cold", "--count", 1)))
            first = {who: middle(r, "cold_first_result_seconds" if who in ("ebpo", "cut")
                                 else "first_result_s") for who, r in runs.items()}
            rows.append([model.name, query]
                        + [figure(size / 2**20) for size in
                           (model.ply.stat().st_size, model.file.stat().st_size,
                            middle(runs["ebpo"], "cold_bytes_read"),
                            middle(runs["cut"], "cold_bytes_read"))]
                        + [figure(first.get(who)) for who in ("ebpo", "cut", "embree", "cgal")]
                        + [ratio(first[who], first.get("embree")) for who in ("ebpo", "cut")])
    page.table(["model", "query", "PLY MB", "file MB", "MB read, all", "MB read, cut", "ours, all",
                "ours, cut", "Embree", "CGAL", "all / Embree", "cut / Embree"], rows)


def section_leaves(bench, page, models):
    page.text("## Leaves by kind", "",
              "Percent of the leaves. Leaves of all kinds except *general* classify a point by the "
              "signs of planes; a general leaf with a cell face that no face intersects uses one "
              "segment. *Gain*: time per uniform point in leaves of the kind, evaluated as general "
              "leaves and by planes (`tests/bench/bench_leaves MODEL.ebpo.h5`).")
    rows, gains = [], []
    for model in models:
        *kinds, last = query_checks.loads(bench.run(
            bench.build / "tests" / "bench" / "bench_leaves", model.file, "--json"))
        leaves = sum(kind["leaves"] for kind in kinds)
        rows.append([model.name, f"{model.faces:,}", f"{leaves:,}"]
                    + [figure(100 * n / max(1, leaves))
                       for n in [kind["leaves"] for kind in kinds] + [last["one_cell_face"]]])
        for kind in kinds[1:]:
            if kind["points"]:
                gains.append([model.name, kind["kind"], f"{kind['points']:,}",
                              figure(kind["ns_as_general"]), figure(kind["ns"]),
                              figure(kind["ns_as_general"] / kind["ns"])])
    page.table(["model", "faces", "leaves", "general", "one plane", "two planes", "convex set",
                "concave set", "general, one cell face free"], rows)
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
    words += ["--count", str(options.count), "--rounds", str(options.rounds), "--judged", str(options.judged)]
    if options.sections != ",".join(SECTIONS):
        words += ["--sections", options.sections]
    return shlex.join(words + ["-o", "docs/measured/queries.md"])


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", metavar="BUILD_DIR")
    parser.add_argument("models", metavar="MODEL.ply", nargs="+")
    parser.add_argument("--grow", metavar="BASE.ply:FACES", action="append", default=[],
                        help="also a model of at least this many faces: the faces of BASE are divided into four repeatedly")
    parser.add_argument("--count", type=int, default=100000,
                        help="queries of each kind (distance far from the surface: a twentieth; "
                             "default 100,000)")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--core", type=int, default=os.cpu_count() - 1,
                        help="the core of the measured programs")
    parser.add_argument("--side-core", type=int, default=0,
                        help="the core that judges results and counts misses meanwhile")
    parser.add_argument("--judged", type=int, default=2000,
                        help="number of results of each query that rational arithmetic judges")
    parser.add_argument("--work",
                        help="folder for models and queries (default BUILD_DIR/bench-query)")
    parser.add_argument("--sections", default=",".join(SECTIONS),
                        help="comma list of " + ", ".join(SECTIONS + MORE))
    parser.add_argument("-v", "--verbose", action="store_true", help="print the commands")
    parser.add_argument("-o", "--output", required=True)
    return parser.parse_args()


class Made:
    """The measurements so far. The page is complete after each step."""

    def __init__(self, bench):
        self.bench = bench
        self.results, self.packets, self.memory = {}, {}, {}
        self.budget, self.more = [], Page()
        self.found = {"results": None, "misses": None}

    def publish(self, largest):
        page, wanted = Page(), self.bench.options.sections.split(",")
        if "rays" in wanted:
            section_rays(page, self.results)
        if self.packets:
            section_packets(page, self.packets)
        for query in ("distance", "inside"):
            if query in wanted:
                section_points(page, self.results, query, *POINTS[query])
        section_tails(page, self.results)
        if self.memory:
            section_memory(page, self.memory)
        if self.budget:
            section_budget(page, largest, self.budget)
        page.lines += self.more.lines
        query_checks.write(page, self.found)
        write(self.bench.options, self.bench, page,
              goals_table(self.results, self.packets, self.memory, self.budget, self.found),
              summary(self.results, self.memory, self.budget, self.found))


POINTS = {
    "distance": ("Nearest point",
                 "Our distance is exact, signed and in double precision; each search begins "
                 "with the previous result, except *not warm*. "
                 "Embree's point query is in single precision; *Embree, warm*: its search "
                 "radius comes from the previous result."),
    "inside": ("Point in solid",
               "Embree counts the hits of a ray in single precision (robust scene). CGAL's "
               "`Side_of_triangle_mesh` is exact. "
               "*differs*: results that differ from ours, points on the surface excluded."),
}


def beside(bench, small, middling, wanted, found):
    """Run the parts that do not depend on time."""
    if "results" in wanted:
        found["results"] = query_checks.judge_results(bench, small)
    if "misses" in wanted:
        found["misses"] = query_checks.count_misses(bench, [small, middling])


def query_models(bench, models, made, wanted):
    """Query the models in turns on one core, while another core runs the parts that do not depend on time."""
    below = [m for m in models if m.faces < 2000000]
    structures = [s for s in ("rays", "distance", "inside") if s in wanted]
    with concurrent.futures.ThreadPoolExecutor(1) as side:
        done = side.submit(beside, bench, models[0], below[-1], wanted, made.found)
        for model in models:
            made.results[model] = query_one_model(bench, model, structures)
            made.publish(models[-1])
        if "opening" in wanted:
            section_opening(bench, made.more, below)
        if "leaves" in wanted:
            section_leaves(bench, made.more, below)
        done.result()


def main():
    options = parse()
    wanted = options.sections.split(",")
    unknown = set(wanted) - set(SECTIONS + MORE)
    if unknown:
        sys.exit(f"query.py: unknown sections: {', '.join(sorted(unknown))}; the sections are "
                 f"{', '.join(SECTIONS + MORE)}")
    bench = Bench(options)
    models = sorted((Model(bench, ply) for ply in
                     list(options.models) + [grown(bench, what) for what in options.grow]),
                    key=lambda m: m.faces)
    made = Made(bench)
    query_models(bench, models, made, wanted)
    if "packets" in wanted:
        made.packets = {m: measure_packets(bench, m) for m in models}
    if "memory" in wanted:
        made.memory = {m: measure_memory(bench, m) for m in models}
        made.publish(models[-1])
    if "budget" in wanted:
        made.budget = measure_budget(bench, models[-1])
        made.publish(models[-1])
    made.publish(models[-1])


def write(options, bench, page, goals, short):
    head, made = Page(), Page()
    head.text("# Query times", "", *short)
    made.text("## Measurement", "",
              f"Made by `{command_line(options)}` on {processor()}. Each query "
              "runs on one core. Unless a section says otherwise, a time is the "
              f"processor time per query in us, the median of {options.rounds} rounds (half as many "
              "above two million faces). *batch*: one call for all points. Load average "
              f"{statistics.median(bench.load):.1f} (median), "
              f"{max(bench.load):.1f} (maximum). Compare values within a row only.")
    text = "\n".join(head.lines + goals.lines + made.lines + page.lines).rstrip("\n") + "\n"
    pathlib.Path(options.output).write_text(reflow(text + handwritten(options.output)))


if __name__ == "__main__":
    main()
