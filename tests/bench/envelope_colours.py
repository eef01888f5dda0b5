#!/usr/bin/env python3
"""envelope_colours.py FILE.ebpo.h5 [LEVEL.vtkhdf OUT.ply]: what colours of envelopes would cost in
a file with mesh and attributes, by the definition of docs/develop/envelope-colours.md, and how they
look: LEVEL.vtkhdf is what `ebpo export --level N` wrote of the file, OUT.ply has its polygons in
colours of their nodes, for `ebpo render`. With $NEW a leaf counts its new faces only, if it
has any.

Needs h5py, numpy, libzstd, and HDF5_PLUGIN_PATH with our filter."""
import ctypes
import ctypes.util
import os
import pathlib
import sys

import h5py
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "format-spec"))
import read_ebpo  # noqa: E402

WEIGHT_BITS = 32
LEAF, GRAY = 2, 3
zstd = ctypes.CDLL(ctypes.util.find_library("zstd"))
zstd.ZSTD_compressBound.restype = zstd.ZSTD_compress.restype = ctypes.c_size_t


def face_colours(file, faces):
    """[faces][3]: three times the colour, 0 to 765."""
    of, group = {}, file["attributes"]
    for i in range(int(read_ebpo.one(group.attrs["arrays"]))):
        array = group[f"{i:03d}"]
        if read_ebpo.text(array.attrs["names"]).split()[:3] == ["red", "green", "blue"]:
            values = read_ebpo.attribute_values(array, read_ebpo.text(array.attrs["type"]))
            of[read_ebpo.text(array.attrs["element"])] = np.asarray(values)[:, :3].astype("i8")
    vertex, face = of.get("vertex"), of.get("face")
    if face is not None and (vertex is None or (vertex == vertex[0]).all()):
        return 3 * face
    return vertex[faces].sum(axis=1)


def face_sums(file):
    """[faces][4]: weight times colour, and three times the weight."""
    at = read_ebpo.vertices(file["mesh/vertices"]).astype("f8").reshape(-1, 3)
    faces = read_ebpo.faces(file["mesh/faces"]).reshape(-1, 3)
    u, v = at[faces[:, 1]] - at[faces[:, 0]], at[faces[:, 2]] - at[faces[:, 0]]
    x = u[:, 1] * v[:, 2] - u[:, 2] * v[:, 1]
    y = u[:, 2] * v[:, 0] - u[:, 0] * v[:, 2]
    z = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    side = np.asarray(file.attrs["box_size"]).max()
    weight = (np.sqrt(x * x + y * y + z * z) / (side * side) * 2**WEIGHT_BITS).astype("i8") + 1
    return np.concatenate([weight[:, None] * face_colours(file, faces), 3 * weight[:, None]], 1)


def before(sums):
    return np.concatenate([np.zeros((1, 4), "i8"), np.cumsum(sums, axis=0)])


def rounded(sums):
    return (2 * sums[:, :3] + sums[:, 3:]) // np.maximum(2 * sums[:, 3:], 1)


def leaf_sums(level, sums, prefix):
    """Of a level's leaves: of their new faces, and of all that they list."""
    first = read_ebpo.leaf_first(level)
    new = level["leaf_new"][...].astype("i8")
    refs = read_ebpo.leaf_refs(level, first) if "leaf_refs" in level and len(level["leaf_refs"]) else []
    ends = np.concatenate([[0], np.cumsum(level["leaf_ref_count"][...].astype("i8"))])
    earlier = before(sums[np.asarray(refs, "i8")])
    own = prefix[first.astype("i8") + new] - prefix[first.astype("i8")]
    return own, own + earlier[ends[1:]] - earlier[ends[:-1]]


def tree(file):
    """Of each level octcodes and types of its nodes."""
    codes, kinds, gray = [], [], None
    for number in range(int(read_ebpo.one(file.attrs["level_count"]))):
        groups = file[f"levels/{number:02d}/types"][...]
        kind = groups & 3 if number == 0 else (groups[:, None] >> (2 * np.arange(8)) & 3).ravel()
        code = np.array([1]) if number == 0 else (gray[:, None] * 8 + np.arange(8)).ravel()
        gray = code[kind == GRAY]
        codes.append(code)
        kinds.append(kind)
    return codes, kinds


