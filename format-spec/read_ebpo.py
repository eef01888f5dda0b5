#!/usr/bin/env python3
"""A second reader of .ebpo.h5 files, laid out like README.md: h5py and numpy only, none of the library's code.

    read_ebpo.py FILE [EXPECTED.json]

Prints the file as JSON (as vectors/passed/*.json), or compares with what is expected. Checks the content checksum.
"""
import hashlib
import json
import sys

import h5py
import numpy as np


def unzigzag(v):
    """0, 1, 2, 3 ... to 0, -1, 1, -2 ... (as signed integers of the same width)."""
    return ((v >> 1) ^ (0 - (v & 1))).astype(v.dtype.str.replace("u", "i"))


def in_chunks(dataset):
    """Pieces that start anew: the chunks."""
    rows = dataset.chunks[0]
    for row in range(0, dataset.shape[0], rows):
        yield dataset[row:row + rows]


def delta(dataset):
    """coding "delta" of vertices and maps: running sums within a chunk, wrapping."""
    return np.concatenate([np.cumsum(unzigzag(part), axis=0, dtype=unzigzag(part).dtype) for part in in_chunks(dataset)])


def vertices(dataset):
    ordered = delta(dataset)
    mask = np.iinfo(ordered.dtype).max
    bits = np.where(ordered < 0, ordered ^ mask, ordered)
    return bits.view("f4" if bits.itemsize == 4 else "f8")


def faces(dataset):
    """coding "high-water": 0 is the next vertex never seen before, k the k-th before that one."""
    codes = dataset[...].ravel().astype("i8")
    new = codes == 0
    seen = np.cumsum(new) - new
    return (seen - codes).astype("u4")


def leaf_first(level):
    """coding "delta" of leaf_skip: new faces of other levels' leaves in between."""
    skip, new = level["leaf_skip"][...].astype("u8"), level["leaf_new"][...].astype("u8")
    return np.cumsum(skip + new) - new


def leaf_refs(level, first):
    """coding "gap": from the leaf's first new face downwards; ascending here."""
    counts = level["leaf_ref_count"][...].astype("i8")
    if counts.sum() == 0:
        return None
    steps = level["leaf_refs"][...].astype("i8") + 1
    total = np.cumsum(steps)
    begin = np.cumsum(counts) - counts
    leaf = np.repeat(np.arange(len(counts)), counts)
    before = np.concatenate([[0], total])[begin]
    values = first.astype("i8")[leaf] - (total - before[leaf])
    order = np.lexsort((values, leaf))
    return values[order].astype("u4")


def content_sha256(file):
    """README.md, "Content checksum"."""
    names = []
    for group in ("levels", "mesh", "maps"):
        if group in file:
            file[group].visititems(lambda name, item, group=group:
                                   names.append(f"/{group}/{name}") if isinstance(item, h5py.Dataset) else None)
    total = hashlib.sha256()
    for name in sorted(names):
        total.update(name.encode() + b"\0" + hashlib.sha256(file[name][...].tobytes()).digest())
    return total.hexdigest()


def listed(values):
    if values is None:
        return None
    values = np.asarray(values)
    if values.size > 1000:
        return "sha256 " + hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()
    return values.ravel().tolist()


def text(value):
    return value.decode() if isinstance(value, bytes) else str(value)


def read_level(file, number, parts):
    level = file[f"/levels/{number:02d}"]

    def plain(name, dtype):
        return listed(level[name][...].astype(dtype)) if name in level else None

    out = {"level": number, "gray_volume": float(level.attrs["gray_volume"]), "leaf_volume": float(level.attrs["leaf_volume"])}
    out["types"] = plain("types", "u2")
    out["plane_counts"] = plain("plane_counts", "u1")
    out["planes"] = plain("planes", "u4")
    for name in ("leaf_winding", "black_winding", "white_winding"):
        out[name] = plain(name, "i4")
    first = leaf_first(level) if "leaf_skip" in level else None
    out["leaf_first"] = listed(first)
    out["leaf_new"] = plain("leaf_new", "u4")
    out["leaf_ref_count"] = plain("leaf_ref_count", "u4")
    out["leaf_refs"] = listed(leaf_refs(level, first)) if "leaf_refs" in level else None
    out["leaf_plane_counts"] = plain("leaf_plane_counts", "u1")
    out["leaf_planes"] = plain("leaf_planes", "u4")
    return out


def check_pruned(file, subset):
    """Subsets: an empty group for each pruned node, and on the last level all gray nodes pruned."""
    count = int(file.attrs["level_count"])
    levels = [file[f"/levels/{number:02d}"] for number in range(count)]
    for number, level in enumerate(levels):
        gray, pruned = int(level.attrs["gray"]), int(level.attrs.get("pruned", 0))
        empty = gray if number + 1 == count else int((levels[number + 1]["types"][...] == 0).sum())
        assert not subset or pruned == empty, f"level {number}: {pruned} pruned nodes, {empty} empty groups"
        assert subset or (pruned == 0 and (gray == 0) == (number + 1 == count)), f"level {number}: pruned nodes in a file that is no subset"


def read(path):
    with h5py.File(path, "r") as file:
        assert text(file.attrs["format"]) == "EBP-Octree in HDF5" and file.attrs["format_version_major"] == 1
        assert text(file.attrs.get("format_version", "")) != "1.0-draft"
        required = text(file.attrs["required_parts"]).split()
        unknown = set(required) - {"levels", "mesh", "planes", "maps", "leaf-planes", "pruned"}
        assert not unknown, f"needs {unknown}"
        parts = set(required + text(file.attrs["optional_parts"]).split())
        assert content_sha256(file) == text(file.attrs["content_sha256"]), "content_sha256 differs"
        check_pruned(file, "pruned" in parts)
        out = {name: text(file.attrs[name]) for name in ("kind", "winding_rule", "coordinate_type")}
        out["levels"] = [read_level(file, number, parts) for number in range(int(file.attrs["level_count"]))]
        mesh, maps = "mesh" in parts, "maps" in parts
        out["mesh"] = {
            "level": None,
            "vertices": listed(vertices(file["/mesh/vertices"])) if mesh else None,
            "faces": listed(faces(file["/mesh/faces"])) if mesh else None,
            "vertex_source": listed(delta(file["/maps/vertex_source"]).astype("u4")) if maps else None,
            "face_source": listed(delta(file["/maps/face_source"]).astype("u4")) if maps else None,
        }
        return out


def same(a, b, narrow):
    """Equal values; coordinates of float32 files are compared as float32."""
    if isinstance(a, dict):
        return isinstance(b, dict) and a.keys() == b.keys() and all(same(a[k], b[k], narrow) for k in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(same(x, y, narrow) for x, y in zip(a, b))
    if isinstance(a, float) and narrow:
        return np.float32(a) == np.float32(b)
    return a == b


if __name__ == "__main__":
    found = read(sys.argv[1])
    if len(sys.argv) == 2:
        json.dump(found, sys.stdout, indent=1)
        print()
    else:
        with open(sys.argv[2], encoding="utf-8") as expected:
            wanted = json.load(expected)
        if not same(found, wanted, found["coordinate_type"] == "float32"):
            sys.exit(f"{sys.argv[1]}: differs from {sys.argv[2]}")
