"""The sections of theses.py that compare with EBP-Octree (Aguilera 2017)."""
from itertools import accumulate
import statistics

import thesis_figures as theirs
from query_page import figure
from thesis_bp import free_volume, of_levels, padded, percent
from thesis_runs import CROSSING_STEPS, PERCENTS, SHOWN_LEVELS, SOME_POINTS

SELECTIONS = ("kmedoids", "offset", "random")
OURS = {"lucy_lucy": "Lucy 25.6 M, itself", "lucy_armadillo": "Lucy 25.6 M, armadillo 86 K",
        "lucy16_lucy16": "Lucy 1.6 M, itself", "armadillo_armadillo": "armadillo 346 K, itself",
        "lucy16_armadillo": "armadillo 346 K, Lucy 1.6 M"}


def ends(volumes):
    """The volumes of levels 0 and 4."""
    return f"{volumes[0]:.1f}, {volumes[4]:.1f}"


def large_build(page, runs):
    ours, lucy = runs.result("large"), theirs.EBP_LUCY
    if not ours:
        return
    page.text("## 28 million faces: build, size, load (EBP tables 2 to 4, 8 to 11, 15, 18, 19)", "",
              f"EBP: Lucy of {theirs.EBP_FACES['Lucy']:,} faces, k-medoids, 40 %. Ours: a Lucy of {ours['faces']:,} "
              "faces, grown from 99,970 (`ebpo-generate --base lucy100k.ply --subdivide 4`); `ebpo convert --memory 1GiB`. "
              "*Load*: EBP's root levels; here from a cold file to the first exact result, with the same cut level.")
    memory = runs.result("memory")
    rows = [["build, s", figure(lucy["build"]), figure(ours["build"])],
            ["processor time of the command, s", "-", figure(ours["cpu"])],
            ["PLY, MB", figure(lucy["ply"] / 1e6), figure(ours["ply"] / 1e6)],
            ["files without data for drawing, MB; divided by PLY",
             f"{figure(lucy['collisions'] / 1e6)}; {lucy['collisions'] / lucy['ply']:.2f}",
             f"{figure(ours['bytes'] / 1e6)}; {ours['bytes'] / ours['ply']:.3f}"],
            ["bytes per face", figure(lucy["collisions"] / theirs.EBP_FACES["Lucy"]),
             figure(ours["bytes"] / ours["faces"])]]
    if memory:
        rows += [["load, s", figure(lucy["load"]), figure(memory["open"][4])],
                 ["memory of the levels to the cut, MB", figure(lucy["root_mb"]), figure(memory["bytes"][4] / 1e6)]]
    built = [runs.result(f"large_{select}_40") for select in SELECTIONS]
    if all(built):
        rows.append([f"build by {', '.join(SELECTIONS)}, 40 %, s (Amazona)", ", ".join(figure(theirs.EBP_BUILD[s][3]) for s in SELECTIONS),
                     ", ".join(f"{b['build']:.0f}" for b in built)])
        rows.append(["L4 of these, %", ", ".join(f"{theirs.EBP_VOLUME[s][4][3]:.1f}" for s in SELECTIONS),
                     ", ".join(f"{of_levels(b)[4]:.1f}" for b in built)])
    page.table(["", "EBP", "ours"], rows)
    page.text("Volumes in percent of the solid (EBP table 20, its levels 1 to 11 are L0 to L10):")
    head = ["", *(f"L{i}" for i in range(11))]
    rows = [["EBP, Lucy, k-medoids 40 %", *percent(lucy["volume"])],
            ["our default, 25.6 M", *padded(percent(of_levels(ours)), 11)]]
    if found := runs.result("large_kmedoids_40"):
        rows.append(["k-medoids 40 % here", *padded(percent(of_levels(found)), 11)])
    if memory:
        rows.append(["MB to this level, EBP (table 16)", *(figure(x) for x in accumulate(lucy["mb"]))])
        rows.append(["MB to this level, ours", *padded([figure(x / 1e6) for x in memory["bytes"]], 11)])
    page.table(head, rows)


def selections(page, runs):
    found = runs.result("lucy_methods")
    if not found:
        return
    theirs_gb = [(theirs.EBP_OTHER_BYTES + a + b) / 1e9 for s in SELECTIONS
                 for a, b in zip(theirs.EBP_BPL[s], theirs.EBP_BVP[s])]
    ours_mb = [m["file_bytes"] / 1e6 for m in found["methods"]]
    page.text("## Three selections, 10 to 50 % (EBP tables 2 to 14)", "",
              f"EBP: Amazona of {theirs.EBP_FACES['Amazona']:,} faces. Here: Lucy of {found['faces']:,} faces, "
              "`report --unlimited --leaf-faces 0`: as in EBP, all leaves are on the deepest level. Compare the "
              "order of the rows, not their values. *s*: build of a file, which has at most 255 planes a node. L0, L4: volume in "
              "percent. EBP's files take "
              f"{min(theirs_gb):.1f} to {max(theirs_gb):.1f} GB, ours {min(ours_mb):.1f} to {max(ours_mb):.1f} MB, our default "
              f"{found['ours']['bytes'] / 1e6:.1f} MB.")
    rows = []
    byname = {m["name"]: m for m in found["methods"]}
    for select in SELECTIONS:
        for i, p in enumerate(PERCENTS):
            method = byname[f"{select}-{p}%"]
            free = free_volume(found, method)
            rows.append([f"{select} {p} %", figure(theirs.EBP_BUILD[select][i]),
                         ends([v[i] for v in theirs.EBP_VOLUME[select]]), figure(method["build_seconds"]), ends(free)])
    ours = found["ours"]
    rows.append(["our default", "-", "-", figure(ours["build"]), ends(of_levels(ours))])
    page.table(["", "EBP: s", "L0, L4", "here: s", "L0, L4"], rows)
    beats = [sum(a < b for a, b in zip(free_volume(found, byname[f"random-{p}%"])[:8],
                                       free_volume(found, byname[f"offset-{p}%"])[:8])) for p in PERCENTS]
    page.text(f"Random has less volume than offset in {', '.join(map(str, beats[:-1]))} and {beats[-1]} of 8 levels at 10 to "
              "50 %; in EBP in 8 of 8 at 40 %.")
    other = runs.result("lucy16_methods_40")
    if other:
        page.text(f"With {other['faces']:,} faces and 40 %:")
        page.table(["", "L0, L4", "planes at the root", "build, s"],
                   [[m["name"], ends(free_volume(other, m)), m["unlimited"]["levels"][0]["planes"],
                     figure(m["unlimited"]["seconds"])] for m in other["methods"]]
                   + [["our default", ends(of_levels(other["ours"])), other["ours"]["levels"][0]["planes"],
                       figure(other["ours"]["build"])]])


