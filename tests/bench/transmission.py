#!/usr/bin/env python3
"""Remakes docs/measured/transmission.md: bytes to fetch for a level, compared with the compressed PLY.

    /usr/bin/python3 tests/bench/transmission.py BUILD_DIR MODEL.ply... -o
    docs/measured/transmission.md

Needs h5py and the zstd command. No result depends on the machine.
"""
import argparse
import json
import pathlib
import subprocess
import tempfile

import h5py
import numpy

from query_page import reflow

GOALS = [10, 3, 1]  # percent of excess
BLACK = 1


def run(*arguments, data=None):
    return subprocess.run([str(a) for a in arguments], input=data, check=True,
                          stdout=subprocess.PIPE).stdout


def polyhedra(group):
    """Return the vertices of each node's envelope, as arrays."""
    stream, points, at, found = group["cells"][...].tolist(), group["points"][...], 0, []
    while at < len(stream):
        count, at, corners = stream[at + 1], at + 2, set()
        for _ in range(count):
            corners.update(stream[at + 1:at + 1 + stream[at]])
            at += 1 + stream[at]
        found.append(points[sorted(corners)])
    return found


def farthest(tool, file, group, size):
    """Return the greatest distance of a vertex of the level's envelopes from the solid, in percent of `size`."""
    corners = numpy.concatenate([shape for kind, shape in zip(group["type"][...], polyhedra(group))
                                 if kind != BLACK]).astype("<f8")
    results = numpy.frombuffer(run(tool, "distance", "--raw", file, data=corners.tobytes()),
                               "<f8").reshape(-1, 8)
    return 100 * max(results[:, 0].max(), 0) / size


def study(tool, model, folder, leaf_planes):
    file = folder / (model.stem + ".ebpo.h5")
    # the same tree for a reader without the mesh
    bare = folder / (model.stem + ".bare.ebpo.h5")
    extra = ["--profile", "full"] if leaf_planes else []
    run(tool, "convert", "-q", *extra, model, file)
    run(tool, "convert", "-q", "--parts", "envelopes,leaf-planes" if leaf_planes else "-mesh", model, bare)
    info = json.loads(run(tool, "info", "--json", file))
    levels = json.loads(run(tool, "levels", "--json", file))["levels"]
    derived = [v["derived_volume"]
               for v in json.loads(run(tool, "measure", "--json", "--derived", file))["levels"]]
    fetched = json.loads(run(tool, "levels", "--json", bare))["levels"]
    assert all(a[k] == b[k] for a, b in zip(levels, fetched)
               for k in ("gray", "leaf", "white", "black", "planes"))
    solid = info["report"]["volume"]
    size = numpy.linalg.norm(info["box_size"])
    rows = [{"level": v["level"], "bytes": v["cumulative_bytes"],
             "excess": 100 * (b["volume"] - solid) / solid, "derived": 100 * (d - solid) / solid}
            for v, b, d in zip(levels, fetched, derived)]
    last = next((r["level"] for r in rows if r["excess"] <= min(GOALS)), rows[-1]["level"])
    run(tool, "export", "-q", "--levels", f"0-{last}", bare, folder / "x.xdmf")
    with h5py.File(folder / "x.xdmf.h5", "r") as shapes:
        for r in rows[:last + 1]:
            r["seen"] = farthest(tool, file, shapes[f"level_{r['level']:02d}"], size)
    packed = len(run("zstd", "-19", "-q", "-c", model))
    return {"name": model.stem, "leaf_planes": leaf_planes, "info": info, "rows": rows,
            "last": last, "ply": model.stat().st_size, "packed": packed}


