#!/usr/bin/env python3
"""Cuts a closed mesh along the cells of an octree level into parts. Queries of the parts give the results of
the whole mesh.

    PYTHONPATH=/usr/local/lib/ebpo/python samples/cut_along_octcodes.py WHOLE FOLDER [LEVEL]

WHOLE is an .ebpo.h5 file, or a folder with vertices.npy (v, 3) of float32 or float64 and faces.npy (f, 3) of
integers. The arrays may be larger than memory and have more than 2^32 faces. LEVEL 1 (the default) has 8
cells, level 2 has 64. The script writes catalogue.json and, for each cell with faces, files named by the
octcode O of the cell to FOLDER:

    O.closed.ebpo.h5      the cell's faces and caps: a closed mesh, for winding numbers
    O.surface.ebpo.h5     the cell's faces alone, for distances and rays
    O.numbers.npy         the numbers of these faces in the whole mesh

Each cell is cut by its middle planes, first across x, then across y and z. A face belongs to the side of the
mean of its corners; no face is divided. The open edges between the two sides form chains. Caps fill the
chains: triangles between vertices of the chain. One side gets the caps, the other side gets the reversed
caps. The two contributions to a winding number cancel for any shape of the caps. docs/guide/clusters.md
describes which results stay exact.
"""
import pathlib
import sys
import tempfile

import numpy as np

import ebpo
from ebpo.catalogue import Catalogue, Entry

STRETCH = 1 << 20  # number of faces in memory at a time
CAP = -1  # number of faces of caps
NO_EDGES = np.empty((0, 3), np.int64)


def open_edges(faces, others=NO_EDGES):
    """Returns rows (low, high, times) of the edges whose directions do not cancel. `others`: rows of earlier faces."""
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
    """Yields closed chains of vertices for rows (low, high, times). A chain contains each of its vertices once."""
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
    """Returns triangles (k - 2, 3) whose edges are those of the chain, except for edges that cancel. Every
    second vertex is cut off repeatedly, so that no vertex has many triangles."""
    made = []
    while len(chain) > 2:
        made.append(np.stack([np.roll(chain, -i)[0:len(chain) - 1:2] for i in range(3)], axis=1))
        chain = chain[::2]
    return np.concatenate(made or [np.empty((0, 3), np.int64)])


class Pieces:
    """Faces and their numbers in two files, to which data is appended."""

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
    """Returns two Pieces: the faces below the middle and those above, with caps."""
    sides, edges = (Pieces(folder), Pieces(folder)), NO_EDGES
    for faces, numbers in pieces.stretches():
        corners = np.asarray(vertices[faces.ravel(), axis], np.float64).reshape(-1, 3)
        above = corners.sum(axis=1) >= 3 * middle
        edges = open_edges(faces[~above], edges)
        for side, these in zip(sides, (~above, above)):
            side.add(faces[these], numbers[these])
    for chain in cycles(edges * [1, 1, -1]):  # caps have the opposite direction
        cap = filled(chain)
        sides[0].add(cap, np.full(len(cap), CAP))
        sides[1].add(cap[:, ::-1], np.full(len(cap), CAP))
    return sides


def write(mesh, vertices, path):
    used, local = np.unique(mesh, return_inverse=True)
    return ebpo.convert((np.array(vertices[used]), local.reshape(-1, 3)), path, overwrite=True).info


def write_part(pieces, vertices, code, folder):
    """Writes the files of a cell. Returns its Entry."""
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
    if not real.any():  # only caps: the cell has no surface
        return entry
    surface = write(faces[real], vertices, paths[1])
    np.save(paths[2], numbers[real])
    return entry._replace(surface=str(paths[1]), surface_sha256=surface.content_sha256, numbers=str(paths[2]))


def cut(pieces, vertices, box, code, levels, folder, scratch):
    """Returns the Entries of all cells of the level with faces, in the order of octcodes. Removes `pieces`."""
    if pieces.count == 0 or levels == 0:
        entries = [write_part(pieces, vertices, code, folder)] if pieces.count else []
        pieces.drop()
        return entries
    middle = (box[0] + box[1]) / 2
    octants = [pieces]
    for axis in (2, 1, 0):  # x is the lowest bit of the octant's number
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
    """Returns vertices and faces (which may be mapped files), the root cell, and the winding rule."""
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
