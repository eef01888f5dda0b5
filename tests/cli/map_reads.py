#!/usr/bin/env python3
"""Reads the output of `ebpo map` with h5py and with separate code.

map_reads.py IMAGE.vtkhdf VOLUME.nrrd         prints the points, x y z, in the files' order
map_reads.py IMAGE.vtkhdf VOLUME.nrrd ASKED   prints "fine" if both files contain the distances in ASKED,
                                              the first number of each line
"""
import struct
import sys

import h5py


def image(path):
    with h5py.File(path) as f:
        group = f["VTKHDF"]
        assert bytes(group.attrs["Type"]) == b"ImageData" and list(group.attrs["Version"]) == [1, 0]
        extent, origin = list(group.attrs["WholeExtent"]), group.attrs["Origin"]
        spacing, direction = group.attrs["Spacing"], group.attrs["Direction"]
        values = group["PointData/distance"][...]
    counts = [extent[2 * i + 1] + 1 for i in range(3)]
    assert extent[::2] == [0, 0, 0] and list(values.shape) == counts[::-1], (extent, values.shape)
    steps = [[direction[3 * c + i] * spacing[i] for c in range(3)] for i in range(3)]
    return counts, list(origin), steps, list(values.ravel())


def volume(path):
    with open(path, "rb") as f:
        head, _, data = f.read().partition(b"\n\n")
    lines = head.decode().split("\n")
    assert lines[0] == "NRRD0004", lines[0]
    fields = dict(l.split(": ", 1) for l in lines[1:] if not l.startswith("#"))
    assert (fields["type"], fields["encoding"], fields["endian"]) == ("double", "raw", "little")

    def vectors(text):
        return [[float(x) for x in v.strip("()").split(",")] for v in text.split()]

    counts = [int(x) for x in fields["sizes"].split()]
    total = counts[0] * counts[1] * counts[2]
    assert len(data) == 8 * total, (len(data), counts)
    return (counts, vectors(fields["space origin"])[0], vectors(fields["space directions"]),
            list(struct.unpack(f"<{total}d", data)))


def points(counts, origin, steps):
    for k in range(counts[2]):
        for j in range(counts[1]):
            for i in range(counts[0]):
                yield [origin[c] + i * steps[0][c] + j * steps[1][c] + k * steps[2][c]
                       for c in range(3)]


def main():
    a, b = image(sys.argv[1]), volume(sys.argv[2])
    assert a[0] == b[0] and a[1] == b[1] and a[3] == b[3]
    assert all(abs(x - y) <= 1e-15 * max(map(abs, v)) for u, v in zip(a[2], b[2])
               for x, y in zip(u, v)), (a[2], b[2])
    if len(sys.argv) == 3:
        for p in points(*b[:3]):
            print(*map(repr, p))
        return
    with open(sys.argv[3], encoding="ascii") as f:
        requested = [float(line.split()[0]) for line in f]
    wrong = [(x, y) for x, y in zip(requested, b[3]) if x != y]
    print("fine" if not wrong and len(requested) == len(b[3]) else wrong[:3])


if __name__ == "__main__":
    main()
