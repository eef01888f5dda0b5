"""The runs of theses.py: each is a step whose result is kept as JSON beside this script, with the machine
and its load, so that an interrupted script continues where it stopped, also on another machine."""
import json
import os
import pathlib
import time

import measured

RESULTS = pathlib.Path(__file__).resolve().parent / "thesis_results"
PERCENTS = (10, 20, 30, 40, 50)
# EBP has no criterion for leaves: all are on the deepest level.
EBP = ("--unlimited", "--leaf-faces", 0, "--points", 1)
# EBP counts the root as level 1 and keeps levels 1 to 5: our levels 0 to 4.
CUT = 4
MODES = ("cache", "nodes", "subtree", "cache-plain", "nodes-plain", "subtree-plain")
MEMORY = 32 << 20
SHOWN_LEVELS = (0, 4, 5, 7, 10)
POINTS, SOME_POINTS, FEW_POINTS = 100_000, 10_000, 1_000
LEVEL_WORDS = ("--cut-level", CUT, "--memory", MEMORY)
LEVEL_QUERIES = {"inside": ("--mode", "cache"), "distance": ("--query", "distance", "--mode", "envelope")}
CROSSING_STEPS = 40
# Name, the fixed model, the one that moves, and its size: its diagonal divided by the other's.
SCENARIOS = (("lucy_lucy", "lucy_x256", "lucy_x256", 1), ("lucy_armadillo", "lucy_x256", "armadillo", 0.5),
             ("lucy16_lucy16", "lucy_x16", "lucy_x16", 1),
             ("armadillo_armadillo", "armadillo_x4", "armadillo_x4", 1),
             ("lucy16_armadillo", "lucy_x16", "armadillo_x4", 0.5))


class Runs:
    def __init__(self, build, models, work):
        self.build, self.models, self.work = build, models, work
        work.mkdir(parents=True, exist_ok=True)
        RESULTS.mkdir(exist_ok=True)
        self.ebpo, self.generate = build / "tools/ebpo", build / "samples/ebpo-generate"

    # --- files ---

    def model(self, name):
        """The path of a mesh: shared, or made in the work folder."""
        made = self.work / f"{name}.ply"
        return made if made.exists() else self.models / f"{name}.ply"

    def file(self, name):
        return self.work / f"{name}.ebpo.h5"

    def path_of(self, step):
        return RESULTS / f"{step}.json"

    def result(self, step):
        """The result of a step; None if it was not run."""
        path = self.path_of(step)
        return json.loads(path.read_text()) if path.exists() else None

    def results(self):
        """The results of all steps that were run."""
        return [found for step in STEPS if (found := self.result(step))]

    def run_step(self, step):
        begun = time.monotonic()
        out = STEPS[step][1](self)
        out["step_seconds"] = time.monotonic() - begun
        out["load"], out["machine"] = os.getloadavg()[0], measured.machine()
        part = self.path_of(step).with_suffix(".part")
        part.write_text(json.dumps(out, indent=1))
        part.rename(self.path_of(step))

    # --- commands ---

    def call(self, *words):
        return measured.run(*words)

    def json_of(self, *words):
        return json.loads(self.call(self.ebpo, *words)["printed"])

    def mesh(self, name, *words):
        """Makes a mesh in the work folder."""
        if not (self.work / f"{name}.ply").exists():
            part = self.work / f"{name}.part.ply"
            self.call(*words, part)
            part.rename(self.work / f"{name}.ply")

    def convert(self, name, mesh, *options):
        """Builds a file: seconds of the command and of the stages, peak memory, bytes, levels."""
        out = self.file(name)
        took = self.call(self.ebpo, "convert", "--json", "-q", *options, mesh, out)
        stated = json.loads(took["printed"])
        return {"wall": took["wall"], "cpu": took["cpu"], "peak": took["peak"],
                "build": stated["thesis_stages"][6]["seconds"], "faces": stated["faces"],
                "vertices": stated["vertices"], "ply": os.path.getsize(mesh),
                "bytes": os.path.getsize(out), "parts": stated["bytes"],
                "levels": self.json_of("info", "--json", out)["levels"]}

    def report(self, mesh, *options):
        """The methods of a report, without what was timed for deadlines and budgets."""
        stated = self.json_of("report", "--json", "-q", "--no-pictures", *options, "-o",
                              self.work / "report", mesh)
        volume = stated["model"].get("volume") or stated["model"].get("winding_integral")
        return {"volume": volume, "faces": stated["model"]["faces"],
                "methods": [{k: v for k, v in m.items() if k not in ("deadlines", "budgets", "file")}
                            for m in stated["methods"]]}

    def bench(self, name, *options):
        stated = self.json_of("bench", "--json", *options, self.file(name))
        return {k: stated[k] for k in ("ns", "batch_ns", "count", "open_seconds",
                                       "cold_open_seconds", "cold_first_result_seconds", "model")
                if k in stated}

    def crossing(self, a, b, size, query, budget):
        """For each step of a crossing: microseconds, pairs, loaded subtrees and bytes."""
        printed = self.call(self.build / "tests/bench/peers/crossing_ebpo", self.file(a), self.file(b),
                            CROSSING_STEPS, query, size, budget)["printed"]
        return [[float(x) for x in line.split()] for line in printed.splitlines()[1:]]


