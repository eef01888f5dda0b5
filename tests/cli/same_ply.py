#!/usr/bin/env python3
"""same_ply.py SOURCE BACK [--subset]: compares a rewritten PLY with its source. Elements, properties in the same order
and with the same types, comments, and all values, also of lists, must be equal bit by bit and in the same order. A
polygon or strip of the source may be triangles in BACK: each triangle has the corners and values of its polygon.
--subset: BACK has some of the vertices and faces, and no other elements.
"""
import array
import struct
import sys

TYPES = {"char": "b", "int8": "b", "uchar": "B", "uint8": "B", "short": "h", "int16": "h", "ushort": "H", "uint16": "H",
         "int": "i", "int32": "i", "uint": "I", "uint32": "I", "float": "f", "float32": "f", "double": "d",
         "float64": "d"}


class Ply:
    """A PLY file. notes: comments and obj_info; elements: [(name, [(kind, name)], rows)], where a row is a tuple of bytes."""

    def __init__(self, path):
        data = open(path, "rb").read()
        end = data.index(b"end_header")
        end = data.index(b"\n", end) + 1
        self.notes, self.elements, self.order, counts = [], [], None, []
        for line in data[:end].decode("latin-1").split("\n"):
            line = line.rstrip("\r")
            words = line.split()
            if words and words[0] in ("comment", "obj_info"):
                self.notes.append(line)
            elif words and words[0] == "format":
                self.order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[words[1]]
            elif words and words[0] == "element":
                self.elements.append((words[1], [], []))
                counts.append(int(words[2]))
            elif words and words[0] == "property":
                kind = tuple(TYPES[w] for w in words[2:-1]) if words[1] == "list" else (TYPES[words[1]],)
                self.elements[-1][1].append((kind, words[-1]))
        self.read_text(data[end:], counts) if self.order == "" else self.read_binary(data, end, counts)

    def read_text(self, body, counts):
        at, tokens = 0, body.split()
        for (_, properties, rows), count in zip(self.elements, counts):
            for _ in range(count):
                row = []
                for kind, _ in properties:
                    n = int(tokens[at]) if len(kind) == 2 else 1
                    at += len(kind) == 2
                    items = [float(t) if kind[-1] in "fd" else int(t) for t in tokens[at:at + n]]
                    at += n
                    row.append(array.array(kind[-1], items).tobytes())
                rows.append(tuple(row))

    def read_binary(self, data, at, counts):
        swap = (self.order == "<") != (sys.byteorder == "little")
        for (_, properties, rows), count in zip(self.elements, counts):
            for _ in range(count):
                row = []
                for kind, _ in properties:
                    n = 1
                    if len(kind) == 2:
                        n, = struct.unpack_from(self.order + kind[0], data, at)
                        at += struct.calcsize(kind[0])
                    items = array.array(kind[-1])
                    items.frombytes(data[at:at + n * items.itemsize])
                    at += n * items.itemsize
                    if swap:
                        items.byteswap()
                    row.append(items.tobytes())
                rows.append(tuple(row))

    def element(self, name):
        return next(((p, r) for n, p, r in self.elements if n == name), None)


def corners_of(properties, row):
    at = next(i for i, (_, name) in enumerate(properties) if name in ("vertex_indices", "vertex_index"))
    return at, array.array(properties[at][0][-1], row[at]).tolist()


def triangles_of_strip(strip):
    for part in [list(p) for p in split(strip)]:
        for i in range(len(part) - 2):
            a, b, c = part[i:i + 3]
            if len({a, b, c}) == 3:
                yield (b, a, c) if i & 1 else (a, b, c)


def split(strip):
    part = []
    for corner in strip + [-1]:
        if corner in (-1, 0xffffffff):
            yield part
            part = []
        else:
            part.append(corner)


def check(condition, text):
    if not condition:
        sys.exit(f"same_ply.py: {text}")


def faces_of(ply):
    """Returns [(corners of the polygon, other values)]."""
    out = []
    for name, properties, rows in ply.elements:
        for row in rows if name in ("face", "tristrips") else []:
            at, corners = corners_of(properties, row)
            rest = row[:at] + row[at + 1:] if name == "face" else ()
            out += [(t, rest) for t in triangles_of_strip(corners)] if name == "tristrips" else [(corners, rest)]
    return out


def compare_faces(source, back):
    wanted, found, at = faces_of(source), faces_of(back), 0
    for corners, rest in wanted:
        for _ in range(len(corners) - 2):
            check(at < len(found), "faces are missing")
            triangle, values = found[at]
            same = list(triangle) == list(corners) if len(corners) == 3 else set(triangle) <= set(corners)
            check(same, f"face {at} has other corners")
            check(values == rest, f"face {at} has other values")
            at += 1
    check(at == len(found), "there are more faces")


def compare(source, back):
    check(source.notes == back.notes, "the comments differ")
    strips = source.element("tristrips") is not None
    for name, properties, rows in source.elements:
        other = back.element("face" if name == "tristrips" else name)
        check(other is not None, f"element {name} is missing")
        check(strips and name in ("face", "tristrips") or [p for p in properties] == other[0],
              f"element {name} has other properties: {properties}, {other[0]}")
        if name in ("face", "tristrips"):
            continue
        check(len(rows) == len(other[1]), f"element {name} has other rows")
        for i, (a, b) in enumerate(zip(rows, other[1])):
            check(a == b, f"row {i} of {name} differs")
    compare_faces(source, back)
    if not strips:
        check([n for n, _, _ in source.elements] == [n for n, _, _ in back.elements], "elements are in another order")


def compare_subset(source, back):
    """Compares a subset. Rows are in the order of the source, so that each is searched after the previous one."""
    check(source.notes == back.notes, "the comments differ")
    properties, rows = source.element("vertex")
    check(properties == back.element("vertex")[0], "the vertices have other properties")
    at = 0
    for i, row in enumerate(back.element("vertex")[1]):
        while at < len(rows) and rows[at] != row:
            at += 1
        check(at < len(rows), f"vertex {i} is not in the source, or is in another order")
        at += 1
    strips = source.element("face") is None
    check(strips or source.element("face")[0] == back.element("face")[0], "the faces have other properties")
    triangles, polygons = set(), {}
    for corners, rest in faces_of(source):
        of = [rows[c] for c in corners]
        if len(of) == 3:
            triangles.add((*of, rest))
        else:
            for corner in of:
                polygons.setdefault((corner, rest), []).append(set(of))
    points = back.element("vertex")[1]
    for corners, rest in faces_of(back):
        of = [points[c] for c in corners]
        check((*of, rest) in triangles or any(set(of) <= p for p in polygons.get((of[0], rest), [])),
              "a face is none of the source")


if __name__ == "__main__":
    first, second = Ply(sys.argv[1]), Ply(sys.argv[2])
    (compare_subset if "--subset" in sys.argv else compare)(first, second)
