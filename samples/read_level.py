#!/usr/bin/env python3
"""Reads one level with h5py and prints its gray nodes: octcode, cell, and the half-spaces that the
node adds to its parent's envelope.

    samples/read_level.py FILE.ebpo.h5 [LEVEL]

Each half-space contains the points p with  n . (p - corner) / size <= d, where the division is by axis.
Lines have the octcode and the numbers n (3), d and corner (3).
"""
import sys

import h5py
import numpy as np


def octcodes(file, level):
    """Returns the octcodes of all nodes of a level and their types. Descends level by level from the root:
    the i-th gray node has the i-th group of eight children."""
    codes = np.array([1], dtype=np.uint64)
    for at in range(level + 1):
        groups = file[f"/levels/{at:02d}/types"][:]
        types = (groups[:, None] >> (2 * np.arange(8))) & 3
        types = types[0, :1] if at == 0 else types.ravel()
        if at == level:
            return codes, types
        gray = codes[types == 3]
        codes = (gray[:, None] * np.uint64(8) + np.arange(8, dtype=np.uint64)).ravel()


def cells(codes, level, origin, size):
    """Returns the lowest corner of each cell, and the size of the cells."""
    at = np.zeros((len(codes), 3))
    for step in range(level):
        octant = (codes >> np.uint64(3 * (level - 1 - step))).astype(np.int64) & 7
        at = 2 * at + ((octant[:, None] >> np.arange(3)) & 1)
    return origin + at * (size / 2**level), size / 2**level


def half_spaces(codes):
    """Returns the normals (integers with 1-norm 511) and offsets of plane codes, in cell coordinates:
    n . xi <= d."""
    codes = codes.astype(np.int64)
    u, v, q = (codes & 1023) - 511, (codes >> 10 & 1023) - 511, codes >> 20
    w = 511 - abs(u) - abs(v)
    x = np.where(w >= 0, u, np.where(u < 0, -1, 1) * (511 - abs(v)))
    y = np.where(w >= 0, v, np.where(v < 0, -1, 1) * (511 - abs(u)))
    n = np.stack([x, y, w], axis=1)
    return n, np.minimum(n, 0).sum(axis=1) + 511 * (q + 1) / 4096


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: read_level.py FILE.ebpo.h5 [LEVEL]")
    name, level = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 1
    try:
        file = h5py.File(name, "r")
    except OSError as error:
        sys.exit(f"read_level.py: {name}: {error}")
    with file:
        if f"/levels/{level:02d}" not in file:
            sys.exit(f"read_level.py: {name} has no level {level}")
        codes, types = octcodes(file, level)
        gray = codes[types == 3]
        corner, size = cells(gray, level, file.attrs["box_origin"], file.attrs["box_size"])
        group = file[f"/levels/{level:02d}"]
        print(f"level {level}: {len(codes)} nodes, {len(gray)} gray, cell size {size}")
        if "planes" not in group:
            return
        counts = group["plane_counts"][:]
        n, d = half_spaces(group["planes"][:])
        for i, node in enumerate(np.repeat(np.arange(len(gray)), counts)):
            print(f"{int(gray[node]):o}", *n[i], f"{d[i]:.6f}", *corner[node])


try:
    main()
except BrokenPipeError:
    sys.exit(0)
except OSError as error:
    sys.exit(f"read_level.py: {error}; if HDF5 has no plugin for zstd, set HDF5_PLUGIN_PATH to the "
             "folder that `ebpo --version --verbose` prints, or convert with --codec deflate")
