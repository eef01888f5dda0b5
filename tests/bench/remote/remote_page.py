"""Prints docs/measured/remote.md from the measurements.

The page has the measurements of the new build; --json keeps the others.
"""
import statistics

import url_queries
import measured
from query_page import Page, figure

BEFORE, MIXED, AFTER = "before", "old file", "after"
NAMES = {"least_round_trips": "round trips"}  # names on the page


def middle(values):
    """Return the median and, for several values, the maximum."""
    if not values:
        return "-"
    return figure(statistics.median(values)) + (f" / {figure(max(values))}"
                                                if len(values) > 1 else "")


class Found:
    """The measurements, by side, row and value."""
    def __init__(self, found):
        self.found = found

    def row(self, side, name):
        return self.found.get(f"{side}/{name}")

    def values(self, side, name, what):
        row = self.row(side, name)
        return row and row.get(what)

    def rows(self):
        """Return the names of the queries by URL, in order, with text and command."""
        seen = {}
        for name, row in self.found.items():
            if isinstance(row, dict) and "command" in row:
                seen.setdefault(name.split("/", 1)[1], row)
        return seen

    def beyond(self, side, what):
        """Return levels 6 to 8: the difference of levels 0 to 8 and levels 0 to 5."""
        both = [self.values(side, name, what) for name in ("levels 8", "levels 5")]
        return both[0] and both[1] and [both[0][0] - both[1][0]]

    def local(self, side, what):
        row = self.row(side, "local")
        if not row:
            return None
        if what == "first":
            return [1e3 * r["cold_first_result_seconds"] for q in row.values() for r in q["first"]]
        return [q["path"]["ns"]["p999"] / 1e6 for q in row.values()]

    def viewer(self, side, step, what):
        row = self.row(side, "viewer")
        if not row:
            return None
        return [row[step]["seconds"] if what == "seconds" else row[step]["model"][1]]


# --- the goals ---

def goals():
    """Yields the name of each measured value, its getter for a side, and the upper limit."""
    for query in "distance", "inside":
        for what, most in (("least_round_trips", 4), ("requests", 20), ("bytes", 0.7e6), ("seconds", 0.8)):
            yield (f"one {query}: {NAMES.get(what, what)}",
                   lambda f, s, a=(f"{query} one", what): f.values(s, *a), most)
        for what, most in (("least_round_trips", 5), ("requests", 500), ("bytes", 20e6), ("seconds", 3)):
            yield (f"100 near points, {query}: {NAMES.get(what, what)}",
                   lambda f, s, a=(f"{query} 100", what): f.values(s, *a), most)
    yield "`fetch --box`: round trips", lambda f, s: f.values(s, "box", "least_round_trips"), 5
    yield "`fetch --box`: bytes", lambda f, s: f.values(s, "box", "bytes"), 1.5e6
    yield "close-up, nodes: requests", lambda f, s: f.values(s, "view", "requests"), 20
    yield "close-up, nodes: bytes", lambda f, s: f.values(s, "view", "bytes"), 1e6
    for row, subject, requests, size in (("distance deep small", "deep inside", 30, 1e6),
                                         ("ray eye small", "rays from one eye", 80, 7.2e6)):
        for what, most in ("requests", requests), ("bytes", size):
            yield f"{subject}: {what}", lambda f, s, a=(row, what): f.values(s, *a), most
    yield "levels 0 to 5: requests", lambda f, s: f.values(s, "levels 5", "requests"), 1
    yield "levels 6 to 8, with their checksums: requests", lambda f, s: f.beyond(s, "requests"), 3
    yield "levels 6 to 8, with their checksums: bytes", lambda f, s: f.beyond(s, "bytes"), 2.1e6
    yield "viewer, first picture: s", lambda f, s: f.viewer(s, "first", "seconds"), 2
    yield "viewer, a click's distance: s", lambda f, s: f.viewer(s, "click", "seconds"), 1.5
    yield "viewer, close-up: bytes", lambda f, s: f.viewer(s, "close", "bytes"), 4e6
    yield "local, first result cold: ms", lambda f, s: f.local(s, "first"), 20
    yield "local, p99.9 of a path without pauses: ms", lambda f, s: f.local(s, "path"), 1


IN_GOALS = "distance one", "inside one", "distance 100", "inside 100"  # all values of these queries


