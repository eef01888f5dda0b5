#!/usr/bin/env python3
"""Makes docs/measured/theses.md: the tables of both theses beside ours.

    theses.py BUILD_DIR MODELS_DIR WORK_DIR [-o docs/measured/theses.md] [--pictures docs/pictures]
              [--run STEP... | --no-run]

Each step's result is kept in WORK_DIR/results, so the script continues where it stopped; --list
prints the steps. The page has the steps that were run, and names the others."""
import argparse
from itertools import accumulate
import pathlib
import sys

import measured
import thesis_figures as theirs
from query_page import Page, figure, handwritten, reflow
from thesis_plots import plot
from thesis_runs import PERCENTS, SHOWN_LEVELS, STEPS, Runs

GB = 10**9
SELECTIONS = ("kmedoids", "offset", "random")


def percent(volumes):
    return [f"{v:.2f}" for v in volumes]


def padded(cells, count):
    return [*cells, *["-"] * (count - len(cells))][:count]


def free_volume(step, method):
    return [100 * l["envelope_volume"] / step["volume"] for l in method["unlimited"]["levels"]]


def file_volume(step, method):
    return [100 * l["envelope_volume"] / step["volume"] for l in method["levels"]]


def of_levels(step):
    return [l.get("percent_of_solid", l.get("percent_of_integral")) for l in step["levels"]]


def by_faces(step):
    """Volumes with planes of leaves that are derived from faces."""
    solid = step["levels"][0]["envelope_volume"] / of_levels(step)[0]
    return [l["derived_volume"] / solid for l in step["derived"]]


def above(volumes, known):
    return [f"L{i}" for i, (a, b) in enumerate(zip(volumes, known)) if a > b]


def all_planes(levels):
    return [l["planes"] + l["leaf_planes"] for l in levels]


# --- BP ---

def build_and_size(page, runs):
    page.text("## Build and size (BP tables 3.3 and 3.9)", "",
              "*Build*: from the checked mesh; here all cores, the fastest of three. *Size*: KB of 1,000 bytes. *Of the PLY*: bytes "
              "needed for queries, divided by the bytes of the PLY with 12 B per vertex and 13 B per face. BP: "
              "`.bpn` and `.bpl`, without the mesh. BP prints 2.60 for the bunny; its sizes give 2.21. Ours: the whole "
              "file, mesh included.")
    rows = []
    for name, thesis, step, as_bp in (("bunny", "bunny", "bunny", "bunny_bp"),
                                      ("dragon", "dragon", "dragon", "dragon_bp_1")):
        bp, ours, copy = theirs.BP_MODELS[thesis], runs.result(step), runs.result(as_bp)
        rows.append([name, f"{bp['faces']:,}", figure(bp["build"]), f"{1.024 * (bp['kb'][0] + bp['kb'][1]):,.0f} KB",
                     f"{(bp['kb'][0] + bp['kb'][1]) / bp['kb'][2]:.2f}"]
                    + ([f"{ours['faces']:,}", figure(ours["build"]), f"{ours['bytes'] / 1000:,.0f} KB",
                        f"{ours['bytes'] / (12 * ours['vertices'] + 13 * ours['faces']):.2f}"]
                       if ours else ["-"] * 4)
                    + [figure(copy["methods"][0]["unlimited"]["seconds"]) if copy else "not run"])
    page.table(["model", "BP: faces", "build, s", "size", "of the PLY", "ours: faces", "build, s", "size",
                "of the PLY", "BP's method here, s"], rows)


