"""docs/measured/remote.md from what was measured."""
import statistics

import asked
import measured
from query_page import Page, figure

BEFORE, MIXED, AFTER = "before", "old file", "after"
SIDES = (BEFORE, MIXED, AFTER)


def middle(values):
    """Median, and the largest where there are several."""
    if not values:
        return "-"
    return figure(statistics.median(values)) + (f" / {figure(max(values))}"
                                                if len(values) > 1 else "")


class Found:
    """What was measured, by side, row and what of it."""
    def __init__(self, found):
        self.found = found

    def row(self, side, name):
        return self.found.get(f"{side}/{name}")

    def values(self, side, name, what):
        row = self.row(side, name)
        return row and row.get(what)

    def rows(self):
        """Names of the questions by URL, in order, with words and command."""
        seen = {}
        for name, row in self.found.items():
            if isinstance(row, dict) and "command" in row:
                seen.setdefault(name.split("/", 1)[1], row)
        return seen

    def beyond(self, side, what):
        """Of levels 6 to 8: what levels 0 to 8 take more than levels 0 to 5."""
        both = [self.values(side, name, what) for name in ("levels 8", "levels 5")]
        return both[0] and both[1] and [both[0][0] - both[1][0]]

    def local(self, side, what):
        row = self.row(side, "local")
        if not row:
            return None
        if what == "first":
            return [1e3 * r["cold_first_answer_seconds"] for q in row.values() for r in q["first"]]
        return [q["path"]["ns"]["p999"] / 1e6 for q in row.values()]

    def viewer(self, side, step, what):
        row = self.row(side, "viewer")
        if not row:
            return None
        return [row[step]["seconds"] if what == "seconds" else row[step]["model"][1]]

    def ratio(self, what):
        if what == "size":
            sizes = [self.row(side, "size") for side in (BEFORE, AFTER)]
            return all(sizes) and [sizes[1]["large"] / sizes[0]["large"]]
        rounds = self.found.get("build")
        return rounds and [after / before for before, after in rounds]


# --- the goals ---

def goals():
    """(what is measured, how it is got for a side, the most it should be)"""
    for query in "distance", "inside":
        for what, most in (("waves", 4), ("requests", 20), ("bytes", 0.7e6), ("seconds", 0.8)):
            yield (f"one {query}: {what}",
                   lambda f, s, a=(f"{query} one", what): f.values(s, *a), most)
        for what, most in (("waves", 5), ("requests", 500), ("bytes", 20e6), ("seconds", 3)):
            yield (f"100 near points, {query}: {what}",
                   lambda f, s, a=(f"{query} 100", what): f.values(s, *a), most)
    yield "`fetch --box`: waves", lambda f, s: f.values(s, "box", "waves"), 5
    yield "`fetch --box`: bytes", lambda f, s: f.values(s, "box", "bytes"), 1.5e6
    yield "close-up, nodes: requests", lambda f, s: f.values(s, "view", "requests"), 20
    yield "close-up, nodes: bytes", lambda f, s: f.values(s, "view", "bytes"), 1e6
    yield "levels 0 to 5: requests", lambda f, s: f.values(s, "levels 5", "requests"), 1
    yield "levels 6 to 8: requests", lambda f, s: f.beyond(s, "requests"), 3
    yield "levels 6 to 8: bytes", lambda f, s: f.beyond(s, "bytes"), 2.1e6
    yield "viewer, first picture: s", lambda f, s: f.viewer(s, "first", "seconds"), 2
    yield "viewer, a click's distance: s", lambda f, s: f.viewer(s, "click", "seconds"), 1.5
    yield "viewer, close-up: bytes", lambda f, s: f.viewer(s, "close", "bytes"), 4e6
    yield "local, first answer cold: ms", lambda f, s: f.local(s, "first"), 20
    yield "local, p99.9 of a path at once: ms", lambda f, s: f.local(s, "path"), 1
    for what, words, most in (("size", "file", 1.02), ("build", "build time", 1.05)):
        yield f"{words}, of before", lambda f, s, w=what: f.ratio(w) if s == AFTER else None, most


def goal_table(page, found):
    page.text("## Goals", "",
              "Of several: median / largest; the goal is for the median. Large model, cold: each "
              "is a new process that has cached nothing. *Old file*: this build and the file that "
              "the build before wrote.")
    rows = []
    for what, get, most in goals():
        values = [get(found, side) for side in SIDES]
        after = values[2]
        rows.append([what, *map(middle, values), f"at most {figure(most)}",
                     "-" if not after else
                     "yes" if statistics.median(after) <= most else "no"])
    page.table(["what", *SIDES, "goal", "met"], rows)


# --- what was measured ---

def question_tables(page, found):
    page.text("## Questions by URL", "",
              "100 ms of round trip, and as much for each new connection. Requests and bytes (of "
              "bodies) from nginx's log. *Round trips*: of the command as it is, the batches that "
              "its requests come in: a request begins a new one if it was sent after an answer of "
              "the present one had come in whole. *Waves*: the same with "
              f"`--http-connections {asked.CONNECTIONS}`, where a request that is sent when a "
              "connection becomes free, all having been busy, had only waited for that: what "
              f"depends on what; the least of {asked.TRIES} tries, as a busy machine only adds to "
              "them. Times as the line before nginx has them.", "",
              f"*Near*: at most {asked.NEAR:g} diagonals from the surface, at places where random "
              "lines enter the model.")
    for name, row in found.rows().items():
        page.text(f"**{row['what']}**: `{row['command']}`")
        table = []
        for side in SIDES:
            if found.row(side, name):
                table.append([side, *(middle(found.values(side, name, what)) for what in
                                      ("waves", "round_trips", "requests", "bytes", "seconds"))])
        page.table(["", "waves", "round trips", "requests", "bytes", "s"], table)
    same = found.row(AFTER, "same")
    if same is not None:
        page.text("10,000 points around the same places, asked by URL and of the file on disk "
                  f"(`ebpo inside` and `ebpo distance`, `--memory {asked.BUDGET}`): the answers are "
                  f"{'the same' if same else 'NOT the same'}.")


