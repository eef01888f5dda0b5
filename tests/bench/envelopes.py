#!/usr/bin/env python3
"""Makes docs/measured/envelopes.md: each selection of planes compared with the limit, by level.

    envelopes.py EBPO MODELS_DIR [-o docs/measured/envelopes.md] [MODEL...]
"""
import json
import pathlib
import subprocess
import sys
import tempfile

from query_page import reflow

arguments = sys.argv[1:]
out = None
if "-o" in arguments:
    at = arguments.index("-o")
    out = arguments[at + 1]
    del arguments[at:at + 2]
ebpo, models = arguments[0], pathlib.Path(arguments[1])
NAMES = (arguments[2:] or ["dragon100k", "bunny_closed", "armadillo", "fertility", "cheese_g133",
                           "cad_adis16480"])
# The models with a table by level.
BY_LEVEL = arguments[2:] or ["dragon100k", "bunny_closed", "cad_adis16480"]
WAYS = {"inherit": [], "kmedoids": ["--select", "kmedoids"],
        "offset": ["--select", "offset"], "random": ["--select", "random"]}
# As BP 2008: N = 50 by its criterion 1, any number of planes in a node.
BP = ["--select", "kmedoids", "--k-root", "1%", "--unlimited", "--coalesce", "sum", "--leaf-faces", 50,
      "--points", 1, "--no-pictures", "--levels", "0-0"]
VERDICT, SIZES, GOAL_ROWS = {}, {}, []


def run(*command):
    return subprocess.run([ebpo, *map(str, command)], check=True, capture_output=True,
                          text=True).stdout


def row(*cells):
    return "| " + " | ".join(str(c) for c in cells) + " |\n"


def bp_row(name, folder, limits, volume):
    method = json.loads(run("report", "-q", "--json", *BP, "-o", folder / "report",
                            models / f"{name}.ply"))["methods"][0]
    levels = method["unlimited"]["levels"]
    ratios = [f"{(x['envelope_volume'] - volume) / (l - volume):.3f}" if l > volume * (1 + 1e-9) else "-"
              for x, (l, _) in zip(levels, limits)]
    return row("BP, K = 1 %", *ratios, *["-"] * (len(limits) - len(ratios)),
               f"{sum(x['planes'] for x in levels):,}", "-")


def table(name, folder):
    ratios, limits = "", None
    for way, options in WAYS.items():
        path = folder / "model.ebpo.h5"
        run("convert", "-q", *options, "--leaf-faces", 0, "--profile", "full",
            models / f"{name}.ply", path)
        assert "no violation" in run("verify", path), name
        facts = json.loads(run("measure", "--json", *(["--hulls"] if limits is None else []), path))
        info = json.loads(run("info", "--json", path))
        if limits is None:
            limits = [(x["limit_volume"], x["excess_to_limit"]) for x in facts["levels"]]
            levels = range(len(limits))
            head = (row("", *(f"L{i}" for i in levels), "planes in gray nodes", "file bytes")
                    + row(*["---"] * (len(limits) + 3)))
        volume, excess = facts["volume"], [x["envelope_volume"] for x in facts["levels"]]
        if way == "inherit":
            VERDICT[name] = [(v - volume) / (l - volume) if l > volume * (1 + 1e-9) else 1
                             for v, (l, _) in zip(excess, limits)]
        SIZES.setdefault(name, {})[way] = sum(x["stored_bytes"] for x in info["levels"])
        ratios += row(way,
                      *(f"{(v - volume) / (l - volume):.3f}" if l > volume * (1 + 1e-9) else "-"
                        for v, (l, _) in zip(excess, limits)),
                      f"{sum(x['planes'] for x in info['levels']):,}", f"{path.stat().st_size:,}")
    ratios += bp_row(name, folder, limits, volume)
    ratios += row("limit, % of solid", *(f"{100 * l / volume:.2f}" for l, _ in limits), "", "")
    worst = {"levels 0 to 3": (max(VERDICT[name][:4]), 1.2),
             "levels 4 to 6": (max(VERDICT[name][4:7] or [0]), 1.5)}
    GOAL_ROWS.append(row(name,
                    *(f"{value:.3f} ({'met' if value <= target else 'missed'}, {target})"
                      for value, target in worst.values()),
                    f"{SIZES[name]['inherit'] / SIZES[name]['kmedoids']:.2f} "
                    f"({'met' if SIZES[name]['inherit'] < SIZES[name]['kmedoids'] else 'missed'}, "
                    f"below 1)"))
    return f"\n## {name}: {info['faces']:,} faces\n\n{head}{ratios}" if name in BY_LEVEL else ""


HEAD = """# Envelope volumes compared with the limit

{RESULT}

## Goals

The first two columns have the excess volume of `inherit`, the default, divided by that of the limit, the smallest
possible convex envelopes. The worst level counts. The last column has the bytes of all levels divided by those of
`kmedoids`.

{GOALS}
## Measurement

Made by `tests/bench/envelopes.py EBPO MODELS_DIR -o docs/measured/envelopes.md`; the results do not depend on the
machine.

The limit is the convex hull of the solid in each cell (`ebpo measure --hulls`, computed by qhull): no convex envelopes
of the same cells are smaller. `inherit` is the default selection of planes ([design](../develop/design.md)). The other
rows are the methods of the [theses](theses.md): k-medoids, offset and random selection with 40 % of the planes
(EBP-Octree), and the BP-Octree with K = 1 % and N = 50 (`report --unlimited --coalesce sum`).

The files are divided down to the deepest level (`--leaf-faces 0`) and store leaf planes. `ebpo verify` reports 0
violations. The leaves of `BP, K = 1 %` are larger than the cells of the limit.

The tables list by level the excess over the volume of the solid, divided by that of the limit. The row *limit* is the
volume of the limit in percent of the solid. With the names of models, the script makes their tables.
"""
tables = ""
with tempfile.TemporaryDirectory() as folder:
    for name in NAMES:
        tables += table(name, pathlib.Path(folder))
        print(name, file=sys.stderr)
upper, lower = (max(max(v[part] or [0]) for v in VERDICT.values())
                for part in (slice(0, 4), slice(4, 7)))
share = [sizes["inherit"] / sizes["kmedoids"] for sizes in SIZES.values()]
result = (f"- The excess volume (envelopes minus solid) of the default is at most {upper:.3f} times that of the smallest\n"
          f"  possible convex envelopes at levels 0 to 3, and at most {lower:.3f} times at levels 4 to 6.\n"
          f"- The default needs {min(share):.2f} to {max(share):.2f} times the level bytes of k-medoids at 40 %.\n"
          f"- {'All goals are met' if 'missed' not in ''.join(GOAL_ROWS) else 'Goals are missed'}.")
goals = row("", "levels 0 to 3", "levels 4 to 6", "bytes") + row(*["---"] * 4) + "".join(
    sorted(GOAL_ROWS, key=lambda line: "missed" not in line))
document = HEAD.replace("{RESULT}", result).replace("{GOALS}", goals) + tables
document = reflow(document)
if out:
    pathlib.Path(out).write_text(document)
else:
    print(document, end="")