def volumes(page, runs):
    page.text("## Volume by level (BP tables 4.1, 4.3, 3.5 and 3.6)", "",
              "Volume of the envelopes in percent of the solid, then planes. *BP here*: k-medoids, N = 50 by "
              "criterion 1, nine levels, `report --unlimited --coalesce sum`: any number of planes in a node, "
              "and all candidates. *In a file*: the same with at most 255 planes a node and distinct faces.")
    for name, thesis, default, steps in (
            ("bunny", "bunny", "bunny", [("1", "bunny_bp")]),
            ("dragon", "dragon", "dragon", [(k, f"dragon_bp_{k}") for k in ("5", "1", "0.5", "0.1")])):
        count = len(theirs.BP_VOLUME[thesis])
        rows = []
        for k, step in steps:
            published = theirs.BP_VOLUME[thesis] if k == "1" else theirs.BP_K_VOLUME[k]
            found = runs.result(step)
            if found or k in ("1", "5"):
                rows.append([f"BP, K = {k} %", *padded(percent(published), count)])
            if not found:
                continue
            method = found["methods"][0]
            rows.append([f"BP here, K = {k} %", *padded(percent(free_volume(found, method)), count)])
            if len(method["levels"]) > 3:
                rows.append([f"in a file, K = {k} %", *padded(percent(file_volume(found, method)), count)])
        ours = runs.result(default)
        if ours:
            rows.append(["our default", *padded(percent(of_levels(ours)), count)])
            rows.append(["our default, leaves by faces", *padded(percent(by_faces(ours)), count)])
        rows.append(["planes, BP, K = 1 %", *padded([f"{n:,}" for n in theirs.BP_PLANES[thesis]], count)])
        found = next((r for k, step in steps if k == "1" and (r := runs.result(step))), None)
        if found:
            rows.append(["planes, BP here, K = 1 %", *padded(
                [f"{n:,}" for n in all_planes(found["methods"][0]["unlimited"]["levels"])], count)])
        if ours:
            rows.append(["planes, our default", *padded([f"{l['planes']:,}" for l in ours["levels"]], count)])
        page.text(f"**{name}**")
        page.table(["", *(f"L{i}" for i in range(count))], rows)
    page.text("Our default stores planes of gray nodes only; planes of leaves are derived from faces. Planes "
              "of BP's root (table 3.5): " + ", ".join(f"{n:,} (K = {k} %)" for k, n in theirs.BP_ROOT.items()) + ".")


def leaves(page, runs):
    found = runs.result("bunny_leaves")
    if not found:
        return
    page.text("## Number of leaves (BP table 3.1)", "",
              "Leaves of the bunny by level. BP's criterion 1 (algorithm 4) joins siblings while their lists have "
              "fewer than N = 50 faces together: a face in four of the lists counts four times. Ours makes a leaf "
              "of a node with at most N distinct faces, which gives fewer leaves. Criterion 2 joins siblings while "
              "their mean is below AV = 20; BP's counts are those found here, one level lower.")
    rows = []
    for title, counts in (("BP, criterion 1", theirs.BP_LEAVES["sum"]),
                          ("criterion 1 here (`--coalesce sum`)", [l["leaf"] for l in found["sum"]]),
                          ("N distinct faces (`distinct`)", [l["leaf"] for l in found["distinct"]]),
                          ("BP, criterion 2", theirs.BP_LEAVES["mean"]),
                          ("criterion 2 here (`mean`)", [l["leaf"] for l in found["mean"]])):
        rows.append([title, *padded([f"{n:,}" for n in counts], 8)[2:], f"{sum(counts):,}"])
    page.table(["", *(f"L{i}" for i in range(2, 8)), "sum"], rows)