# --- steps ---

def small(name):
    """Our default on a model: the fastest of three builds, size, levels, loading and queries."""
    def step(runs):
        out = min((runs.convert(name, runs.model(name)) for _ in range(3)),
                  key=lambda built: built["build"])
        out["derived"] = runs.json_of("measure", "--json", "--derived", runs.file(name))["levels"]
        out["inside"] = runs.bench(name, "--count", 1_000_000)
        out["distance"] = runs.bench(name, "--query", "distance", "--count", POINTS)
        return out
    return step


def repaired(runs):
    """The dragon as a solid: equal positions merged."""
    runs.call(runs.ebpo, "convert", "-q", "--weld", runs.models / "dragon_vrip.ply",
              runs.file("dragon_solid"))
    runs.mesh("dragon_solid", runs.ebpo, "extract", "-q", "--mesh", runs.file("dragon_solid"))
    return small("dragon_solid")(runs)


def as_bp(name, k_root, measured_levels="0-"):
    """BP-Octree: k-medoids, K of the faces, leaves by criterion 1 with N = 50, nine levels. Levels
    without limits are all computed; `measured_levels` are those of the file."""
    def step(runs):
        return runs.report(runs.model(name), "--select", "kmedoids", "--k-root", k_root,
                           "--unlimited", "--coalesce", "sum", "--leaf-faces", 50, "--max-level",
                           9, "--points", 1, "--levels", measured_levels)
    return step


def sent(name):
    """Our levels in the cost model of the theses, with leaves of 50 faces."""
    def step(runs):
        return runs.report(runs.model(name), "--leaf-faces", 50, "--points", 1)
    return step


def leaves(name):
    """Number of leaves by criteria 1 and 2 of BP, and by ours; and, for each level, the nodes with
    faces and the lengths of their lists."""
    def step(runs):
        out = {}
        for rule, number in (("sum", 50), ("mean", 20)):
            stated = runs.report(runs.model(name), "--select", "offset", "--unlimited", "--coalesce",
                                 rule, "--leaf-faces", number, "--max-level", 9, "--points", 1)
            out[rule] = stated["methods"][0]["unlimited"]["levels"]
        out["distinct"] = {number: [{k: l[k] for k in ("gray", "leaf")} for l in runs.convert(
            f"{name}_leaves", runs.model(name), "--leaf-faces", number)["levels"]]
            for number in (50, 49, 16)}
        deepest = [runs.convert(f"{name}_leaves", runs.model(name), "--leaf-faces", 0, "--max-level",
                                level)["levels"][-1] for level in range(1, 8)]
        out["nodes"] = [l["leaf"] for l in deepest]
        out["entries"] = [l["faces_new"] + l["faces_again"] for l in deepest]
        os.remove(runs.file(f"{name}_leaves"))
        return out
    return step


