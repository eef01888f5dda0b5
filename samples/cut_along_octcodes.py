#!/usr/bin/env python3
"""Cuts a closed mesh along the cells of an octree level into parts that are asked as the whole is.

    PYTHONPATH=/usr/local/lib/ebpo/python samples/cut_along_octcodes.py WHOLE FOLDER [LEVEL]

WHOLE: an .ebpo.h5 file, or a folder with vertices.npy (v, 3) of float32 or float64 and faces.npy (f, 3) of
integers, which may be larger than memory and have more than 2^32 faces. FOLDER gets for each cell with faces
(LEVEL 1: 8 of them, 2: 64; 1 if not given) files named by its octcode, and catalogue.json:

    O.closed.ebpo.h5      its faces and caps: a closed mesh, for winding numbers
    O.surface.ebpo.h5     its faces alone, for distances and rays
    O.numbers.npy         their numbers in the whole

Each cell is cut in two by its middle planes, first of x, then of y and z. A face is of the side that the mean
of its corners is on; none is divided. Where the sides hang together, there is a chain of edges in each: it is
filled by caps, triangles of vertices that are there, which one side gets as they are and the other one turned
around. What both add to a winding number is 0 together, whatever the caps' shape.
docs/guide/clusters.md says what stays exact.
"""
import pathlib
import sys
import tempfile

import numpy as np

import ebpo
from ebpo.catalogue import Catalogue, Entry

STRETCH = 1 << 20  # faces that are in memory at a time
CAP = -1  # instead of a face's number
NO_EDGES = np.empty((0, 3), np.int64)


def open_edges(faces, others=NO_EDGES):
    """Rows (low, high, times) of the edges whose directions do not cancel, with those of before."""
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    low, high = directed.min(axis=1), directed.max(axis=1)
    times = np.where(directed[:, 0] < directed[:, 1], 1, -1)
    times[low == high] = 0
    low, high, times = (np.concatenate(pair) for pair in zip((low, high, times), others.T))
    if not len(low):
        return NO_EDGES
    order = np.lexsort((high, low))
    low, high, times = low[order], high[order], times[order]
    begins = np.flatnonzero(np.append(True, (np.diff(low) != 0) | (np.diff(high) != 0)))
    times = np.add.reduceat(times, begins)
    return np.stack([low[begins], high[begins], times], axis=1)[times != 0]


def cycles(edges):
    """Closed chains of vertices, each of which a chain has once, of rows (low, high, times)."""
    edges_from = {}
    for low, high, times in edges.tolist():
        begin, end = (low, high) if times > 0 else (high, low)
        edges_from.setdefault(begin, []).extend([end] * abs(times))
    for begin in list(edges_from):
        path, place = [begin], {begin: 0}
        while edges_from.get(path[-1]):
            at = edges_from[path[-1]].pop()
            if at not in place:
                place[at] = len(path)
                path.append(at)
                continue
            yield np.array(path[place[at]:])
            for left in path[place[at] + 1:]:
                del place[left]
            del path[place[at] + 1:]
        if len(path) > 1:
            sys.exit("cut_along_octcodes.py: the mesh is not closed")


def filled(chain):
    """Triangles (k - 2, 3) whose edges are the chain's, but for those that cancel. Every second vertex is
    cut off, again and again: no vertex gets many."""
    made = []
    while len(chain) > 2:
        made.append(np.stack([np.roll(chain, -i)[0:len(chain) - 1:2] for i in range(3)], axis=1))
        chain = chain[::2]
    return np.concatenate(made or [np.empty((0, 3), np.int64)])


class Pieces:
    """Faces and their numbers in two files that grow at the end."""

    def __init__(self, folder):
        self.folder, self.count = pathlib.Path(tempfile.mkdtemp(dir=folder)), 0
        self.files = [open(self.folder / name, "w+b") for name in ("faces", "numbers")]

    def add(self, faces, numbers):
        for file, rows in zip(self.files, (faces, numbers)):
            np.ascontiguousarray(rows, np.int64).tofile(file)
        self.count += len(faces)

    def stretches(self):
        for file in self.files:
            file.flush()
        for at in range(0, self.count, STRETCH):
            rows = min(STRETCH, self.count - at)
            yield (np.fromfile(self.folder / "faces", np.int64, 3 * rows, offset=24 * at).reshape(-1, 3),
                   np.fromfile(self.folder / "numbers", np.int64, rows, offset=8 * at))

    def whole(self):
        pairs = list(self.stretches())
        return [np.concatenate(arrays) for arrays in zip(*pairs)]

    def drop(self):
        for file in self.files:
            file.close()
            pathlib.Path(file.name).unlink()
        self.folder.rmdir()