def sending(page, runs):
    ours, copy = runs.result("bunny_sent"), runs.result("bunny")
    if not ours:
        return
    levels = ours["methods"][0]["levels"]
    planes, whole = theirs.sent_by_model("bunny", False), theirs.sent_by_model("bunny", True)
    reported, total = [], 0
    for row in theirs.BP_SENT["bunny"]:
        total += row[-1]
        reported.append(total)
    page.text("## Bytes to send (BP table 4.4, bunny)", "",
              "Cumulative bytes up to a level in BP's cost model, which has no compression. BP's reported bytes "
              "do not follow this model: the row of level 5 has about the geometry of level 6, that of level 6 "
              "little of it. The counts of table 4.4 give the two columns *by the model*. *Ours by the model*: "
              "with leaves of 50 faces and stored leaf planes. *Stored*: bytes of the levels in our default file, "
              "compressed, header included, without the mesh.")
    page.table(["level", "BP, reported", "BP by the model", "planes only", "ours by the model", "BP / ours",
                "stored"],
               [[i, f"{reported[i]:,}", f"{whole[i]:,}", f"{planes[i]:,}",
                 f"{levels[i]['thesis_cumulative_bytes']:,}" if i < len(levels) else "-",
                 f"{whole[i] / levels[i]['thesis_cumulative_bytes']:.1f}" if i < len(levels) else "-",
                 f"{copy['levels'][i]['cumulative_bytes']:,}" if copy and i < len(copy["levels"]) else "-"]
                for i in range(8)])


def points_bp(page, runs):
    rows = []
    for name, step in (("bunny", "bunny"), ("dragon", "dragon")):
        ours, bp = runs.result(step), theirs.BP_MODELS[name]
        if ours:
            rate = 1e9 / ours["inside"]["batch_ns"]
            rows.append([name, f"{bp['tests'] / 1e6:.2f}", f"{rate / 1e6:.1f}",
                         figure(ours["inside"]["ns"]["mean"] / 1000), figure(ours["distance"]["ns"]["mean"] / 1000)])
    page.text("## Points, whole model in memory (BP table 5.1)", "",
              "Uniform points in the box: 10^7 in BP, 10^6 here (10^5 for distances), one thread. BP prints 1 to 2 "
              "million distances per second in figures 5.6 and 5.7, by a bounded search.")
    page.table(["model", "BP, 10^6 tests/s", "ours, 10^6 tests/s", "ours, single call, us",
                "ours, exact distance, us"], rows)


# --- EBP ---

def large_build(page, runs):
    ours, lucy = runs.result("large"), theirs.EBP_LUCY
    if not ours:
        return
    page.text("## 28 million faces: build, size, load (EBP tables 2 to 4, 8 to 11, 15, 18, 19)", "",
              f"EBP: Lucy of {theirs.EBP_FACES['Lucy']:,} faces, k-medoids, 40 %. Ours: a Lucy of {ours['faces']:,} "
              "faces, grown from 99,970 (`ebpo-generate --base lucy100k.ply --subdivide 4`: each step makes four "
              "faces of one). `ebpo convert --memory 1GiB`. *Load*: EBP's root "
              "levels; here from a cold file to the first exact result, with a cut at the same level.")
    memory = runs.result("memory")
    rows = [["build, s", figure(lucy["build"]), figure(ours["build"])],
            ["processor time of the command, s", "-", figure(ours["cpu"])],
            ["peak memory of the build, MiB", "-", figure(ours["peak"] / 2**20)],
            ["PLY, 10^6 B", figure(lucy["ply"] / 1e6), figure(ours["ply"] / 1e6)],
            ["files for collisions, 10^6 B", figure(lucy["collisions"] / 1e6), figure(ours["bytes"] / 1e6)],
            ["the same / PLY", f"{lucy['collisions'] / lucy['ply']:.2f}", f"{ours['bytes'] / ours['ply']:.3f}"],
            ["files for collisions and drawing, 10^6 B", figure(lucy["rendering"] / 1e6),
             figure(ours["bytes"] / 1e6)],
            ["bytes per face", figure(lucy["collisions"] / theirs.EBP_FACES["Lucy"]),
             figure(ours["bytes"] / ours["faces"])]]
    if memory:
        rows += [["load, s", figure(lucy["load"]), figure(memory["open"][4])],
                 ["memory of the levels to the cut, MB", figure(lucy["root_mb"]), figure(memory["bytes"][4] / 1e6)]]
    for select in SELECTIONS:
        found = runs.result(f"large_{select}_40")
        rows.append([f"build by EBP's `{select}`, 40 %, s (Amazona)", figure(theirs.EBP_BUILD[select][3]),
                     f"{found['build']:,.0f}; CPU {found['cpu']:,.0f}" if found else "not run"])
    page.table(["", "EBP", "ours"], rows)
    page.text("Volumes in percent of the solid (EBP table 20, its levels 1 to 11 are L0 to L10):")
    head = ["", *(f"L{i}" for i in range(11))]
    rows = [["EBP, Lucy, k-medoids 40 %", *percent(lucy["volume"])],
            ["our default, 25.6 M", *padded(percent(of_levels(ours)), 11)]]
    for select in SELECTIONS:
        found = runs.result(f"large_{select}_40")
        if found:
            rows.append([f"`{select}` 40 % here", *padded(percent(of_levels(found)), 11)])
    if memory:
        rows.append(["MB to this level, EBP (table 16)", *(figure(x) for x in accumulate(lucy["mb"]))])
        rows.append(["MB to this level, ours", *padded([figure(x / 1e6) for x in memory["bytes"]], 11)])
    rows.append(["bytes to this level, ours", *padded([f"{l['cumulative_bytes']:,}" for l in ours["levels"]], 11)])
    page.table(head, rows)


