"""What became of the goals: the table at the head of docs/measured/queries.md."""
import query_thesis
from query_page import Page, figure, quotient

SIZES = ["70 K", "1 M", "5.5 M", "25.6 M"]
# fcpw's time, of Embree's point query, as measured elsewhere where both could be had.
FCPW = {"path": [0.72, 0.48, 0.49, 0.49], "uniform": [0.63, 0.47, 0.47, 0.47]}
NEAREST = {"path": [0.85, 0.7, 0.6, 0.6], "uniform": [0.7, 0.35, 0.35, 0.35]}
INSIDE = [0.4, 0.25, 0.12, 0.12]
RAYS = [("ray", "first hit", 1.75), ("ray-any", "any hit", 1.5), ("ray-all", "all hits", 1.9)]
ORDINARY = ["uniform", "camera", "segments"]


class Goals:
    def __init__(self):
        self.rows = []

    def add(self, what, goal, values, limits, digits=3):
        """`values` against `limits` that they must not exceed, one by one."""
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
        for points in ORDINARY:
            values = column(results, points, query, "ebpo")
            goals.add(f"{name} / Embree robust, {points}", goal, values, [goal] * 4)
    for query, name, goal in RAYS:
        values = [max(v) for v in zip(*(column(results, p, query, "base") for p in ORDINARY))]
        goals.add(f"{name}, SSE2, the worst of the three", 2 * goal, values, [2 * goal] * 4)
    for query, name, _ in RAYS:
        goals.add(f"degenerate rays / uniform ones, {name}", 5,
                  [quotient(cells["degenerate", query]["ns"]["ebpo"],
                            cells["uniform", query]["ns"]["ebpo"])
                   for cells in results.values() if ("degenerate", query) in cells], [5] * 4)


def point_goals(goals, results):
    for points, limits in NEAREST.items():
        values = [None if v is None else v / share for v, share in
                  zip(column(results, points, "distance", "ebpo"), FCPW[points])]
        goals.add(f"nearest, {points} / fcpw (Embree's point query x "
                  f"{', '.join(map(str, FCPW[points]))})", ", ".join(map(str, limits)), values,
                  limits)
    goals.add("inside, path / Embree, single calls", ", ".join(map(str, INSIDE)),
              column(results, "path", "inside", "ebpo"), INSIDE)


def goals_table(results, memory, budget, tables, found):
    goals, page = Goals(), Page()
    ray_goals(goals, results)
    point_goals(goals, results)
    goals.add("memory, all in memory, B a face", 75, [m["bytes"] for m in memory.values()],
              [75] * 4)
    goals.add("loading / Embree's build, CPU", 0.65,
              [quotient(m["ours"], m["embree"]) for m in memory.values()], [0.65] * 4)
    for query, points, r in budget:
        if r and (query, points) == ("distance", "uniform"):
            goals.add("subtrees touched by a uniform distance, 256 MiB", 2.5,
                      [(r["hits"] + r["loads"]) / r["count"]], [2.5])
            goals.add("ms a uniform distance, 256 MiB", 1, [r["clocked_mean_ns"] / 1e6], [1])
        if r and points == "path":
            goals.add(f"continuous path at once, 256 MiB, {query}: p99.9 ms", 1,
                      [r["p999_ns"] / 1e6], [1])
    thesis = list(query_thesis.cells(tables))
    if thesis:
        slower = [what for what, ours, theirs in thesis if ours > theirs]
        goals.rows.append(["the thesis' own modes, its memory, cells slower than its figures", 0,
                           f"{len(slower)} of {len(thesis)}", "missed" if slower else "met"])
    if found["answers"]:
        bad = sum(r["peers"]["ebpo"]["bits"] for r in found["answers"][1])
        asked = sum(r["count"] for r in found["answers"][1])
        goals.rows.append(["answers that rational arithmetic contradicts", 0,
                           f"{bad} of {asked:,}", "missed" if bad else "met"])
    page.text("## Goals", "",
              f"Largest values that are wanted, for models of {', '.join(SIZES)} faces, and what "
              "was measured in this run.")
    page.table(["what", "goal", "measured", ""], goals.rows)
    return page