def slower_cells(runs):
    """The levels of EBP's tables, all of them, at which ours takes longer, by query and kind of points."""
    out = {}
    for points, column in (("uniform", 0), ("path", 1)):
        found = runs.result(f"levels_{points}")
        for query, table in (("inside", theirs.EBP_INSIDE_LEVELS), ("distance to envelopes", theirs.EBP_DISTANCE_LEVELS)):
            here = found[query.split()[0]] if found else []
            out[f"{query}, {points}"] = [f"L{i}" for i, (row, ns) in enumerate(zip(table, here))
                                         if row[column] and ns and ns / 1000 > row[column]]
    return out


def queries(page, runs):
    uniform, path = runs.result("modes_uniform"), runs.result("modes_path")
    if not path:
        return
    few = uniform or {}
    mean = lambda step, mode: step[mode]["ns"]["mean"] / 1000 if step else None
    page.text("## Points out of core (EBP tables 21 to 28)", "",
              "EBP: Lucy, 10^6 points, levels 1 to 5 in memory. Ours: Lucy of 25.6 million faces, the same levels in memory "
              "(L0 to L4, `--cut-level 4`), 32 MiB, 100,000 points, single calls, wall-clock us, loading included; "
              "files are in the page cache (EBP does not state it).")
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
    page.text("To a level: EBP's level k is our level k - 1, as its algorithm 7 starts with the root as level 1. Point in solid "
              f"with cache, and distance to the envelope (uniform: at most this processor time, from L5 on {SOME_POINTS:,} points):")
    rows = []
    for i in SHOWN_LEVELS:
        rows.append([f"L{i}", *(figure(d["inside"][i] / 1000 if d else None) for d in (deep, deep_path)),
                     *(figure(t) for t in theirs.EBP_INSIDE_LEVELS[i]),
                     *(figure(d["distance"][i] / 1000 if d else None) for d in (deep, deep_path)),
                     *(figure(t) for t in theirs.EBP_DISTANCE_LEVELS[i])])
    page.table(["", "inside: uniform", "path", "EBP", "EBP, path", "distance: uniform", "path", "EBP", "EBP, path"],
               rows)
    page.text("We omit EBP's 0 us for random points at the third level (table 27), which the mean of table 28 contains.")


def pair_time(steps):
    """Mean microseconds for a pair of faces."""
    return sum(us for us, *_ in steps) / max(1, sum(pairs for _, pairs, *_ in steps))


def contact_times(steps):
    """Mean and maximum microseconds of a step."""
    return statistics.mean(us for us, *_ in steps), max(us for us, *_ in steps)


def collisions(page, runs):
    found = runs.result("collisions")
    if not found:
        return
    page.text("## Collision (EBP tables 29 to 33)", "",
              f"One model moves along x through another (`crossing_ebpo`, {CROSSING_STEPS + 1} steps). Ours: one "
              "thread, processor time, in memory or with 256 MiB for each model.")
    rows = []
    for name, pairs, plain, optimised, ours in theirs.EBP_PAIRS:
        if ours:
            steps = found[ours]["all"]
            rows.append([name, f"{pairs:,.0f}", plain, optimised, OURS[ours], f"{statistics.mean(s[1] for s in steps):,.0f}",
                         figure(pair_time(steps)), figure(pair_time(found[ours]["budget"]))])
    page.table(["EBP: models", "pairs a step", "us a pair", "optimised", "ours: models", "pairs a step", "us a pair",
                "256 MiB"], rows)
    page.text("First contact, us:")
    page.table(["EBP: models", "EBP", "optimised", "PQP", "SWIFT++", "gProximity (GPU)", "ours: models", "mean", "worst"],
               [[name, *(figure(t) for t in times), OURS[ours], *(figure(t) for t in contact_times(found[ours]["first"]))]
                for name, times, ours in theirs.EBP_FIRST])
    gains = [a / b for _, _, a, b, _ in theirs.EBP_PAIRS]
    page.text("- *Not comparable*: pairs a step, of other models and poses, and time of a pair. EBP's 0.009 us are "
              "about 30 clock cycles, less than one test of two triangles takes. Its text says that the optimisation "
              f"gains about 10 %; its tables show a factor of {min(gains):.1f} to {max(gains):.1f}.",
              "- *Comparable in order of magnitude*: a first contact. EBP does not explain PQP's 26 s; FCL takes less "
              "than 0.1 ms ([collide](collide.md)).")