def selections(page, runs):
    found = runs.result("lucy_methods")
    if not found:
        return
    page.text("## Three selections, 10 to 50 % (EBP tables 2 to 14)", "",
              f"EBP: Amazona of {theirs.EBP_FACES['Amazona']:,} faces. Here: Lucy of {found['faces']:,} faces, "
              "`report --unlimited --leaf-faces 0`: as in EBP, all leaves are on the deepest level. Compare the "
              "order of the rows, not their values. *Random* takes a run of planes in the node's order. *s* is the "
              "build of the file with at most 255 planes a node. Volumes in percent of the solid.")
    rows = []
    byname = {m["name"]: m for m in found["methods"]}
    for select in SELECTIONS:
        for i, p in enumerate(PERCENTS):
            method = byname[f"{select}-{p}%"]
            size = theirs.EBP_OTHER_BYTES + theirs.EBP_BPL[select][i] + theirs.EBP_BVP[select][i]
            free = free_volume(found, method)
            rows.append([f"{select} {p} %", figure(theirs.EBP_BUILD[select][i]), f"{size / GB:.1f}",
                         *(f"{v[i]:.1f}" for v in theirs.EBP_VOLUME[select][:5:4]),
                         figure(method["build_seconds"]), f"{method['file_bytes'] / 1e6:.2f}",
                         *(f"{v:.1f}" for v in free[:5:4])])
    ours = found["ours"]
    rows.append(["our default", *["-"] * 4, figure(ours["build"]), f"{ours['bytes'] / 1e6:.2f}",
                 *(f"{v:.1f}" for v in of_levels(ours)[:5:4])])
    page.table(["", "EBP: s", "GB", "L0", "L4", "here: s", "MB", "L0", "L4"], rows)
    beats = [sum(a < b for a, b in zip(free_volume(found, byname[f"random-{p}%"])[:8],
                                       free_volume(found, byname[f"offset-{p}%"])[:8])) for p in PERCENTS]
    page.text("Random has less volume than offset in " + ", ".join(
        f"{n} of 8 levels at {p} %" for n, p in zip(beats, PERCENTS))
        + ". In EBP it is 8 of 8 at 40 %.")
    other = runs.result("lucy16_methods_40")
    if other:
        page.text(f"With {other['faces']:,} faces and 40 %:")
        page.table(["", *(f"L{i}" for i in range(7)), "planes at the root", "build, s"],
                   [[m["name"], *padded(percent(free_volume(other, m)), 7), m["unlimited"]["levels"][0]["planes"],
                     figure(m["unlimited"]["seconds"])] for m in other["methods"]]
                   + [["our default", *padded(percent(of_levels(other["ours"])), 7),
                       other["ours"]["levels"][0]["planes"], figure(other["ours"]["build"])]])