def table(*rows):
    lines = ["| " + " | ".join(str(c) for c in row) + " |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]]) + "\n"


def goal_table(models):
    rows = [["model", "faces", "PLY, zstd -19", "file", *(f"excess ≤ {g} %" for g in GOALS)]]
    for m in models:
        row = [m["name"] + (", leaf planes" if m["leaf_planes"] else ""), f"{m['info']['faces']:,}",
               f"{m['packed']:,}", f"{m['info']['bytes']['file']:,}"]
        for r in firsts(m):
            row.append(f"{r['bytes']:,} ({100 * r['bytes'] / m['packed']:.1f} %, level {r['level']})"
                       if r else "-")
        rows.append(row)
    return table(*rows)


def firsts(m):
    """Returns the first level within each goal, or None."""
    return [next((r for r in m["rows"] if r["excess"] <= goal), None) for goal in GOALS]


def level_cells(m, i):
    if i >= len(m["rows"]):
        return [""] * 3
    r = m["rows"][i]
    return [f"{r['bytes']:,}", f"{r['excess']:.2f}", f"{r['seen']:.3f}" if "seen" in r else ""]


def level_table(plain, planes):
    columns = ["bytes", "excess, %", "vertex distance, %"]
    rows = [["level", *columns, *(f"leaf planes: {c}" if c == "bytes" else c for c in columns)]]
    rows += [[i, *level_cells(plain, i), *level_cells(planes, i)]
             for i in range(len(plain["rows"]))]
    sizes = [f"{m['info']['bytes']['file']:,}" for m in (plain, planes)]
    rows.append(["file", sizes[0], "", "", sizes[1], "", ""])
    return f"**{plain['name']}**\n\n" + table(*rows)


def result(models):
    """Returns the result of the page."""
    shares = [[100 * f["bytes"] / m["packed"] for m in models if (f := firsts(m)[i])]
              for i in range(len(GOALS))]
    whole = [100 * m["info"]["bytes"]["file"] / m["packed"] for m in models]
    reached = sum(firsts(m)[-1] is not None for m in models)
    return (f"- {min(shares[0]):.1f} to {max(shares[0]):.1f} % of the bytes of the compressed PLY give "
            f"envelopes with an excess volume of at most {GOALS[0]} %.\n"
            f"- {reached} of {len(models)} files reach an excess of {GOALS[-1]} % without the mesh; leaf "
            f"planes (`convert --profile full`) help.\n"
            f"- The whole file takes {min(whole):.1f} to {max(whole):.1f} % of the bytes of the "
            "compressed PLY.")


HEAD = """# Bytes to fetch for a level

{RESULT}

The page compares the bytes of the levels of a file with the binary PLY of the model, compressed by `zstd -19`. Made by
`tests/bench/transmission.py BUILD_DIR bunny_closed.ply armadillo.ply igea.ply -o docs/measured/transmission.md`; the
results do not depend on the machine.

- *Bytes*: all bytes of the file up to the end of the level, header included (`ebpo levels`).
- *Excess*: volume of the envelopes minus volume of the solid, in percent of the solid.
- *Vertex distance*: maximum distance of an envelope vertex from the solid (`ebpo distance`), in percent of the box
  diagonal. The one-sided Hausdorff distance is at least this value.

The values are for a reader without the mesh, for which the envelope of a leaf is the parent's envelope, cut to the
leaf's cell. *Leaf planes* are stored with `convert --profile full`; with the mesh, `ebpo measure --derived` derives
tighter ones. The vertex distance can stay constant, because a leaf with a concave surface is not refined.

## First level within an excess

The table has the bytes, their share of the compressed PLY, and the level.
"""

LEVELS = """## By level

*file*: the whole file with the mesh, its source order and checksums. Vertex distances end at the level that reaches the
last goal. [theses.md](theses.md) compares the bytes with those of the BP-Octree, by one cost model.
"""


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("models", nargs="+", type=pathlib.Path)
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        models = [study(arguments.build / "tools" / "ebpo", model, pathlib.Path(folder),
                        leaf_planes) for model in arguments.models for leaf_planes in (False, True)]
    parts = [HEAD.replace("{RESULT}", result(models)), goal_table(models), LEVELS,
             *(level_table(*pair) for pair in zip(models[::2], models[1::2]))]
    arguments.output.write_text(reflow("\n".join(parts)), encoding="utf-8")


main()