def viewer_table(page, found):
    page.text("## The viewer", "",
              "Headless Chromium, rendering in software, 5 Mbit/s and 100 ms; page and model by "
              "`samples/serve.sh`; `node tests/bench/remote/viewed.mjs`. Each on a page just "
              "opened, nothing cached. *First picture*: since the address was called; *settled*: "
              "until nothing more is asked for; *click*: from a settled page until the exact "
              f"distance is there; *close-up*: the same until a view from {asked.VIEW_FROM} "
              "diagonals away is settled.")
    table = []
    for side in SIDES:
        row = found.row(side, "viewer")
        for step in row or []:
            part = row[step]
            table.append([side, step, *map(figure, (part["seconds"], *part["model"],
                                                    *part["page"]))])
    page.table(["", "step", "s", "model: requests", "bytes", "page: requests", "bytes"], table)


def local_table(page, found):
    page.text("## On this machine", "",
              f"`ebpo bench --memory {asked.BUDGET} --query QUERY --points path --count 1 --seed "
              "1..5` (the first answer, the file forgotten by the system before), `--points path "
              "--count 200000 --prefetch`, `--points uniform --count 1000`.")
    table = []
    for side in SIDES:
        for query, runs in (found.row(side, "local") or {}).items():
            path, cold = runs["path"], runs["first"]
            table.append([side, query, middle([1e3 * r["cold_first_answer_seconds"] for r in cold]),
                          middle([r["cold_reads"] for r in cold]),
                          middle([r["cold_bytes_read"] for r in cold]),
                          figure(path["ns"]["mean"] / 1e3), figure(path["ns"]["p999"] / 1e3),
                          figure(path["model"]["loads"]), figure(path["model"]["bytes_read"]),
                          figure(runs["uniform"]["ns"]["mean"] / 1e6)])
    page.table(["", "question", "first answer, ms", "reads", "bytes", "path: mean us", "p99.9 us",
                "loads", "bytes", "uniform: mean ms"], table)


def size_table(page, found):
    page.text("## Size and building", "",
              "Files as they are on the disk; CPU seconds of `ebpo convert -q --memory 4GiB` of the "
              "small model, two runs of each side in turns a row.")
    page.table(["", "large, bytes", "small, bytes"],
               [[side, f"{size['large']:,}", f"{size['small']:,}"]
                for side in (BEFORE, AFTER) if (size := found.row(side, "size"))])
    page.table(["before, CPU s", "after, CPU s", "after / before"],
               [[figure(a), figure(b), f"{b / a:.3f}"] for a, b in found.found.get("build", [])])


def driver_tables(page, found):
    page.text("## Beside HDF5's own ways", "",
              "The files of *after*. Whole files: `ebpo fetch`, all datasets by ros3 and h5wasm; "
              "the viewer's reader reads levels and mesh, no maps. Files above 100 MB are read "
              "whole by the command only.")
    page.table(["file", "bytes", "reader", "levels 0 to 4: requests", "bytes",
                "levels 0 to 5: requests", "bytes", "whole: requests", "bytes", "MB a request"],
               [[name, f"{size:,}", reader,
                 *("-" if n is None else f"{n:,}" for n in counts),
                 figure(counts[5] / counts[4] / 1e6) if counts[4] else "-"]
                for name, size, reader, *counts in found.found.get("drivers/requests", [])])
    page.text("Time with latency: ms until level 0, and levels 0 to 5, of the large file are "
              "decoded (medians of 3). The C command's second figure includes the start of the "
              "process, the others' do not include theirs, nor loading their code.")
    page.table(["round trip, ms", "reader", "level 0", "levels 0 to 5"],
               [[latency, reader, f"{first:,.0f}", f"{last:,.0f}"]
                for latency, reader, first, last in found.found.get("drivers/latency", [])])


def made(results, command, programs, note):
    page, found = Page(), Found(results)
    load = results.get("load", {}).values()
    page.text("# Files on web servers: measured", "",
              f"Made by `{command}`; {programs} with its zstd plugin, HDF5's ros3 driver through "
              f"Debian's h5py with our plugin, all on one machine: {measured.machine()}; its "
              f"load average meanwhile {figure(statistics.median(load))} (median), "
              f"{figure(max(load))} (most). Requests, bytes and waves are exact; times are to be "
              "compared within a row, and roughly: rows were measured in several runs (`--json`, "
              "`--only`).", "",
              "The large model: `ebpo-generate --base lucy100k.ply --subdivide 4 lucy28.ply` "
              "(25,592,320 faces), the small one: `ebpo-generate --base igea.ply --subdivide 2 "
              "igea4.ply` (4,298,976 faces).")
    if note:
        page.text(note)
    goal_table(page, found)
    question_tables(page, found)
    viewer_table(page, found)
    local_table(page, found)
    size_table(page, found)
    if found.found.get("drivers/latency"):
        driver_tables(page, found)
    return "\n".join(page.lines).rstrip() + "\n"