def methods(name, percents):
    """The three selections of EBP without limits, with leaves on the deepest level only; and our
    default."""
    def step(runs):
        out = runs.report(runs.model(name), "--select", "kmedoids,offset", "--percent",
                          ",".join(map(str, percents)), *EBP, "--levels", "0-1")
        more = runs.report(runs.model(name), "--select", "random", "--percent",
                           ",".join(map(str, percents)), *EBP, "--levels", "0-1")
        out["methods"] += more["methods"]
        out["ours"] = runs.convert(name, runs.model(name))
        return out
    return step


def grown(name, times):
    def step(runs):
        runs.mesh(name, runs.generate, "--base", runs.models / "lucy100k.ply", "--subdivide", times)
        return {"bytes": os.path.getsize(runs.model(name))}
    return step


def large(runs):
    """Our default on the large model."""
    out = runs.convert("lucy_x256", runs.model("lucy_x256"), "--memory", "1GiB")
    out["memory"] = runs.json_of("info", "--json", "--memory", "16MiB", runs.file("lucy_x256"))
    out["memory"] = out["memory"]["memory"]
    return out


def large_selection(select, percent):
    def step(runs):
        name = f"lucy_x256_{select}_{percent}"
        out = runs.convert(name, runs.model("lucy_x256"), "--memory", "1GiB", "--select", select,
                           "--percent", percent, "--leaf-faces", 0, "--parts=+leaf-planes")
        os.remove(runs.file(name))
        return out
    return step


def modes(points):
    """EBP tables 21, 22, 25 and 28, with EBP's cut level. Exact distances of uniform points are few:
    each loads several subtrees."""
    def step(runs):
        words = ["--points", points, "--cut-level", CUT, "--memory", MEMORY]
        out = {mode: runs.bench("lucy_x256", *words, "--count", POINTS, "--mode", mode)
               for mode in MODES}
        few = POINTS if points == "path" else FEW_POINTS
        out["distance"] = runs.bench("lucy_x256", *words, "--count", few, "--query", "distance")
        return out
    return step


def levels_path(runs):
    """EBP tables 24, 26 and 28: to a level, wall-clock ns."""
    words = ["--points", "path", "--count", POINTS, *LEVEL_WORDS]
    deepest = len(runs.result("large")["levels"]) - 1
    return {query: [runs.bench("lucy_x256", *words, *mode, "--max-level", level)["ns"]["mean"]
                    for level in range(deepest + 1)] for query, mode in LEVEL_QUERIES.items()}


def levels_uniform(runs):
    """EBP tables 23, 26 and 28: to a level, processor time in ns, without opening: an upper bound, as it is
    that of single calls and of one batch. Below the cut level, points are fewer, as each loads a subtree."""
    def processor(count, *mode):
        return runs.call(runs.ebpo, "bench", "--json", "--points", "uniform", "--count", count, *LEVEL_WORDS,
                         *mode, runs.file("lucy_x256"))["cpu"]
    out = {}
    for query, mode in LEVEL_QUERIES.items():
        opening = min(processor(1, *mode) for _ in range(3))
        out[query] = [None] * (max(SHOWN_LEVELS) + 1)
        for level in SHOWN_LEVELS:
            count = POINTS if level <= CUT else SOME_POINTS
            took = processor(count, *mode, "--max-level", level) - opening
            out[query][level] = 1e9 * took / count
    return out


