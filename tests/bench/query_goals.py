"""The beginning of docs/measured/queries.md: the result in short, and the goals."""
from query_page import Page, figure, quotient

INSIDE = [0.4, 0.25, 0.12, 0.12]
FIRST = 1.15  # of first hits, for each kind of ordinary rays
RAYS = [("ray-any", "any hit", 1.5), ("ray-all", "all hits", 1.9)]
SSE2 = [("ray", "first hit", 3.5), ("ray-any", "any hit", 3.0), ("ray-all", "all hits", 3.8)]
DEGENERATE = [("ray", "first hit", 5), ("ray-any", "any hit", 5), ("ray-all", "all hits", 4)]
PACKETS = 1.3
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


def worst(results, query, ours):
    return [max(v) for v in zip(*(column(results, points, query, ours) for points in ORDINARY))]


def ray_goals(goals, results, packets):
    for points in ORDINARY:
        values = column(results, points, "ray", "ebpo")
        goals.add(f"{points} rays, first hit / Embree", FIRST, values, [FIRST] * len(values))
    for kind, ways, limits in (("", "ebpo", RAYS), (" with SSE2", "base", SSE2)):
        for query, name, goal in limits:
            values = worst(results, query, ways)
            goals.add(f"rays, {name}{kind} / Embree", goal, values, [goal] * len(values))
    for query, name, goal in DEGENERATE:
        values = [quotient(cells["degenerate", query]["ns"]["ebpo"], cells["uniform", query]["ns"]["ebpo"])
                  for cells in results.values() if ("degenerate", query) in cells]
        goals.add(f"degenerate / uniform rays, {name}", goal, values, [goal] * len(values))
    equal = [cells["equal", "ray-all"] for cells in results.values() if ("equal", "ray-all") in cells]
    if equal:
        goals.rows.append(["degenerate / uniform rays, equal crossings, all hits", "-", ", ".join(map(figure, equal)), "-"])
    values = [p["one call"] / p["Embree, 8 rays"] for p in packets.values()]
    goals.add("camera rays in one call / Embree's packets", PACKETS, values, [PACKETS] * len(values))


def goals_table(results, packets, memory, budget, found):
    goals, page = Goals(), Page()
    ray_goals(goals, results, packets)
    goals.add("inside / Embree, path, single calls", ", ".join(map(str, INSIDE)),
              column(results, "path", "inside", "ebpo"), INSIDE)
    goals.add("memory, B per face", 75, [m["bytes"] for m in memory.values()],
              [75] * 4)
    goals.add("loading / Embree build, CPU", 0.65,
              [quotient(m["ours"], m["embree"]) for m in memory.values()], [0.65] * 4)
    for query, points, r in budget:
        if r and (query, points) == ("distance", "uniform"):
            goals.add("subtrees loaded by a uniform distance query, 256 MiB", 2.5, [r["loads"] / r["count"]], [2.5])
            goals.add("uniform distance query, 256 MiB, ms", 1, [r["clocked_mean_ns"] / 1e6], [1])
        if r and points == "path":
            goals.add(f"{query} along a path, 256 MiB, p99.9, ms", 0.8, [r["p999_ns"] / 1e6], [0.8])
    if found["results"]:
        bad = sum(r["peers"]["ebpo"]["bits"] for r in found["results"][1])
        judged = sum(r["count"] for r in found["results"][1])
        goals.rows.append(["results that rational arithmetic contradicts", 0,
                           f"{bad} of {judged:,}", "missed" if bad else "met"])
    sizes = ", ".join(f"{model.faces / 1e6:.2g}" for model in results)
    page.text("## Goals", "",
              "A goal is an upper limit. Several values in a row are for the models of "
              f"{sizes} million faces; *1 of 4*: one of these values meets the goal. *Rays*: the worst of uniform, "
              "camera and segments.")
    page.table(["what", "goal", "measured", ""],
               sorted(goals.rows, key=lambda row: {"met": 1, "-": 2}.get(row[3], 0)))
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
        rays = [v for query, _, _ in SSE2 for p in ORDINARY
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
