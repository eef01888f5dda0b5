#!/usr/bin/env python3
"""Remakes docs/measured/transmission.md: bytes to fetch until a level is good enough, against the
compressed PLY whole, and beside the BP-Octree thesis.

    /usr/bin/python3 tests/bench/transmission.py BUILD_DIR MODEL.ply... -o
    docs/measured/transmission.md

Needs h5py and the zstd command. No figure depends on the machine.
"""
import argparse
import itertools
import json
import pathlib
import struct
import subprocess
import tempfile

import h5py
import numpy

GOALS = [10, 3, 1]  # percent of excess
# Melero 2008, tables 4.4 and 4.6 ("Transm. at Level") and the volumes of figure 4.17 by level,
# percent.
THESIS = {
    "bunny_closed": ("bunny, 71,040 faces", [13035, 31384, 73558, 232372, 1006872, 3248614, 879022,
                                             516],
                     [171.41, 144.71, 119.92, 107.33, 103.11, 101.14, 100.55]),
    "armadillo": ("armadillo, 150,000 faces",
                  [24407, 53964, 103635, 229999, 488111, 1177844, 4433262, 5489803, 20324],
                  [388.73, 214.88, 139.57, 116.78, 107.99, 103.45, 101.57, 100.92]),
}
BLACK = 1


def run(*arguments, data=None):
    return subprocess.run([str(a) for a in arguments], input=data, check=True,
                          stdout=subprocess.PIPE).stdout


def polyhedra(group):
    """Vertices of each node's envelope, as arrays."""
    stream, points, at, found = group["cells"][...].tolist(), group["points"][...], 0, []
    while at < len(stream):
        count, at, corners = stream[at + 1], at + 2, set()
        for _ in range(count):
            corners.update(stream[at + 1:at + 1 + stream[at]])
            at += 1 + stream[at]
        found.append(points[sorted(corners)])
    return found


def cell_of(octcode, info):
    level = (octcode.bit_length() - 1) // 3
    at = [sum((octcode >> 3 * i + k & 1) << i for i in range(level)) for k in range(3)]
    size = [s / 2**level for s in info["box_size"]]
    low = [o + a * s for o, a, s in zip(info["box_origin"], at, size)]
    return low + [a + s for a, s in zip(low, size)], numpy.linalg.norm(size)


def touched(tool, file, boxes):
    """For each box whether a face meets it: exact."""
    answers, at, found = run(tool, "box", "--raw", file,
                             data=numpy.array(boxes, "<f8").tobytes()), 0, []
    for _ in boxes:
        count, = struct.unpack_from("<Q", answers, at)
        found.append(count > 0)
        at += 8 + 8 * count
    return found


def farthest(tool, file, group, info, size):
    """How far the level's envelopes reach from the solid, in percent of `size`: what is certain,
    and what their vertices show."""
    nodes = [(code, shape) for code, kind, shape in zip(group["octcode"][...].tolist(),
                                                        group["type"][...],
                                                        polyhedra(group)) if kind != BLACK]
    cells = [cell_of(code, info) for code, _ in nodes]
    certain = 0.0
    for (_, shape), (_, diagonal), meets in zip(nodes, cells, touched(tool, file, [box for box, _ in cells])):
        # A face that meets the cell has a point in the envelope, which is convex; else one comes as
        # near as 1/256 of the cell's size.
        difference = shape[:, None, :] - shape[None, :, :]
        certain = max(certain, numpy.sqrt((difference**2).sum(2).max()) if meets
                      else diagonal * (1 + 1 / 256))
    corners = numpy.concatenate([shape for _, shape in nodes]).astype("<f8")
    answers = numpy.frombuffer(run(tool, "distance", "--raw", file, data=corners.tobytes()),
                               "<f8").reshape(-1, 8)
    return 100 * certain / size, 100 * max(answers[:, 0].max(), 0) / size


def study(tool, model, folder, leaf_planes):
    file = folder / (model.stem + ".ebpo.h5")
    # the same tree, as a reader without the mesh has it
    bare = folder / (model.stem + ".bare.ebpo.h5")
    extra = ["--with", "leaf-planes"] if leaf_planes else []
    run(tool, "convert", "-q", *extra, model, file)
    run(tool, "convert", "-q", *extra, "--without", "mesh", model, bare)
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
            r["certain"], r["seen"] = farthest(tool, file, shapes[f"level_{r['level']:02d}"], info,
                                               size)
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
        for goal in GOALS:
            r = next((r for r in m["rows"] if r["excess"] <= goal), None)
            row.append(f"{r['bytes']:,} ({100 * r['bytes'] / m['packed']:.1f} % of the PLY's; "
                       f"level {r['level']}, {r['excess']:.2f} %; reaches {r['seen']:.2f} %, "
                       f"certainly at most {r['certain']:.1f} %)" if r else "not by a level")
        rows.append(row)
    return table(*rows)


