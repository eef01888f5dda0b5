"""picture_shows.py FILE.png WIDTH HEIGHT [COLOUR..]: checks that a PNG has this size, a light border and darker
pixels inside. With colours, the PNG must have pixels of each colour: red, green, blue, purple; -COLOUR means
no such pixels. "smooth" means that neighbouring pixels of the object rarely differ much, and -smooth that they
often do. Supports filters 0 to 4 of 8-bit RGB.
"""
import struct
import sys
import zlib


def rows_of(data):
    at, packed, size = 8, b"", None
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + length]
        assert struct.unpack(">I",
                             data[at + 8 + length:at + 12 + length])[0] == zlib.crc32(kind + body)
        if kind == b"IHDR":
            size = struct.unpack(">IIBBBBB", body)
        if kind == b"IDAT":
            packed += body
        at += 12 + length
    assert size[2:] == (8, 2, 0, 0, 0), size
    return size[0], size[1], zlib.decompress(packed)


def paeth(a, b, c):
    pa, pb, pc = abs(b - c), abs(a - c), abs(a + b - 2 * c)
    return a if pa <= pb and pa <= pc else b if pb <= pc else c


def unfilter(width, height, raw):
    stride, before, out = 3 * width, bytes(3 * width), []
    for y in range(height):
        kind, line = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        for i in range(stride):
            a, b, c = (line[i - 3] if i >= 3 else 0), before[i], (before[i - 3] if i >= 3 else 0)
            line[i] = (line[i] + (0, a, b, (a + b) // 2, paeth(a, b, c))[kind]) & 255
        out.append(bytes(line))
        before = line
    return out


data = open(sys.argv[1], "rb").read()
assert data[:8] == b"\x89PNG\r\n\x1a\n"
width, height, raw = rows_of(data)
assert (width, height) == (int(sys.argv[2]), int(sys.argv[3])), (width, height)
rows = unfilter(width, height, raw)
assert min(rows[0]) > 200 and all(row[0] > 200 for row in rows), "the border is not light"
IS = {
    "red": lambda r, g, b: r > 100 and max(g, b) < 70,
    "green": lambda r, g, b: g > 100 and max(r, b) < 70,
    "blue": lambda r, g, b: b > 100 and max(r, g) < 70,
    "purple": lambda r, g, b: min(r, b) > 70 and g < 50,
}
for colour in sys.argv[4:]:
    if colour.lstrip("-") == "smooth":
        greens = [row[1::3] for row in rows]
        steps = [abs(row[i + 1] - row[i]) for row in greens for i in range(2, width - 3) if max(row[i - 2:i + 4]) < 200]
        share = sum(step > 4 for step in steps) / len(steps)
        assert share > 0.03 if colour[0] == "-" else share < 0.01, f"{colour}: {share}"
        continue
    count = sum(IS[colour.lstrip("-")](*row[i:i + 3]) for row in rows for i in range(0, 3 * width, 3))
    right = count == 0 if colour[0] == "-" else count > width * height // 2000
    assert right, f"{colour}: {count} pixels"
if len(sys.argv) > 4:
    print("fine")
    sys.exit()
dark = sum(row[i] < 200 for row in rows for i in range(0, 3 * width, 3))
assert width * height // 10 < dark < width * height * 9 // 10, dark
print("fine")