def colours(file, kinds):
    """Of each level the colours of its nodes, of white and black ones 0."""
    sums = face_sums(file)
    prefix, found, below, all_listed = before(sums), [], None, "NEW" not in os.environ
    for number in reversed(range(len(kinds))):
        kind, level = kinds[number], file[f"levels/{number:02d}"]
        total, shown = np.zeros((2, len(kind), 4), "i8")
        if (kind == LEAF).any():
            own, listed = leaf_sums(level, sums, prefix)
            total[kind == LEAF] = listed if all_listed else own
            shown[kind == LEAF] = np.where(own[:, 3:] > 0, own, listed) if not all_listed else listed
        if (kind == GRAY).any():
            groups = below[0].reshape(-1, 8, 4).sum(axis=1)
            total[kind == GRAY] = groups
            # without a new face below: of what its children show
            shown[kind == GRAY] = np.where(groups[:, 3:] > 0, groups, below[1].reshape(-1, 8, 4).sum(axis=1))
        below = total, shown
        found.insert(0, rounded(shown))
    return found


def packed(rows):
    """Bytes of three columns, each of differences to the row before unless $PLAIN, by zstd."""
    raw = (rows.astype("u1") if "PLAIN" in os.environ else
           np.diff(rows.astype("u1"), axis=0, prepend=np.zeros((1, 3), "u1"))).T.tobytes()
    capacity = zstd.ZSTD_compressBound(ctypes.c_size_t(len(raw)))
    out = ctypes.create_string_buffer(capacity)
    return zstd.ZSTD_compress(out, ctypes.c_size_t(capacity), raw, ctypes.c_size_t(len(raw)), 9) if raw else 0


def print_costs(file, kinds, found):
    print("| level | gray | leaf | types and planes, bytes | colours of gray nodes | of leaves |\n|---|---|---|---|---|---|")
    sums = [0] * 3
    for number, (kind, rows) in enumerate(zip(kinds, found)):
        level = file[f"levels/{number:02d}"]
        sizes = [sum(level[name].id.get_storage_size() for name in ("types", "planes", "plane_counts") if name in level),
                 packed(rows[kind == GRAY]), packed(rows[kind == LEAF])]
        sums = [a + b for a, b in zip(sums, sizes)]
        print("|", " | ".join(map(str, [number, (kind == GRAY).sum(), (kind == LEAF).sum(), *sizes])), "|")
    print("| all | | |", " | ".join(map(str, sums)), "|")


def paint(codes, found, level, out):
    data = h5py.File(level, "r")["VTKHDF"]
    points, corners, ends = data["Points"][...].astype("f4"), data["Connectivity"][...], data["Offsets"][...]
    wanted = data["CellData/octcode"][...]
    sizes, rgb = np.diff(ends)[:len(wanted)], np.zeros((len(wanted), 3), "u1")
    for code, rows in zip(codes, found):
        order = np.argsort(code)
        place = order[np.minimum(np.searchsorted(code, wanted, sorter=order), len(order) - 1)]
        hit = code[place] == wanted
        rgb[hit] = rows[place[hit]]
    rows, at = np.zeros(int((sizes - 2).sum()), dtype=[("n", "u1"), ("v", "<i4", 3), ("c", "u1", 3)]), 0
    rows["n"] = 3
    for size in np.unique(sizes):
        of = np.flatnonzero(sizes == size)
        for k in range(1, size - 1):
            part = rows[at:at + len(of)]
            for column, corner in enumerate((0, k, k + 1)):
                part["v"][:, column] = corners[ends[of] + corner]
            part["c"], at = rgb[of], at + len(of)
    header = "".join([f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n",
                      *(f"property float {name}\n" for name in "xyz"), f"element face {len(rows)}\n",
                      "property list uchar int vertex_indices\n",
                      *(f"property uchar {name}\n" for name in ("red", "green", "blue")), "end_header\n"])
    with open(out, "wb") as f:
        f.write(header.encode() + points.tobytes() + rows.tobytes())


with h5py.File(sys.argv[1], "r") as source:
    octcodes, node_kinds = tree(source)
    node_colours = colours(source, node_kinds)
    print_costs(source, node_kinds, node_colours)
if len(sys.argv) > 2:
    paint(octcodes, node_colours, *sys.argv[2:])