def goal_rows(found):
    for what, get, most in goals():
        after = get(found, AFTER)
        yield [what, middle(after), f"at most {figure(most)}",
               "-" if not after else "yes" if statistics.median(after) <= most else "no"]


def joined(rows):
    """Returns one row for each subject: its measured values with their limits."""
    subjects = {}
    for what, measured, goal, _ in rows:
        subject, quantity = what.rsplit(": ", 1)
        value = f"{measured} {quantity}" if quantity in ("s", "ms") else f"{quantity} {measured}"
        subjects.setdefault(subject, []).append(f"{value} ({goal.removeprefix('at most ')})")
    return [[subject, ", ".join(values)] for subject, values in subjects.items()]


def without_gaps(page, found):
    """Says what the rays read of a local file."""
    row = found.row(AFTER, "without gaps")
    if row:
        page.text("Requests include gaps between chunks. Without gaps (local file, `--stats`), 100 rays read "
                  f"{row[0]} subtrees, {figure(row[1] / 1e6)} MB.")


def known_in_advance(page, found):
    """Says what a query would take that knew the needed subtrees."""
    row = found.row(AFTER, "known")
    if row:
        def said(runs):
            return ", ".join(f"{middle(list(values))} {what}"
                             for values, what in zip(zip(*runs), ("subtrees", "requests", "bytes")))
        page.text("Queries that request all needed subtrees together, known in advance (`needed_subtrees`): "
                  + "; ".join(f"{query} {said(runs)}" for query, runs in row.items()) + ".")


def goal_table(page, found):
    page.text("## Goals", "",
              "*Measured* is the median, and the maximum where there are several values; the goal, a limit, "
              "is for the median. All queries are cold: each is a new process without a cache.")
    without_gaps(page, found)
    known_in_advance(page, found)
    rows = list(goal_rows(found))
    page.table(["missed or not measured", "measured (goal)"], joined(row for row in rows if row[3] != "yes"))
    page.table(["met", "measured (goal)"], joined(row for row in rows if row[3] == "yes"))


def summary(found):
    """Returns the result of the page in at most two sentences."""
    def of(name):
        return (f"{middle_only(found.values(AFTER, name, 'least_round_trips'))} round trips, "
                f"{middle_only(found.values(AFTER, name, 'requests'))} requests, "
                f"{middle_only(found.values(AFTER, name, 'bytes'))} bytes and "
                f"{middle_only(found.values(AFTER, name, 'seconds'))} s")
    lines = [f"- With a round trip of 100 ms, a cold distance query near the surface of a model of "
             f"25.6 million faces takes {of('distance one')}."]
    if found.row(AFTER, "viewer"):
        lines.append("- At 5 Mbit/s the viewer shows its first picture after "
                     f"{middle(found.viewer(AFTER, 'first', 'seconds'))} s, and an exact distance "
                     f"{middle(found.viewer(AFTER, 'click', 'seconds'))} s after a click.")
    return lines


def middle_only(values):
    return figure(statistics.median(values)) if values else "-"


# --- measurements ---

def query_table(page, found):
    page.text("## Queries by URL", "",
              "The round trip is 100 ms, also for each new connection. nginx's log has requests "
              "and bytes. *Round trips* are chains of dependent requests, counted with "
              f"`--http-connections {url_queries.CONNECTIONS}`: the minimum of {url_queries.TRIES} tries. All "
              "else is measured with the default connections.", "",
              f"*Near* points are at most {url_queries.NEAR:g} diagonals from the surface, at positions where "
              f"random lines enter the model. The commands are `ebpo distance` and `ebpo inside "
              f"--memory {url_queries.BUDGET} URL POINTS`, `ebpo ray`, `ebpo fetch -q --box`, `ebpo levels --max-level` and `ebpo "
              "view --seen-only --pixels 16`.")
    page.table(["query", "round trips", "requests", "bytes", "s"],
               [[row["what"],
                 *(middle(found.values(AFTER, name, what))
                   for what in ("least_round_trips", "requests", "bytes", "seconds"))]
                for name, row in found.rows().items()
                if found.row(AFTER, name) and name not in IN_GOALS])
    same = found.row(AFTER, "same")
    if same is not None:
        page.text("For 10,000 points around the same positions, the results by URL and from the "
                  f"file on disk are {'equal' if same else 'NOT equal'} (`ebpo inside` and `ebpo "
                  f"distance`, `--memory {url_queries.BUDGET}`).")