def level_table(m):
    rows = [["level", "bytes so far", "% of PLY, zstd -19", "excess of volume, %",
             "leaves derived, %", "reaches, % of diagonal", "certainly at most, %"]]
    for r in m["rows"]:
        far = [f"{r['seen']:.3f}", f"{r['certain']:.2f}"] if "seen" in r else ["", ""]
        rows.append([r["level"], f"{r['bytes']:,}", f"{100 * r['bytes'] / m['packed']:.1f}",
                     f"{r['excess']:.2f}", f"{r['derived']:.2f}", *far])
    rows.append(["file", f"{m['info']['bytes']['file']:,}",
                 f"{100 * m['info']['bytes']['file'] / m['packed']:.1f}", "", "", "", ""])
    return (f"**{m['name']}{', with leaf planes' if m['leaf_planes'] else ''}**, "
            f"{m['info']['faces']:,} faces; PLY {m['ply']:,} bytes, with zstd -19 "
            f"{m['packed']:,}\n\n" + table(*rows))


def thesis_table(plain, planes):
    title, sent, volume = THESIS[plain["name"]]
    total = list(itertools.accumulate(sent))
    rows = [["level", f"BP-Octree ({title}): bytes so far", "excess, %",
             f"here ({plain['info']['faces']:,} faces): bytes so far", "excess, %",
             "with leaf planes: bytes so far",
             "excess, %"]]
    for i in range(max(len(total), len(plain["rows"]))):
        row = [i, f"{total[i]:,}" if i < len(total) else "",
               f"{volume[i] - 100:.2f}" if i < len(volume) else ""]
        for m in (plain, planes):
            row += [f"{m['rows'][i]['bytes']:,}",
                    f"{m['rows'][i]['excess']:.2f}"] if i < len(m["rows"]) else ["", ""]
        rows.append(row)
    whole = [f"{m['rows'][-1]['bytes'] + m['info']['bytes']['vertices'] + m['info']['bytes']['faces']:,}" for m in (plain, planes)]
    rows.append(["mesh", "in the levels above", "", whole[0], "", whole[1], ""])
    return table(*rows)


HEAD = """# Bytes to fetch for a level
Made by `tests/bench/transmission.py BUILD_DIR bunny_closed.ply armadillo.ply igea.ply
-o docs/measured/transmission.md`; no figure depends on the machine.

Until a level of detail is good enough, against fetching the model's binary PLY, compressed with
`zstd -19`, whole. Nothing is interpolated: the first level that reaches the goal counts, with
all bytes of the file up to its end, head included (`ebpo levels`).

- *Excess*: (volume of the level's envelopes - volume of the solid) / volume of the solid. The solid
is inside, always.
- *Reaches*: the largest distance from the solid of any vertex of the envelopes (`ebpo distance`,
exact), in percent of the box's diagonal. The one-sided Hausdorff distance from the envelopes to the
solid is at least
  this; a point between the vertices may be farther away.
- *Certainly at most*: a bound on that Hausdorff distance: the largest diameter of an envelope in
whose cell a face lies, which then lies in the envelope too, and the cell's diagonal and 1/256 for
envelopes
  of nodes that a face only comes near. The other way round the distance is 0: the envelopes contain
  the solid.

Where *reaches* stands still from level to level, it is that of a leaf whose convex hull spans a
hollow: a node with few faces is not refined, so deeper levels do not change it.
"""

LEVELS = """## By level
Excess, reach and bound are those of what has been fetched, without the mesh: a leaf has its
parent's envelope in its own cell, or with `convert --with leaf-planes` its own. *Leaves derived*:
the excess once the mesh
is there too, and leaves' planes are derived from their faces (where they are stored: those), as
`ebpo measure --derived` tells it. *File*: with the mesh, its order in the source, checksums.
Distances only down to the level that reaches the last goal.
"""

BESIDE = """## Beside the BP-Octree
Melero 2008, tables 4.4 and 4.6, summed up: what its levels would take to send by the model of
section 4.2, uncompressed, with the faces and vertices of each level's leaves in them. Models differ
in their number of
faces. Ours: bytes of the file, compressed, with the leaves' face numbers, but their faces and
vertices after the last level.
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
    parts = [HEAD, goal_table(models), LEVELS, *(level_table(m) for m in models)]
    beside = [thesis_table(plain, planes) for plain, planes in zip(models[::2], models[1::2])
              if plain["name"] in THESIS]
    parts += [BESIDE, *beside] if beside else []
    arguments.output.write_text("\n".join(parts), encoding="utf-8")


main()
