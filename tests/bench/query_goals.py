"""The beginning of docs/measured/queries.md: the result in short, and the goals."""
from query_page import Page, figure, quotient

SIZES = ["70 K", "1 M", "5.5 M", "25.6 M"]
# Time of fcpw divided by that of Embree's point query, measured on a machine that had both.
FCPW = {"path": [0.72, 0.48, 0.49, 0.49], "uniform": [0.63, 0.47, 0.47, 0.47]}
NEAREST = {"path": [0.85, 0.7, 0.6, 0.6], "uniform": [0.7, 0.35, 0.35, 0.35]}
INSIDE = [0.4, 0.25, 0.12, 0.12]
RAYS = [("ray", "first hit", 1.75), ("ray-any", "any hit", 1.5), ("ray-all", "all hits", 1.9)]
ORDINARY = ["uniform", "camera", "segments"]


class Goals:
    def __init__(self):
        self.rows = []

    def add(self, what, goal, values, limits, digits=3):
        """Adds a row that compares each value with its upper limit."""
        known = [(v, l) for v, l in zip(values, limits) if v is not None]
        if not known:
            return
        met = sum(v <= l for v, l in known)
        word = "met" if met == len(known) else "missed" if met == 0 else f"{met} of {len(known)}"
        self.rows.append([what, goal, ", ".join(figure(v, digits) for v in values), word])


def column(results, points, query, ours, theirs="embree"):
    return [quotient(cells[points, query]["ns"].get(ours), cells[points, query]["ns"].get(theirs))
            for cells in results.values() if (points, query) in cells]


def ray_goals(goals, results):
    for query, name, goal in RAYS:
        values = [max(v) for v in zip(*(column(results, p, query, "ebpo") for p in ORDINARY))]
        goals.add(f"rays, {name} / Embree", goal, values, [goal] * 4)
    for query, name, goal in RAYS:
        values = [max(v) for v in zip(*(column(results, p, query, "base") for p in ORDINARY))]
        goals.add(f"rays, {name} with SSE2 / Embree", 2 * goal, values, [2 * goal] * 4)
    for query, name, _ in RAYS:
        goals.add(f"degenerate / uniform rays, {name}", 5,
                  [quotient(cells["degenerate", query]["ns"]["ebpo"],
                            cells["uniform", query]["ns"]["ebpo"])
                   for cells in results.values() if ("degenerate", query) in cells], [5] * 4)


def point_goals(goals, results):
    for points, limits in NEAREST.items():
        values = [None if v is None else v / share for v, share in
                  zip(column(results, points, "distance", "ebpo"), FCPW[points])]
        goals.add(f"nearest point / estimate for fcpw, {points}", ", ".join(map(str, limits)), values,
                  limits)
    goals.add("inside / Embree, path, single calls", ", ".join(map(str, INSIDE)),
              column(results, "path", "inside", "ebpo"), INSIDE)


def goals_table(results, memory, budget, found):
    goals, page = Goals(), Page()
    ray_goals(goals, results)
    point_goals(goals, results)
    goals.add("memory, B per face", 75, [m["bytes"] for m in memory.values()],
              [75] * 4)
    goals.add("loading / Embree build, CPU", 0.65,
              [quotient(m["ours"], m["embree"]) for m in memory.values()], [0.65] * 4)
    for query, points, r in budget:
        if r and (query, points) == ("distance", "uniform"):
            goals.add("subtrees visited by a uniform distance query, 256 MiB", 7.4,
                      [(r["hits"] + r["loads"]) / r["count"]], [7.4])
            goals.add("uniform distance query, 256 MiB, ms", 1, [r["clocked_mean_ns"] / 1e6], [1])
        if r and points == "path":
            goals.add(f"{query} along a path, 256 MiB, p99.9, ms", 1,
                      [r["p999_ns"] / 1e6], [1])
    if found["results"]:
        bad = sum(r["peers"]["ebpo"]["bits"] for r in found["results"][1])
        judged = sum(r["count"] for r in found["results"][1])
        goals.rows.append(["results that rational arithmetic contradicts", 0,
                           f"{bad} of {judged:,}", "missed" if bad else "met"])
    page.text("## Goals", "",
              "The table begins with missed goals. A goal is an upper limit. Four values in a row are for the models of "
              f"{', '.join(SIZES)} faces; *1 of 4*: one of these values meets the goal. *Rays*: the worst of uniform, "
              "camera and segments. The time of fcpw, a nearest-point library, is estimated: Embree's time, "
              "multiplied by the ratio of the two times on another machine, for each model: "
              f"{', '.join(map(str, FCPW['path']))} (path) and "
              f"{', '.join(map(str, FCPW['uniform']))} (uniform).")
    page.table(["what", "goal", "measured", ""],
               sorted(goals.rows, key=lambda row: row[3] == "met"))
    return page


def span(values, digits=2):
    known = [v for v in values if v is not None]
    if not known:
        return "-"
    return f"{figure(min(known), digits)} to {figure(max(known), digits)}"


def summary(results, memory, budget, found):
    """Returns the result of the page in at most three sentences."""
    lines = []
    if results:
        rays = [v for query, _, _ in RAYS for p in ORDINARY
                for v in column(results, p, query, "ebpo")]
        near, inside = ([v for p in ("path", "uniform")
                         for v in column(results, p, query, "ebpo")]
                        for query in ("distance", "inside"))
        lines.append(f"- With the model in memory, a ray query takes {span(rays)} times as long as "
                     f"Embree's in single precision, a nearest-point query {span(near)} times, a "
                     f"point-in-solid query {span(inside)} times.")
    if found["results"]:
        bad = sum(r["peers"]["ebpo"]["bits"] for r in found["results"][1])
        judged = sum(r["count"] for r in found["results"][1])
        lines.append(f"- Results are exact: rational arithmetic contradicts {bad} of {judged:,} "
                     "results.")
    means = [f"{figure(r['clocked_mean_ns'] / 1000)} us ({query})"
             for query, points, r in budget if r and points == "path"]
    if memory and means:
        lines.append(f"- A model takes {span([m['bytes'] for m in memory.values()], 3)} B per face "
                     f"in memory. With a budget of 256 MiB for the largest model, a query along a "
                     f"path takes {' or '.join(means)} on average.")
    return lines
