"""A small writer of paint files, which shows that section 7 of format-spec/paint.md is all it takes: no HDF5 library.

    write(path, {"": {"attributes": {...}, "groups": {"layers": {...}}, "arrays": {"face": Array}}})

A group is a dict of `attributes` (name: value), `groups` and `arrays`. Values: text, int (u64), I64(int), list of
floats (f64[n]). Not part of what is installed: vectors are made with it, and damaged on purpose.
"""
import struct

NONE = 2 ** 64 - 1


class I64(int):
    pass


class Array:
    """rows: nested lists of integers or floats; kind: 'u1' 'u2' 'u4' 'u8', or 'f8' for f64's bits in u64."""

    def __init__(self, kind, rows, **wrong):
        self.kind, self.rows, self.wrong = kind, rows, wrong

    def size(self):
        return int(self.kind[1])

    def dims(self):
        return [len(self.rows)] + ([len(self.rows[0])] if isinstance(self.rows[0], (list, tuple)) else [])

    def bytes(self):
        flat = [v for row in self.rows for v in (row if isinstance(row, (list, tuple)) else [row])]
        code = {"u1": "B", "u2": "H", "u4": "I", "u8": "Q", "f8": "d"}[self.kind]
        return struct.pack(f"<{len(flat)}{code}", *flat)


def rotate(x, k):
    return (x << k | x >> (32 - k)) & 0xffffffff


def lookup3(data):
    """Jenkins' hashlittle, initial value 0."""
    m = 0xffffffff
    a = b = c = (0xdeadbeef + len(data)) & m
    at = 0
    while len(data) - at > 12:
        x, y, z = struct.unpack_from("<III", data, at)
        a, b, c = a + x & m, b + y & m, c + z & m
        a = (a - c & m) ^ rotate(c, 4); c = c + b & m
        b = (b - a & m) ^ rotate(a, 6); a = a + c & m
        c = (c - b & m) ^ rotate(b, 8); b = b + a & m
        a = (a - c & m) ^ rotate(c, 16); c = c + b & m
        b = (b - a & m) ^ rotate(a, 19); a = a + c & m
        c = (c - b & m) ^ rotate(b, 4); b = b + a & m
        at += 12
    if at == len(data):
        return c
    x, y, z = struct.unpack("<III", data[at:].ljust(12, b"\0"))
    a, b, c = a + x & m, b + y & m, c + z & m
    c = (c ^ b) - rotate(b, 14) & m
    a = (a ^ c) - rotate(c, 11) & m
    b = (b ^ a) - rotate(a, 25) & m
    c = (c ^ b) - rotate(b, 16) & m
    a = (a ^ c) - rotate(c, 4) & m
    b = (b ^ a) - rotate(a, 14) & m
    return (c ^ b) - rotate(b, 24) & m


def fletcher32(data):
    s1 = s2 = 0
    for at in range(0, len(data), 2):
        s1 += data[at] << 8 | data[at + 1]
        s2 += s1

    def reduced(s):
        while s >= 65536:
            s = (s & 65535) + (s >> 16)
        return s
    return reduced(s2) << 16 | reduced(s1)


def message(kind, data, flags=0):
    return struct.pack("<BHB", kind, len(data), flags) + data


def header(messages):
    body = b"".join(messages)
    block = b"OHDR" + struct.pack("<BBI", 2, 2, len(body)) + body
    return block + struct.pack("<I", lookup3(block))


def space(dims):
    return struct.pack(f"<BBBB{len(dims)}Q", 2, len(dims), 0, 1 if dims else 0, *dims)


def integer(size, signed=False):
    return struct.pack("<BBHIHH", 0x10, 8 if signed else 0, 0, size, 0, 8 * size)


def attribute(name, value):
    if isinstance(value, str):
        data = value.encode() or b"\0"
        kind, dims = struct.pack("<BBHI", 0x13, 0x11, 0, len(data)), []
    elif isinstance(value, list):
        data, dims = struct.pack(f"<{len(value)}d", *value), [len(value)]
        kind = struct.pack("<BBBBIHHBBBBI", 0x11, 0x20, 0x3f, 0, 8, 0, 64, 52, 11, 0, 52, 1023)
    else:
        signed = isinstance(value, I64)
        data, kind, dims = struct.pack("<q" if signed else "<Q", value), integer(8, signed), []
    text, where = name.encode() + b"\0", space(dims)
    return message(12, struct.pack("<BBHHHB", 3, 0, len(text), len(kind), len(where), 0) + text + kind + where + data)


class File:
    def __init__(self):
        self.data = bytearray(48)

    def put(self, block):
        at = len(self.data)
        self.data += block
        return at

    def array(self, a):
        raw, dims, size = a.bytes(), a.dims(), a.size()
        chunk = raw + struct.pack("<I", fletcher32(raw) ^ a.wrong.get("sum", 0))
        at = self.put(chunk)
        layout = struct.pack("<BBBBB", 4, 2, 2, len(dims) + 1, 8) + struct.pack(f"<{len(dims)}Q", *dims)
        layout += struct.pack("<QBQIQ", size, 1, len(chunk), a.wrong.get("mask", 0), at + a.wrong.get("move", 0))
        filters = message(11, struct.pack("<BBHHH", 2, 1, a.wrong.get("filter", 3), 0, 0), 1)
        return self.put(header([message(1, space(dims)), message(3, integer(size, a.wrong.get("signed", False)), 1),
                                message(5, b"\x03\x07", 1), message(8, layout), filters]))

    def group(self, g):
        links = [(name, self.group(part)) for name, part in g.get("groups", {}).items()]
        links += [(name, self.array(part)) for name, part in g.get("arrays", {}).items()]
        messages = [message(2, struct.pack("<BBQQ", 0, 0, NONE, NONE)), message(10, b"\0\0")]
        messages += [attribute(name, value) for name, value in g.get("attributes", {}).items()]
        messages += [message(6, struct.pack("<BBB", 1, 0, len(name)) + name.encode() + struct.pack("<Q", at))
                     for name, at in links]
        return self.put(header(messages))


def write(path, root):
    f = File()
    at = f.group(root)
    block = b"\x89HDF\r\n\x1a\n" + struct.pack("<BBBBQQQQ", 3, 8, 8, 0, 0, NONE, len(f.data), at)
    f.data[:48] = block + struct.pack("<I", lookup3(block))
    with open(path, "wb") as out:
        out.write(f.data)