def viewer_table(page, found):
    page.text("## Viewer", "",
              "Headless Chromium with software rendering, 5 Mbit/s and 100 ms; `samples/serve.sh` "
              "serves page and model (`node tests/bench/remote/viewed.mjs`). Each page is newly "
              "opened with an empty cache. *first*: time to the first picture; *settled*: time to "
              "the last request; *click*: from a settled page to the exact distance; *close*: from "
              f"a settled page to a settled view from {url_queries.VIEW_FROM} diagonals away.")
    page.table(["step", "s", "model: requests", "bytes", "page: requests", "bytes"],
               [[step, *map(figure, (part["seconds"], *part["model"], *part["page"]))]
                for step, part in (found.row(AFTER, "viewer") or {}).items()])


def local_table(page, found):
    page.text("## Local file", "",
              f"`ebpo bench --memory {url_queries.BUDGET} --query QUERY`: the first "
              "result from a cold file (`--points path --count 1 --seed 1..5`), a path (`--points path "
              "--count 200000 --prefetch`), and uniform points (`--points uniform --count 1000`).")
    table = []
    for query, runs in (found.row(AFTER, "local") or {}).items():
        path, cold = runs["path"], runs["first"]
        table.append([query, middle([1e3 * r["cold_first_result_seconds"] for r in cold]),
                      middle([r["cold_reads"] for r in cold]),
                      middle([r["cold_bytes_read"] for r in cold]),
                      figure(path["ns"]["mean"] / 1e3), figure(path["ns"]["p999"] / 1e3),
                      figure(path["model"]["loads"]), figure(path["model"]["bytes_read"]),
                      figure(runs["uniform"]["ns"]["mean"] / 1e6)])
    page.table(["query", "first result, ms", "reads", "bytes", "path: mean us", "p99.9 us",
                "loads", "bytes", "uniform: mean ms"], table)


def driver_tables(page, found):
    page.text("## HDF5's own readers", "",
              "h5wasm 0.8 with its zstd plugin; HDF5's ros3 driver through Debian's h5py with our plugin. "
              "Whole files: `ebpo fetch`, all datasets by ros3 and h5wasm; the npm package "
              "reads levels and mesh, no maps. Only the command reads files above 100 MB whole.")
    page.table(["file", "bytes", "reader", "levels 0 to 4: requests", "bytes",
                "levels 0 to 5: requests", "bytes", "whole: requests", "bytes", "MB a request"],
               [[name, f"{size:,}", reader,
                 *("-" if n is None else f"{n:,}" for n in counts),
                 figure(counts[5] / counts[4] / 1e6) if counts[4] else "-"]
                for name, size, reader, *counts in found.found.get("drivers/requests", [])])
    page.text("ms until level 0, and levels 0 to 5, of the large file are decoded (medians of 3). "
              "For the C command the second value includes the start of the process; the others "
              "exclude it and the loading of their code.")
    page.table(["round trip, ms", "reader", "level 0", "levels 0 to 5"],
               [[latency, reader, f"{first:,.0f}", f"{last:,.0f}"]
                for latency, reader, first, last in found.found.get("drivers/latency", [])])


def made(results, command, nginx):
    page, found = Page(), Found(results)
    load = results.get("load", {}).values()
    page.text("# Remote files", "", *summary(found))
    goal_table(page, found)
    page.text("## Measurement", "",
              f"Made by `{command}`; {nginx}, all on one machine: {measured.machine()}; load "
              f"average {figure(statistics.median(load))} (median), {figure(max(load))} (maximum). "
              "Requests and bytes are exact; compare times roughly.", "",
              "Large model: `ebpo-generate --base lucy100k.ply --subdivide 4 lucy28.ply` "
              "(25,592,320 faces). Small model: `ebpo-generate --base igea.ply --subdivide 2 "
              "igea4.ply` (4,298,976 faces).")
    query_table(page, found)
    viewer_table(page, found)
    local_table(page, found)
    if found.found.get("drivers/latency"):
        driver_tables(page, found)
    return "\n".join(page.lines).rstrip() + "\n"
