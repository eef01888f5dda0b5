"""The sections of theses.py that compare with BP-Octree (Melero 2008), and the volumes of levels."""
from itertools import accumulate

import thesis_figures as theirs
from query_page import figure


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


def build_and_size(page, runs):
    page.text("## Build and size (BP tables 3.3 and 3.9)", "",
              "*Build*: from the checked mesh; here all cores, the fastest of three. *Size*: KB of 1,000 bytes; BP: "
              "`.bpn` and `.bpl`, without the mesh; ours: the whole file. *Of the PLY*: divided by a PLY with 12 B per vertex and "
              "13 B per face. BP prints 2.60 for the bunny; its sizes give 2.21.")
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
    page.text("## Volume by level (BP tables 4.1 and 4.3)", "",
              "Volume of the envelopes in percent of the solid, then planes; ours are those of gray nodes, as planes of leaves are "
              "derived from faces. *BP here*: k-medoids, N = 50 by criterion 1, nine levels, `report --unlimited --coalesce "
              "sum`. *In a file*: at most 255 planes a node and distinct faces.")
    for name, steps in (("bunny", ["bunny_bp"]), ("dragon", ["dragon_bp_1", "dragon100k_bp_1"])):
        step = next((s for s in steps if runs.result(s)), steps[0])
        count = len(theirs.BP_VOLUME[name])
        rows = [["BP, K = 1 %", *padded(percent(theirs.BP_VOLUME[name]), count)]]
        found, ours = runs.result(step), runs.result(name)
        if found:
            method = found["methods"][0]
            few = f" ({found['faces']:,} faces)" if step == "dragon100k_bp_1" else ""
            rows.append([f"BP here, K = 1 %{few}", *padded(percent(free_volume(found, method)), count)])
            if len(method["levels"]) > 3:
                rows.append(["in a file, K = 1 %", *padded(percent(file_volume(found, method)), count)])
        if ours:
            rows.append(["our default", *padded(percent(of_levels(ours)), count)])
            rows.append(["our default, leaves by faces", *padded(percent(by_faces(ours)), count)])
        rows.append(["planes, BP", *padded([f"{n:,}" for n in theirs.BP_PLANES[name]], count)])
        if found and not few:
            rows.append(["planes, BP here", *padded(
                [f"{n:,}" for n in all_planes(found["methods"][0]["unlimited"]["levels"])], count)])
        if ours:
            rows.append(["planes, our default", *padded([f"{l['planes']:,}" for l in ours["levels"]], count)])
        page.text(f"**{name}**")
        page.table(["", *(f"L{i}" for i in range(count))], rows)


def of_one_k(runs, name, k):
    """The planes of the root, the volumes of levels and the seconds of one K, each found here."""
    found = runs.result("bunny_bp" if (name, k) == ("bunny", "1") else f"{name}_bp_{k}")
    if not found:
        return None
    method = found["methods"][0]
    return (method["unlimited"]["levels"][0]["planes"], free_volume(found, method), method["unlimited"]["seconds"])


def choices_of_k(page, runs):
    rows = []
    for k in ("5", "1", "0.5", "0.1", "0.05", "0.01"):
        dragon, bunny = of_one_k(runs, "dragon", k), of_one_k(runs, "bunny", k)
        if not (dragon or bunny or k in theirs.BP_K_VOLUME):
            continue
        known = theirs.BP_K_VOLUME.get(k)
        row = [k, f"{theirs.BP_ROOT[k]:,}" if k in theirs.BP_ROOT else "-", f"{dragon[0]:,}" if dragon else "-"]
        for level in (0, 4):
            row += [f"{known[level]:.2f}" if known else "-", f"{dragon[1][level]:.2f}" if dragon else "-"]
        row += [f"{bunny[0]:,}", f"{bunny[1][0]:.2f}", f"{bunny[1][4]:.2f}"] if bunny else ["-"] * 3
        rows.append(row)
    page.text("## Choice of K (BP tables 3.4 to 3.8)", "",
              "Planes of the root, and volumes, by K in percent of the faces, without limits.")
    page.table(["K, %", "dragon, root: BP", "here", "L0: BP", "here", "L4: BP", "here",
                "bunny, root", "L0", "L4"], rows)
    dense, middle, sparse = (of_one_k(runs, "bunny", k) for k in ("1", "0.1", "0.05"))
    if dense and middle and sparse:
        faster = ", ".join(f"{a / b:.1f} ({name})" for name, (a, b) in theirs.BP_K_SECONDS.items())
        larger = ", ".join(f"{b / a:.2f} ({name})" for name, (a, b) in theirs.BP_K_ROOT_VOLUME.items())
        page.text(f"With K = 0.05 % instead of 1 %, BP builds faster by factors of {faster}; here {dense[2] / sparse[2]:.1f} "
                  f"(bunny). With 0.1 %, its volume of L0 grows by {larger}; here {middle[1][0] / dense[1][0]:.2f} (bunny).")


def leaf_counts(levels):
    return [l["leaf"] for l in levels]