def slower_cells(runs):
    """The levels of EBP's tables, all of them, at which ours takes longer."""
    out = []
    for points, column in (("uniform", 0), ("path", 1)):
        found = runs.result(f"levels_{points}")
        for query, table in (("inside", theirs.EBP_INSIDE_LEVELS), ("distance", theirs.EBP_DISTANCE_LEVELS)):
            out += [f"{query} {points} L{i}" for i, row in enumerate(table)
                    if found and row[column] and i < len(found[query])
                    and (found[query][i] or 0) / 1000 > row[column]]
    return out


def queries(page, runs):
    uniform, path = runs.result("modes_uniform"), runs.result("modes_path")
    if not path:
        return
    few = uniform or {}
    mean = lambda step, mode: step[mode]["ns"]["mean"] / 1000 if step else None
    page.text("## Points out of core (EBP tables 21 to 28)", "",
              f"EBP: Lucy, 10^6 points, levels 1 to 5 in memory. Ours: {runs.result('large')['faces']:,} faces, the "
              "same levels in memory (L0 to L4, `--cut-level 4`), 32 MiB, 100,000 uniform points and 100,000 of a path, "
              "single calls, wall-clock us, loading included. EBP does not state if files were cached; "
              "here they are in the page cache after the first query.")
    rows = [[f"`{mode}`", figure(mean(few, mode) if few else None), figure(mean(path, mode)),
             *(figure(t) for t in theirs.EBP_MODES[mode])] for mode in theirs.EBP_MODES]
    rows.append(["exact distance" + (f" ({few['distance']['count']:,} uniform points)" if few else ""),
                 figure(mean(few, "distance") if few else None), figure(mean(path, "distance")), "-", "-"])
    rows.append(["EBP's recursive distance (by its algorithm 11 not the minimum)", "-", "-",
                 *(figure(t) for t in theirs.EBP_RECURSIVE)])
    page.table(["", "ours: uniform", "path", "EBP: uniform", "path"], rows)
    deep, deep_path = runs.result("levels_uniform"), runs.result("levels_path")
    if not deep_path:
        return
    page.text("To a level, at equal depth: EBP's level k is our level k - 1 (its algorithm 7 starts with the root as "
              "level 1). Point in solid with cache, and distance to the envelope:")
    rows = []
    for i in SHOWN_LEVELS:
        rows.append([f"L{i}", *(figure(d["inside"][i] / 1000 if d else None) for d in (deep, deep_path)),
                     *(figure(t) for t in theirs.EBP_INSIDE_LEVELS[i]),
                     *(figure(d["distance"][i] / 1000 if d else None) for d in (deep, deep_path)),
                     *(figure(t) for t in theirs.EBP_DISTANCE_LEVELS[i])])
    page.table(["", "inside: uniform", "path", "EBP", "EBP, path", "distance: uniform", "path", "EBP", "EBP, path"],
               rows)
    slow = slower_cells(runs)
    page.text("Slower than EBP: " + (", ".join(slow) or "none") + ".")
    page.text("EBP prints 0 us for Lucy, random, third level (table 27), and the mean of table 28 contains it; we "
              "omit it.")


def collisions(page):
    page.text("## Collision (EBP tables 29 to 33)", "",
              "Ours, from [collide.md](collide.md), for a Lucy of 25.6 million faces through itself: "
              "44,646 pairs a step; 0.44 us a pair in memory and 33.4 us with 256 MiB; a first contact takes 19.3 us in "
              "memory (mean) and 130 us at most.")
    page.table(["EBP: scenario", "pairs a step", "us a pair", "optimised"],
               [[name, f"{pairs:,.0f}", a, b] for name, pairs, a, b in theirs.EBP_PAIRS])
    page.table(["EBP: first contact", "us", "PQP in EBP, us"], [[n, t, q] for n, t, q in theirs.EBP_FIRST])
    gains = [a / b for _, _, a, b in theirs.EBP_PAIRS]
    page.text("- *Not comparable*: microseconds a pair. EBP's 0.009 us are about 30 clock cycles, less than one "
              "intersection test of two triangles takes. EBP's text says that the optimisation gains about 10 %; its "
              "tables show a factor of {gains}.".format(gains=f"{min(gains):.1f} to {max(gains):.1f}"),
              "- *Not comparable*: pairs a step, as models and poses differ.",
              "- *Comparable in order of magnitude*: a first contact, with the models in memory. PQP's 26 s for a "
              "first contact is not the time of PQP's test alone: FCL takes less than 0.1 ms.")


