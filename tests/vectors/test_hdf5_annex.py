#!/usr/bin/env python3
"""test_hdf5_annex.py SOURCE: a reader of annex H of the specification finds the attributes and chunks
of every passed vector where h5py finds them. It uses nothing but that annex."""
import pathlib
import struct
import sys

import h5py

NONE = 2 ** 64 - 1


def checksum(data):
    """Section 5."""
    def rot(x, k):
        return (x << k | x >> 32 - k) & 0xffffffff

    def step(x, y, k):
        return ((x ^ y) - rot(y, k)) & 0xffffffff

    left, at = len(data), 0
    s = [(0xdeadbeef + left) & 0xffffffff] * 3
    while left:
        block = data[at:at + 12].ljust(12, b"\0")
        a, b, c = ((x + y) & 0xffffffff for x, y in zip(s, struct.unpack("<3I", block)))
        if left <= 12:
            c, a = step(c, b, 14), a
            a = step(a, c, 11)
            b = step(b, a, 25)
            c = step(c, b, 16)
            a = step(a, c, 4)
            b = step(b, a, 14)
            return step(c, b, 24)
        for k in (4, 6, 8, 16, 19, 4):
            a = (a - c & 0xffffffff) ^ rot(c, k)
            c = c + b & 0xffffffff
            a, b, c = b, c, a
        s, at, left = [a, b, c], at + 12, left - 12
    return s[2]


class Cursor:
    def __init__(self, data, at=0):
        self.data, self.at = data, at

    def take(self, size):
        self.at += size
        assert self.at <= len(self.data), "beyond the end"
        return self.data[self.at - size:self.at]

    def uint(self, size):
        return int.from_bytes(self.take(size), "little")


def sound(data, begin, end):
    assert checksum(data[begin:end]) == struct.unpack_from("<I", data, end)[0], "checksum"


def messages(data, at):
    """Section 3: [(type, data)]."""
    c = Cursor(data, at)
    assert c.take(4) == b"OHDR" and c.uint(1) == 2
    flags = c.uint(1)
    c.take((16 if flags & 32 else 0) + (4 if flags & 16 else 0))
    size = c.uint(1 << (flags & 3))
    sound(data, at, c.at + size)
    blocks, found, gap = [(c.at, c.at + size)], [], 2 if flags & 4 else 0
    for begin, end in blocks:
        c = Cursor(data, begin)
        while end - c.at >= 4 + gap:
            kind, length, _ = c.uint(1), c.uint(2), c.uint(1)
            c.take(gap)
            found.append((kind, c.take(length)))
            if kind == 0x10:
                address, length = struct.unpack("<2Q", found[-1][1])
                assert data[address:address + 4] == b"OCHK"
                sound(data, address, address + length - 4)
                blocks.append((address + 4, address + length - 4))
    return found


def links(found):
    for kind, data in found:
        if kind == 0x06:
            c = Cursor(data)
            assert c.uint(1) == 1
            flags = c.uint(1)
            hard = c.uint(1) == 0 if flags & 8 else True
            c.take((8 if flags & 4 else 0) + (1 if flags & 16 else 0))
            name = c.take(c.uint(1 << (flags & 3))).decode()
            if hard:
                yield name, c.uint(8)


def dataspace(data):
    c = Cursor(data)
    version, rank, flags = c.uint(1), c.uint(1), c.uint(1)
    c.take(1 if version == 2 else 5)
    sizes = [c.uint(8) for _ in range(rank)]
    assert not flags & 1 or sizes == [c.uint(8) for _ in range(rank)]
    return sizes


def attributes(found):
    """{name: bytes of the values}"""
    out = {}
    for kind, data in found:
        if kind == 0x0c:
            c = Cursor(data)
            version, _ = c.uint(1), c.uint(1)
            sizes = [c.uint(2) for _ in range(3)]
            c.take(1 if version == 3 else 0)
            name, datatype, space = (c.take(size + (-size % 8 if version == 1 else 0)) for size in sizes)
            count = 1
            for size in dataspace(space):
                count *= size
            out[name.split(b"\0")[0].decode()] = c.take(count * int.from_bytes(datatype[4:8], "little"))
    return out


def chunks(data, found):
    """Section 4: [(address, bytes)] of an array."""
    kinds = dict(found)
    shape, c = dataspace(kinds[0x01]), Cursor(kinds[0x08])
    assert (c.uint(1), c.uint(1)) == (4, 2)
    flags, rank, size = c.uint(1), c.uint(1), c.uint(1)
    sides = [c.uint(size) for _ in range(rank)]
    assert rank == len(shape) + 1 and sides[1:-1] == shape[1:]
    count, raw, index, filtered = -(-shape[0] // sides[0]), 1, c.uint(1), 0x0b in kinds
    for side in sides:
        raw *= side
    if index == 1:
        size = c.uint(8) if flags & 2 else raw
        c.take(4 if flags & 2 else 0)
        begin = c.uint(8)
        return [] if begin == NONE else [(begin, size)]
    if index == 2:
        begin = c.uint(8)
        return [] if begin == NONE else [(begin + i * raw, raw) for i in range(count)]
    assert index == 3
    bits, head = c.uint(1), c.uint(8)
    if head == NONE:
        return []
    sound(data, head, head + 24)
    c = Cursor(data, head)
    assert c.take(5) == b"FAHD\0" and c.uint(1) == filtered
    entry, _, total, block = c.uint(1), c.uint(1), c.uint(8), c.uint(8)
    assert total == count and data[block:block + 4] == b"FADB"
    out, at = [], block + 14
    if count > 1 << bits:
        at += (-(-count // (1 << bits)) + 7) // 8
        sound(data, block, at)
        at += 4
    for first in range(0, count, 1 << bits):
        here = min(count - first, 1 << bits)
        sound(data, block if count <= 1 << bits else at, at + here * entry)
        c = Cursor(data, at)
        for _ in range(here):
            address = c.uint(8)
            out.append((address, c.uint(entry - 12) if filtered else raw))
            c.take(4 if filtered else 0)
        at = c.at + 4
    return out


def compare(data, file, path, address):
    """Returns the number of chunks of an object and those below it."""
    found, item = messages(data, address), file[path]
    assert sorted(attributes(found)) == sorted(item.attrs), path
    for name, value in attributes(found).items():
        if item.attrs[name].dtype.kind in "iuf":
            assert value == item.attrs[name].tobytes(), (path, name)
    if isinstance(item, h5py.Group):
        return sum(compare(data, file, f"{path.rstrip('/')}/{name}", below)
                   for name, below in links(found))
    if item.chunks is None:
        return 0
    listed = [item.id.get_chunk_info(i) for i in range(item.id.get_num_chunks())]
    assert chunks(data, found) == [(c.byte_offset, c.size) for c in listed], path
    return len(listed)


def main():
    folder, total = pathlib.Path(sys.argv[1]) / "format-spec" / "vectors" / "passed", 0
    for path in sorted(folder.glob("*.ebpo.h5")):
        data = path.read_bytes()
        assert data[:8] == b"\x89HDF\r\n\x1a\n" and data[8] in (2, 3) and data[9:11] == b"\x08\x08"
        base, extension, end, root = struct.unpack_from("<4Q", data, 12)
        sound(data, 0, 44)
        assert base == 0 and extension == NONE and end <= len(data), path.name
        with h5py.File(path, "r") as file:
            total += compare(data, file, "/", root)
    print(f"{total} chunks")
    sys.exit(0 if total > 1000 else "too few chunks")


main()