def leaves(page, runs):
    found = runs.result("bunny_leaves")
    if not found:
        return
    nodes, entries = found["nodes"][4], found["entries"][4:6]  # of level 5: these lists begin with level 1
    page.text("## Number of leaves (BP table 3.1)", "",
              "Leaves of the bunny by level. BP's criterion 1 (algorithm 4) joins siblings while their lists have "
              "fewer than N = 50 faces together: a face in four of the lists counts four times. Ours makes a leaf "
              "of a node with at most `--leaf-faces` distinct faces. "
              f"On average, the {nodes:,} nodes with faces of level 5 have {entries[0] / nodes:.1f} distinct faces, and "
              f"the lists of their children {entries[1] / nodes:.1f} (`convert --leaf-faces 0 --max-level 5` and `6`, "
              f"`info`). So BP's rule divides {found['sum'][5]['gray']:,} of them, ours "
              f"(`--leaf-faces 49`) {found['distinct']['49'][5]['gray']:,}. Criterion 2 joins siblings while "
              "their mean is below AV = 20; BP's counts are those found here, one level lower.")
    rows = []
    for title, counts in (("BP, criterion 1", theirs.BP_LEAVES["sum"]),
                          ("criterion 1 here (`--coalesce sum`)", leaf_counts(found["sum"])),
                          ("fewer than 50 distinct faces (`--leaf-faces 49`)", leaf_counts(found["distinct"]["49"])),
                          ("at most 16 distinct faces, our default", leaf_counts(found["distinct"]["16"])),
                          ("BP, criterion 2", theirs.BP_LEAVES["mean"]),
                          ("criterion 2 here (`mean`)", leaf_counts(found["mean"]))):
        rows.append([title, *padded([f"{n:,}" for n in counts], 8)[2:], f"{sum(counts):,}"])
    page.table(["", *(f"L{i}" for i in range(2, 8)), "sum"], rows)


def reported(name):
    """BP's reported bytes, cumulative."""
    return list(accumulate(row[-1] for row in theirs.BP_SENT[name]))


def sent_here(runs, name):
    """Our cumulative bytes by BP's cost model; an empty list if the step was not run."""
    found = runs.result(f"{name}_sent")
    return [l["thesis_cumulative_bytes"] for l in found["methods"][0]["levels"]] if found else []


def sent_factors(runs, name):
    """BP's bytes divided by ours, both by BP's cost model."""
    return [a / b for a, b in zip(theirs.sent_by_model(name, True), sent_here(runs, name))]


def sending(page, runs):
    if not sent_here(runs, "bunny"):
        return
    off = [abs(a / b - 1) for a, b in zip(reported("dragon"), theirs.sent_by_model("dragon", True))]
    last = runs.result("bunny_sent")["methods"][0]["levels"][-1]
    page.text("## Bytes to send (BP tables 4.4 and 4.11)", "",
              "Cumulative bytes up to a level in BP's cost model, without compression; *by the model* from the counts "
              f"of BP's tables. BP's reported bytes of the dragon follow it within {100 * max(off):.0f} %. Those of the "
              "bunny do not: the row of level 5 has about the geometry of level 6, that of level 6 "
              "little of it. *Here*: by the same model, with leaves of 50 faces and stored leaf planes. At the bunny's level "
              f"{last['level']} ours has an excess volume of {last['excess']:.2f} %, BP's "
              f"{theirs.BP_VOLUME['bunny'][last['level']] - 100:.2f} %.")
    rows = []
    for i in range(10):
        row = [i]
        for name in ("bunny", "dragon"):
            columns = [theirs.sent_by_model(name, True), sent_here(runs, name)]
            if name == "bunny":
                columns = [reported(name), *columns]
            row += [f"{c[i]:,}" if i < len(c) else "-" for c in columns]
            factors = sent_factors(runs, name)
            row.append(f"{factors[i]:.1f}" if i < len(factors) else "-")
        rows.append(row)
    page.table(["level", "bunny: BP, reported", "BP by the model", "here", "BP / here",
                "dragon: BP by the model", "here", "BP / here"], rows)


def points_bp(page, runs):
    rows = []
    for name, step in (("bunny", "bunny"), ("dragon", "dragon")):
        ours, bp = runs.result(step), theirs.BP_MODELS[name]
        if ours:
            rate = 1e9 / ours["inside"]["batch_ns"]
            rows.append([name, f"{bp['tests'] / 1e6:.2f}", f"{rate / 1e6:.1f}",
                         figure(ours["inside"]["ns"]["mean"] / 1000), figure(ours["distance"]["ns"]["mean"] / 1000)])
    page.text("## Points, whole model in memory (BP table 5.1)", "",
              "Uniform points in the box: 10^7 in BP, 10^6 here (10^5 for distances), one thread. BP: 1 to 2 million "
              "distances per second by a bounded search (figures 5.6, 5.7).")
    page.table(["model", "BP, 10^6 tests/s", "ours, 10^6 tests/s", "ours, single call, us",
                "ours, exact distance, us"], rows)