def summary(runs):
    """The result: what is better, by how much, and what is not."""
    bunny, dragon, large = (runs.result(s) for s in ("bunny", "dragon", "large"))
    copy, memory, path = (runs.result(s) for s in ("bunny_bp", "memory", "modes_path"))
    sent, lucy = runs.result("bunny_sent"), theirs.EBP_LUCY
    lines, slow, few = [], slower_cells(runs), runs.result("modes_uniform")
    if dragon and bunny:
        known = theirs.BP_VOLUME
        better = [f"L{i}" for i, (a, b) in enumerate(zip(of_levels(dragon), known["dragon"])) if a < b]
        with_faces = above(by_faces(dragon), known["dragon"]) + above(by_faces(bunny), known["bunny"])
        lines.append("- *Not better*: volume of stored planes at the dragon's "
                     f"{', '.join(above(of_levels(dragon), known['dragon']))} and the bunny's "
                     f"{', '.join(above(of_levels(bunny), known['bunny']))} (with planes derived from faces: "
                     f"{', '.join(with_faces) or 'none'})"
                     + (f", Lucy's {', '.join(above(of_levels(large), lucy['volume']))}" if large else "")
                     + "; at most 255 planes a node in files (BP's root: 2,955); a pair of faces of two Lucys takes 76 "
                     "times as long under 256 MiB"
                     + (f"; an exact distance of a uniform point takes {few['distance']['ns']['mean'] / 1e6:.0f} ms at EBP's cut "
                        "level, EBP's recursive one 0.9 ms"
                        f"; along a path {path['distance']['ns']['mean'] / 1000:.0f} us against 15" if few and path else "")
                     + f"; an exact distance in memory takes {bunny['distance']['ns']['mean'] / 1000:.1f} and "
                     f"{dragon['distance']['ns']['mean'] / 1000:.0f} us, BP's bounded search 0.5 to 1 us"
                     + (f"; slower by level: {', '.join(slow)}" if slow else "") + ".")
        fewer = [theirs.BP_PLANES["dragon"][i] / dragon["levels"][i]["planes"] for i in (0, 4)]
        dense = [f"L{i}" for i, (a, b) in enumerate(zip(of_levels(dragon), theirs.BP_K_VOLUME["5"])) if a < b]
        lines.append(f"- *Better*, volume: {better[0]} to {better[-1]} of the dragon, with {fewer[0]:.0f} (L0) to "
                     f"{fewer[1]:.0f} (L4) times fewer planes than BP, K = 1 %; {dense[0]} to {dense[-1]} for K = 5 %.")
    if sent:
        mine = sent["methods"][0]["levels"]
        model = theirs.sent_by_model("bunny", True)
        factor = [model[i] / mine[i]["thesis_cumulative_bytes"] for i in range(len(mine))]
        lines.append(f"- Bytes to send by BP's cost model: {min(factor):.1f} to {max(factor):.0f} times fewer, at the last "
                     f"level {factor[-1]:.1f} (excess volume {mine[-1]['excess']:.2f} %, BP "
                     f"{theirs.BP_VOLUME['bunny'][len(mine) - 1] - 100:.2f} %).")
    if dragon and bunny:
        kb = [(theirs.BP_MODELS[m]["kb"][0] + theirs.BP_MODELS[m]["kb"][1]) * 1024 / r["bytes"]
              for m, r in (("bunny", bunny), ("dragon", dragon))]
        per_face = lucy["collisions"] / theirs.EBP_FACES["Lucy"]
        lines.append(f"- Size: BP's index without mesh is {min(kb):.1f} to {max(kb):.1f} times our whole file" + (
            f"; EBP's files are {per_face / (large['bytes'] / large['faces']):.0f} times ours per face" if large else "")
            + ".")
    if large and dragon:
        lines.append(f"- Build, other machine: {theirs.BP_MODELS['dragon']['build'] / dragon['build']:.0f} times faster "
                     f"(dragon, BP; here the fastest of three), {lucy['build'] / large['build']:.1f} times (Lucy, EBP).")
    if path:
        ratios = [theirs.EBP_MODES[m][1] * 1000 / path[m]["ns"]["mean"] for m in theirs.EBP_MODES]
        loose = [theirs.EBP_MODES[m][0] * 1000 / few[m]["ns"]["mean"] for m in theirs.EBP_MODES] if few else []
        lines.append(f"- Points out of core, other machine: {min(ratios):.1f} to {max(ratios):.0f} times faster along a path"
                     + (f", {min(loose):.1f} to {max(loose):.0f} times for uniform points" if loose else "")
                     + (f"; loading {lucy['load'] / memory['open'][4]:.0f} times" if memory else "") + ".")
    if copy:
        free = free_volume(copy, copy["methods"][0])
        worst = max(abs(a - b) / b for a, b in zip(free, theirs.BP_VOLUME["bunny"]))
        lines.append("- BP's method, run here without the limits of files, has the thesis' volumes (bunny) within "
                     f"{100 * worst:.1f} %.")
    return lines


