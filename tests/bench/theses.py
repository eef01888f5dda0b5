#!/usr/bin/env python3
"""Makes docs/measured/theses.md: the tables of both theses beside ours.

    theses.py BUILD_DIR MODELS_DIR WORK_DIR [-o docs/measured/theses.md] [--pictures docs/pictures]
              [--run STEP... | --no-run]

BUILD_DIR is a release build with -Dpeers=enabled (the step `collisions` runs crossing_ebpo).
Each step's result is kept in thesis_results beside the script, so the script continues where it stopped;
remove a result to run its step again. --list prints the steps. The page has the steps that were run, and
names the others."""
import argparse
import pathlib
import sys

import thesis_bp
import thesis_ebp
import thesis_figures as theirs
from query_page import Page, handwritten, reflow
from thesis_bp import above, free_volume, of_levels, sent_factors
from thesis_ebp import SELECTIONS, contact_times, pair_time, slower_cells
from thesis_plots import plot
from thesis_runs import MINUTES, PERCENTS, STEPS, Runs


def levels_of(names):
    """Joins names of levels: L5, L6, L7 are L5 to L7."""
    numbers, out = [int(n[1:]) for n in names], []
    for n in numbers:
        if n - 1 in numbers and n + 1 in numbers:
            continue
        out.append(f"L{n}")
    return " to ".join(out) if len(out) == 2 and len(numbers) > 2 else ", ".join(out)


def span(values):
    return f"{min(values):.1f} to {max(values):.{0 if max(values) >= 10 else 1}f}"


def advantages(runs):
    """What is better than in the theses, by how much."""
    bunny, dragon, large, memory = (runs.result(s) for s in ("bunny", "dragon", "large", "memory"))
    path, uniform, contact = (runs.result(s) for s in ("modes_path", "modes_uniform", "collisions"))
    out, lucy = [], theirs.EBP_LUCY
    if bunny and dragon and large:
        kb = [(theirs.BP_MODELS[m]["kb"][0] + theirs.BP_MODELS[m]["kb"][1]) * 1024 / r["bytes"]
              for m, r in (("bunny", bunny), ("dragon", dragon))]
        per_face = lucy["collisions"] / theirs.EBP_FACES["Lucy"] / (large["bytes"] / large["faces"])
        out.append(f"the whole file is {span(kb)} times smaller than BP's index, {per_face:.0f} times than EBP's files (per face)")
        out.append(f"build {theirs.BP_MODELS['dragon']['build'] / dragon['build']:.0f} (dragon, BP) and "
                   f"{lucy['build'] / large['build']:.1f} times (Lucy, EBP) as fast")
    if memory and path and uniform:
        factors = [[theirs.EBP_MODES[m][column] * 1000 / found[m]["ns"]["mean"] for m in theirs.EBP_MODES]
                   for column, found in ((1, path), (0, uniform))]
        out.append(f"loading {lucy['load'] / memory['open'][4]:.0f}, points out of core {span(factors[0])} (path) and "
                   f"{span(factors[1])} times (uniform)")
    if contact:
        out.append(f"a first contact {span([t[1] / contact_times(contact[o]['first'])[0] for _, t, o in theirs.EBP_FIRST])} times")
    sent = sent_factors(runs, "bunny") + sent_factors(runs, "dragon")
    if sent:
        out.append(f"{span(sent)} times fewer bytes to send")
    if dragon:
        better = [f"L{i}" for i, (a, b) in enumerate(zip(of_levels(dragon), theirs.BP_VOLUME["dragon"])) if a < b]
        fewer = [theirs.BP_PLANES["dragon"][i] / dragon["levels"][i]["planes"] for i in range(5)]
        out.append(f"less volume at the dragon's {levels_of(better)}, with {min(fewer):.0f} to {max(fewer):.0f} times fewer "
                   "planes")
    return out