def halve(pieces, vertices, axis, middle, folder):
    """Two Pieces: the faces below the middle and those above, with caps."""
    sides, edges = (Pieces(folder), Pieces(folder)), NO_EDGES
    for faces, numbers in pieces.stretches():
        corners = np.asarray(vertices[faces.ravel(), axis], np.float64).reshape(-1, 3)
        above = corners.sum(axis=1) >= 3 * middle
        edges = open_edges(faces[~above], edges)
        for side, these in zip(sides, (~above, above)):
            side.add(faces[these], numbers[these])
    for chain in cycles(edges * [1, 1, -1]):  # caps go the other way
        cap = filled(chain)
        sides[0].add(cap, np.full(len(cap), CAP))
        sides[1].add(cap[:, ::-1], np.full(len(cap), CAP))
    return sides


def write(mesh, vertices, path):
    used, local = np.unique(mesh, return_inverse=True)
    return ebpo.convert((np.array(vertices[used]), local.reshape(-1, 3)), path).info


def write_part(pieces, vertices, code, folder):
    """The files of a cell; its Entry."""
    faces, numbers = pieces.whole()
    real = numbers != CAP
    paths = [folder / f"{code:o}.{end}" for end in ("closed.ebpo.h5", "surface.ebpo.h5", "numbers.npy")]
    closed = write(faces, vertices, paths[0])
    if not closed.solid:
        sys.exit("cut_along_octcodes.py: the mesh is not closed")
    print(f"{code:o}: {real.sum()} faces, {(~real).sum()} caps", flush=True)
    corners = vertices[np.unique(faces)].astype(np.float64)
    entry = Entry(str(paths[0]), closed.content_sha256, True, tuple(corners.min(axis=0).tolist()),
                  tuple(corners.max(axis=0).tolist()), surface=None)
    if not real.any():  # caps alone: nothing that can be seen
        return entry
    surface = write(faces[real], vertices, paths[1])
    np.save(paths[2], numbers[real])
    return entry._replace(surface=str(paths[1]), surface_sha256=surface.content_sha256, numbers=str(paths[2]))


def cut(pieces, vertices, box, code, levels, folder, scratch):
    """Entries of all cells of the level with faces, in the order of octcodes. `pieces` goes."""
    if pieces.count == 0 or levels == 0:
        entries = [write_part(pieces, vertices, code, folder)] if pieces.count else []
        pieces.drop()
        return entries
    middle = (box[0] + box[1]) / 2
    octants = [pieces]
    for axis in (2, 1, 0):  # of the octant's number, x is the lowest bit
        halves = []
        for piece in octants:
            halves += halve(piece, vertices, axis, middle[axis], scratch)
            piece.drop()
        octants = halves
    entries = []
    for octant, piece in enumerate(octants):
        upper = (octant >> np.arange(3) & 1).astype(bool)
        cell = np.array([np.where(upper, middle, box[0]), np.where(upper, box[1], middle)])
        entries += cut(piece, vertices, cell, code * 8 + octant, levels - 1, folder, scratch)
    return entries


def read_whole(name):
    """Vertices, faces (both perhaps on the disk), the root cell, and the rule of what is inside."""
    if pathlib.Path(name).is_dir():
        vertices, faces = (np.load(pathlib.Path(name) / f"{what}.npy", mmap_mode="r") for what in ("vertices", "faces"))
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for at in range(0, len(vertices), STRETCH):
            low = np.minimum(low, vertices[at:at + STRETCH].min(axis=0))
            high = np.maximum(high, vertices[at:at + STRETCH].max(axis=0))
        return vertices, faces, np.array([low, high], np.float64), "nonzero"
    model = ebpo.open(name)
    mesh = model.mesh(order="source" if "maps" in model.info.parts else "file")
    return mesh.vertices, mesh.faces, model.info.box, model.info.rule.name.lower()


def main():
    if len(sys.argv) not in (3, 4) or not (sys.argv[3:] or ["1"])[0].isdecimal():
        sys.exit("usage: cut_along_octcodes.py WHOLE FOLDER [LEVEL]")
    folder, level = pathlib.Path(sys.argv[2]).absolute(), int((sys.argv[3:] or ["1"])[0])
    try:
        vertices, faces, box, rule = read_whole(sys.argv[1])
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            pieces = Pieces(scratch)
            for at in range(0, len(faces), STRETCH):
                some = faces[at:at + STRETCH]
                pieces.add(some, np.arange(at, at + len(some)))
            entries = cut(pieces, vertices, box, 1, level, folder, scratch)
        Catalogue(entries, parts=True, rule=rule).save(folder / "catalogue.json")
    except (ebpo.Error, OSError) as error:
        sys.exit(f"cut_along_octcodes.py: {error}")
    print(f"{len(entries)} parts of {len(faces)} faces in {folder}")


if __name__ == "__main__":
    main()