def not_run(page, runs):
    missing = [name for name in STEPS if not runs.result(name)]
    seconds = sum(runs.result(name)["step_seconds"] for name in STEPS if runs.result(name))
    page.text("## Cost of the script, and rows that were not run", "",
              f"The {len(STEPS) - len(missing)} steps on this page took {seconds / 3600:.1f} hours on the busy machine, "
              "0.8 GB of disk and 0.8 GB of memory. Estimated for all steps: 15 hours, mainly 15 builds of 25.6 million "
              "faces, and 3 GB of disk. " + (
                  "Not run (`--list` describes them; run the script again): " + ", ".join(
                      f"`{n}`" for n in missing if not n.startswith("large_")) + (
                      f" and {len([n for n in missing if n.startswith('large_')])} steps `large_*` (EBP's selections on "
                      "25.6 million faces)." if any(n.startswith("large_") for n in missing) else ".")
                  if missing else "All steps were run."))


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
        made.append(plot(folder / "theses-time.svg", "Amazona and Lucy, 26 to 28 million faces: error of L4 against time",
                         "build, s", "excess volume, %", lines))
    small = runs.result("lucy_methods")
    if small:
        lines = [(f"{s}, 10 to 50 %", [(m["unlimited"]["seconds"], free_volume(small, m)[4] - 100)
                                       for p in PERCENTS for m in small["methods"] if m["name"] == f"{s}-{p}%"])
                 for s in SELECTIONS]
        lines.append(("our default", [(small["ours"]["build"], of_levels(small["ours"])[4] - 100)]))
        made.append(plot(folder / "theses-time-here.svg",
                         f"Lucy, {small['faces']:,} faces, one machine: error of L4 against build time", "build, s",
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
              f"{measured.machine()}. Machines of the theses: {'; '.join(theirs.MACHINES)}. Times of different "
              "machines are comparable in orders of magnitude only. Ours was busy, with a load "
              f"of {max((runs.result(s) or {'load': 0})['load'] for s in STEPS):.0f} at most. The bunny has "
              "69,666 faces (BP: 71,040); the dragon is BP's, 871,414 faces, with equal positions merged "
              "(`--weld`) so that it bounds a solid.")
    made = plots(runs, pathlib.Path(pictures))
    if made:
        page.text("\n".join(f"![{title}](../pictures/{name})" for name, title in made))
    for section in (build_and_size, volumes, leaves, sending, points_bp, large_build, selections, queries):
        section(page, runs)
    collisions(page)
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