def losses(runs):
    """What is not better than in the theses."""
    bunny, dragon, large = (runs.result(s) for s in ("bunny", "dragon", "large"))
    path, uniform, contact = (runs.result(s) for s in ("modes_path", "modes_uniform", "collisions"))
    out, known = [], theirs.BP_VOLUME
    if bunny and dragon and large:
        of_dragon, of_bunny = above(of_levels(dragon), known["dragon"]), above(of_levels(bunny), known["bunny"])
        of_lucy = above(of_levels(large), theirs.EBP_LUCY["volume"])
        dense = [l for l in above(of_levels(dragon), theirs.BP_K_VOLUME["5"]) if l not in of_dragon]
        out.append(f"volume at the dragon's {levels_of(of_dragon)}, the bunny's {levels_of(of_bunny)}, Lucy's "
                   f"{levels_of(of_lucy)}, for K = 5 % the dragon's {levels_of(dense)}")
        out.append(f"an exact distance: {span([d['distance']['ns']['mean'] / 1000 for d in (bunny, dragon)])} us in memory (BP, "
                   "bounded: 0.5 to 1)"
                   + (f", {path['distance']['ns']['mean'] / 1000:.0f} us (path) and "
                      f"{uniform['distance']['ns']['mean'] / 1e6:.0f} ms (uniform) out of core (EBP, not exact: 15, 878 us)"
                      if path and uniform else ""))
    out += [f"{title}: {levels_of(names)}" for title, names in slower_cells(runs).items() if names]
    if contact:
        steps = contact["lucy_lucy"]
        out.append(f"a pair of faces: {pair_time(steps['all']):.1f} us, with 256 MiB {pair_time(steps['budget']):.0f} "
                   "(EBP: 0.09)")
    return out + ["at most 255 planes a node (BP: 2,955)"]


def summary(runs):
    """The result, in the first ten lines: what is better, by how much, and what is not."""
    return [f"- *Better* (speeds: other machines): {'; '.join(advantages(runs))}.",
            f"- *Not better*: {'; '.join(losses(runs))}."]


def not_run(page, runs):
    missing = [name for name in STEPS if not runs.result(name)]
    seconds = sum(runs.result(name)["step_seconds"] for name in STEPS if runs.result(name))
    page.text("## Cost of the script", "",
              f"The {len(STEPS) - len(missing)} steps on this page took {seconds / 3600:.1f} hours on the busy machine, "
              "0.8 GB of disk without temporary files, and 4.0 GB of memory.")
    if missing:
        few = ", ".join(f"`{name}` ({MINUTES.get(name, 'unknown')})" for name in missing)
        page.text(f"Not run, with the expected minutes of one core: {few}.")