def collisions(runs):
    """EBP tables 30, 31 and 33: one model moves through another, in memory and with a budget."""
    for name, base, times in (("armadillo_x4", "armadillo", 1), ("lucy_x16", "lucy100k", 2)):
        runs.mesh(name, runs.generate, "--base", runs.models / f"{base}.ply", "--subdivide", times)
    for name in ("armadillo", "armadillo_x4", "lucy_x16"):
        runs.convert(name, runs.model(name))
    out = {}
    for name, a, b, size in SCENARIOS:
        out[name] = {"first": runs.crossing(a, b, size, "first", 0), "all": runs.crossing(a, b, size, "all", 0)}
        if "lucy_x256" in (a, b):
            out[name]["budget"] = runs.crossing(a, b, size, "all", 256 << 20)
    return out


def memory_by_level(runs):
    """EBP tables 5 to 7 and 16: memory with levels 0 to C kept, before anything else is loaded."""
    out = {"open": [], "bytes": []}
    for cut in range(8):
        stated = runs.bench("lucy_x256", "--count", 1, "--cut-level", cut)
        out["bytes"].append(stated["model"]["memory"])
        out["open"].append(stated["cold_first_result_seconds"])
    return out


# Name: (what it is for, the function). The order is that in which the script runs them.
STEPS = {
    "bunny": ("our default on the bunny", small("bunny_closed")),
    "bunny_bp": ("BP tables 3.3, 3.9, 4.1, 4.3", as_bp("bunny_closed", "1%")),
    "bunny_sent": ("BP table 4.4", sent("bunny_closed")),
    "bunny_leaves": ("BP table 3.1", leaves("bunny_closed")),
    **{f"bunny_bp_{k}": (f"BP tables 3.4 to 3.8, K = {k} %", as_bp("bunny_closed", f"{k}%", "0-2"))
       for k in ("0.05", "0.1", "0.5", "5")},
    "dragon": ("our default on the dragon", repaired),
    "dragon100k_bp_1": ("BP tables 4.1, 4.3 on a dragon of 100,000 faces", as_bp("dragon100k", "1%", "0-2")),
    "dragon_bp_0.1": ("BP tables 3.5, 3.6, K = 0.1 %", as_bp("dragon_solid", "0.1%", "0-2")),
    "lucy_methods": ("EBP tables 2 to 14 on 99,970 faces", methods("lucy100k", PERCENTS)),
    "grow16": ("a mesh of 1.6 million faces", grown("lucy_x16", 2)),
    "grow256": ("a mesh of 25.6 million faces", grown("lucy_x256", 4)),
    "large": ("our default on 25.6 million faces", large),
    "memory": ("EBP tables 1, 5 to 7, 11, 16, 17, 19", memory_by_level),
    "collisions": ("EBP tables 29 to 33", collisions),
    "modes_path": ("EBP tables 22, 25, 27, 28", modes("path")),
    "levels_path": ("EBP tables 24, 26, 28", levels_path),
    "modes_uniform": ("EBP tables 21, 25, 27, 28", modes("uniform")),
    "levels_uniform": ("EBP tables 23, 26, 28", levels_uniform),
    "large_kmedoids_40": ("EBP tables 4, 10, 14 to 20", large_selection("kmedoids", 40)),
    "dragon_bp_1": ("BP tables 3.3, 3.5, 3.9, 4.1, 4.3", as_bp("dragon_solid", "1%", "0-2")),
    "lucy16_methods_40": ("EBP tables 12 to 14, 40 %, 1.6 million faces",
                          methods("lucy_x16", (40,))),
    "dragon_sent": ("BP table 4.11", sent("dragon_solid")),
    "large_offset_40": ("EBP tables 2, 8, 12", large_selection("offset", 40)),
    "large_random_40": ("EBP tables 3, 9, 13", large_selection("random", 40)),
} | {
    f"dragon_bp_{k}": (f"BP tables 3.5 and 3.6, K = {k} %", as_bp("dragon_solid", f"{k}%", "0-2"))
    for k in ("0.01", "0.05", "0.5", "5")}

# Expected minutes of one core for steps that are often omitted.
MINUTES = {f"large_{select}_40": 16 for select in ("kmedoids", "offset", "random")}
