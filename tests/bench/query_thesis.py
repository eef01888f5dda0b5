"""The modes of the EBP thesis on a large model, with the memory and the results of the thesis."""
from query_page import figure, us

# The program of the thesis kept 11 to 13 MB up to the cut level, and a few subtrees.
CUT, MEMORY = 7, 16 << 20
COUNTS = {"uniform": 100, "path": 20000}
SHOWN_LEVELS = {1, 6, 11}  # the measured levels that the page shows
# Counts of queries for modes in which a query takes up to a second. Cut envelopes are cached; the
# counts are large enough for all envelopes to be cut.
OTHERS = {"recursive": {"uniform": 4, "path": 1000},
          "envelope": {"uniform": 20000, "path": 20000}}

# EBP 2017, table 25: microseconds for a test, mean of three models of 26 to 28 million faces, for
# random points and a continuous path.
EBP_MODES = {"cache": (1769.11, 256.33), "nodes": (1153.04, 340.56), "subtree": (1264.36, 324.76),
             "cache-plain": (1985.27, 289.64), "nodes-plain": (2389.29, 369.21),
             "subtree-plain": (2607.71, 347.91)}
# EBP 2017, table 26: the same down to level 1, 2, ..., for cache, nodes and subtree. Levels up to 5
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
# EBP 2017, table 28: nearest point; envelopes down to level 1, 2, ... (levels as in table 27; table
# 28 counts from 0).
EBP_DISTANCE = {"recursive": (680.03, 7.612), "leaves": (694.994, 9.269)}
EBP_DISTANCE_LEVELS = [(87.911, 73.668), (25.624, 23.895), (7.595, 9.783), (10.469, 8.252),
                       (9.446, 5.524), (9.293, 4.807),
                       (5286.377, 44.979), (4799.680, 43.943), (4778.741, 44.022),
                       (4781.919, 43.845), (4678.370, 45.809)]


def run_query(bench, model, query, *arguments):
    """Return mean nanoseconds and loaded subtrees, for uniform points and for a path."""
    out = {}
    counts = next((OTHERS[word] for word in arguments if word in OTHERS), COUNTS)
    for points, count in counts.items():
        raw = model.queries_of(points, bench.options.count)
        report = bench.ours(model, query, "--count", count, "--memory", MEMORY,
                            "--cut-level", CUT, *arguments, points=raw)
        out[points] = (report["ns"]["mean"], report["model"]["loads"],
                       report["model"]["memory_peak"])
    return out


def modes(bench, model):
    return {mode: run_query(bench, model, "inside", "--mode", mode) for mode in EBP_MODES}


def levels(bench, model):
    return {(level, mode): run_query(bench, model, "inside", "--mode", mode, "--max-level", level)
            for level in range(1, deepest(model, EBP_LEVELS) + 1)
            for mode in ("cache", "nodes", "subtree")}


def distances(bench, model):
    kinds = {f"`{mode}`": ["--mode", mode] for mode in ("exact", "recursive", "leaves")}
    kinds |= {f"`envelope`, level {n}": ["--mode", "envelope", "--max-level", n]
              for n in range(1, deepest(model, EBP_DISTANCE_LEVELS) + 1)}
    return {name: run_query(bench, model, "distance", *words) for name, words in kinds.items()}


def deepest(model, rows):
    return min(len(model.info["levels"]) - 1, len(rows))


def tables(bench, model, wanted):
    out = {}
    if "modes" in wanted:
        out |= {"modes": modes(bench, model), "levels": levels(bench, model)}
    if "distance-modes" in wanted:
        out["distances"] = distances(bench, model)
    return out


def thesis_distance(name):
    words = name.replace("`", "").split(", level ")
    if len(words) == 2:
        return EBP_DISTANCE_LEVELS[int(words[1]) - 1]
    return EBP_DISTANCE.get(words[0])


def cells(tables):
    """Yield (name, our us, us of the thesis) of every cell with a value in the thesis."""
    for mode, ours in tables.get("modes", {}).items():
        for i, points in enumerate(COUNTS):
            yield f"{mode} {points}", ours[points][0] / 1000, EBP_MODES[mode][i]
    for (level, mode), ours in tables.get("levels", {}).items():
        at = 2 * ["cache", "nodes", "subtree"].index(mode)
        for i, points in enumerate(COUNTS):
            yield (f"{mode} to level {level} {points}", ours[points][0] / 1000,
                   EBP_LEVELS[level - 1][at + i])
    for name, ours in tables.get("distances", {}).items():
        for i, points in enumerate(COUNTS):
            if thesis_distance(name):
                yield f"{name} {points}", ours[points][0] / 1000, thesis_distance(name)[i]


def write(page, model, tables):
    if not tables:
        return
    page.text("## Modes of the EBP thesis", "",
              "The columns *EBP* are from tables 25, 26 and 28 of the thesis "
              "[EBP 2017](../../format-spec/README.md): means of three models of 26 to 28 million "
              f"faces. Our model is {model.name}, {model.faces:,} faces, with {MEMORY >> 20} MiB and "
              f"levels 0 to {CUT} in memory (`ebpo bench --memory {MEMORY} --cut-level {CUT}`). "
              f"There are {COUNTS['uniform']:,} uniform points and {COUNTS['path']:,} points of a "
              "path. Times are wall-clock times from a newly opened model and a cold file.")
    if "modes" in tables:
        page.text("The first table is for point in solid. `cache`: a cache of subtrees. `nodes`: reads "
                  "only the nodes on the path to the leaf, without a cache. `subtree`: one subtree "
                  "at a time, without a cache. `-plain`: without envelopes.")
        page.table(["mode", "uniform", "path", "peak MB", "EBP, random", "EBP, path"],
                   [[f"`{mode}`", us(o["uniform"][0]), us(o["path"][0]),
                     figure(max(o[p][2] for p in COUNTS) / 2**20)]
                    + [figure(t) for t in EBP_MODES[mode]] for mode, o in tables["modes"].items()])
    if "distances" in tables:
        page.text("The second table is for distances. `exact` returns the minimum; the other modes do "
                  "not guarantee it. `recursive`: distance to the faces below the deepest gray "
                  "node around the point. `leaves`: to the faces of the leaf around the point. "
                  "`envelope`: to the envelope of the deepest gray node around the point, down to a "
                  f"level. `recursive` has {OTHERS['recursive']['uniform']} uniform and "
                  f"{OTHERS['recursive']['path']:,} path points, `envelope` "
                  f"{OTHERS['envelope']['uniform']:,} and {OTHERS['envelope']['path']:,}. "
                  "`recursive` is not comparable: for a point in a white node, our program visits "
                  "every leaf below the parent. For random points these leaves have millions of "
                  "faces.")
        page.table(["mode", "uniform", "path", "EBP, random", "EBP, path"],
                   [[name, us(o["uniform"][0]), us(o["path"][0])]
                    + [figure(t) for t in thesis_distance(name) or ("-", "-")]
                    for name, o in tables["distances"].items()
                    if not name.startswith("`envelope`") or int(name.split()[-1]) in SHOWN_LEVELS])
    slower = [what for what, ours, theirs in cells(tables) if ours > theirs]
    page.text("Slower than in the thesis, of all modes and levels: " + (", ".join(slower) or "none") + ".")