def plots(runs, folder):
    """Error against time, bytes and memory; returns the pictures' names."""
    made = []
    copy, ours, big, memory = (runs.result(s) for s in ("bunny_sent", "bunny", "large", "memory"))
    if copy and ours:
        excess = [v - 100 for v in theirs.BP_VOLUME["bunny"]]
        made.append(plot(folder / "theses-bytes.svg", "Bunny: error against bytes", "cumulative bytes",
                         "excess volume, %", [
                             ("BP, planes only, by its cost model",
                              list(zip(theirs.sent_by_model("bunny", False), excess))),
                             ("BP, planes and faces, same cost model",
                              list(zip(theirs.sent_by_model("bunny", True), excess))),
                             ("ours, planes and faces, same cost model",
                              [(l["thesis_cumulative_bytes"], l["excess"]) for l in copy["methods"][0]["levels"]]),
                             ("ours, stored, header included",
                              [(l["cumulative_bytes"], l["percent_of_solid"] - 100) for l in ours["levels"]])]))
    if big:
        lines = [(f"EBP, {s}, 10 to 50 %", [(t, theirs.EBP_VOLUME[s][4][i] - 100)
                                             for i, t in enumerate(theirs.EBP_BUILD[s])]) for s in SELECTIONS]
        for s in SELECTIONS:
            here = [(r["build"], r["levels"][4]["percent_of_solid"] - 100) for p in PERCENTS
                    if (r := runs.result(f"large_{s}_{p}"))]
            if here:
                lines.append((f"{s} here", here))
        lines.append(("EBP, Lucy, kmedoids, 30 and 40 %", theirs.EBP_LUCY_TIMES))
        lines.append(("our default, Lucy", [(big["build"], big["levels"][4]["percent_of_solid"] - 100)]))
        made.append(plot(folder / "theses-time.svg", "26 to 28 million faces: error of L4 against time",
                         "build, s", "excess volume, %", lines))
    small = runs.result("lucy_methods")
    if small:
        lines = [(f"{s}, 10 to 50 %", [(m["unlimited"]["seconds"], free_volume(small, m)[4] - 100)
                                       for p in PERCENTS for m in small["methods"] if m["name"] == f"{s}-{p}%"])
                 for s in SELECTIONS]
        lines.append(("our default", [(small["ours"]["build"], of_levels(small["ours"])[4] - 100)]))
        made.append(plot(folder / "theses-time-here.svg",
                         f"Lucy, {small['faces']:,} faces, here: error of L4 against time", "build, s",
                         "excess volume, %", lines))
    if big and memory:
        made.append(plot(folder / "theses-memory.svg", "Lucy, 26 to 28 million faces: error against memory",
                         "memory of the levels, MB", "excess volume, %", [
                             ("EBP, k-medoids 40 %", [(sum(theirs.EBP_LUCY["mb"][:i + 1]), v - 100)
                                                       for i, v in enumerate(theirs.EBP_LUCY["volume"])]),
                             ("our default", [(m / 1e6, l["percent_of_solid"] - 100)
                                              for m, l in zip(memory["bytes"], big["levels"])])]))
    return made


def write(runs, out, pictures):
    page = Page()
    tail = handwritten(out)
    page.text("# Compared with the theses", "", *summary(runs))
    page.text("## Settings", "",
              f"Made by `tests/bench/theses.py BUILD_DIR MODELS_DIR WORK_DIR -o docs/measured/theses.md` on "
              f"{' and '.join(sorted({r['machine'] for r in runs.results()}))}, with a load of "
              f"{max(r['load'] for r in runs.results()):.0f} at most. {'; '.join(theirs.MACHINES)}. "
              "Times of different machines are comparable in orders of magnitude only. "
              "The bunny has 69,666 faces (BP: 71,040); the dragon is BP's, with equal positions merged (`--weld`) so that it "
              "bounds a solid.")
    made = plots(runs, pathlib.Path(pictures))
    if made:
        page.text("\n".join(f"![{title}](../pictures/{name})" for name, title in made))
    for section in (thesis_bp.build_and_size, thesis_bp.volumes, thesis_bp.choices_of_k, thesis_bp.leaves,
                    thesis_bp.sending, thesis_bp.points_bp, thesis_ebp.large_build, thesis_ebp.selections,
                    thesis_ebp.queries, thesis_ebp.collisions):
        section(page, runs)
    not_run(page, runs)
    pathlib.Path(out).write_text(reflow("\n".join(page.lines)).rstrip("\n") + "\n" + tail)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("models", type=pathlib.Path)
    parser.add_argument("work", type=pathlib.Path)
    parser.add_argument("-o", dest="out", default="docs/measured/theses.md")
    parser.add_argument("--pictures", default="docs/pictures")
    parser.add_argument("--run", nargs="*", default=list(STEPS), choices=list(STEPS), metavar="STEP")
    parser.add_argument("--no-run", action="store_true")
    parser.add_argument("--list", action="store_true")
    options = parser.parse_args()
    runs = Runs(options.build, options.models, options.work)
    if options.list:
        for name, (what, _) in STEPS.items():
            print(f"{name:20} {'done' if runs.result(name) else '-':5} {what}")
        return
    for step in [] if options.no_run else options.run:
        if not runs.result(step):
            print(step, file=sys.stderr)
            runs.run_step(step)
    write(runs, options.out, options.pictures)


if __name__ == "__main__":
    main()
