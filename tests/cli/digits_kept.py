#!/usr/bin/env python3
"""Checks in rational arithmetic that no digit of text is lost.

Writes numbers in all notations into OBJ, OFF and text STL files. `ebpo check` prints the kind and the
value of a coordinate. Coordinates must be floats if the nearest float, rounded to the text's last digit
(ties to even), gives the text; otherwise the nearest doubles. Then larger files are converted, and the
output of `ebpo extract` is compared with the text.
"""
import json
import os
import random
import struct
import subprocess
import sys
from decimal import Decimal
from fractions import Fraction


def float_of(bits):
    return struct.unpack("<f", struct.pack("<I", bits))[0]


def nearest_float(value):
    """Returns the float nearest to a rational number, ties to even; infinite beyond the range."""
    size, low, high = abs(value), 0, 0x7f7fffff
    while low < high:  # finds the greatest float that is not greater
        middle = (low + high + 1) // 2
        low, high = (middle, high) if Fraction(float_of(middle)) <= size else (low, middle - 1)
    below = Fraction(float_of(low))
    above = Fraction(float_of(low + 1)) if low < 0x7f7fffff else Fraction(2 ** 128)
    if size - below > above - size or (size - below == above - size and low % 2):
        low += 1
    return -float_of(low) if value < 0 else float_of(low)


def expected(text):
    """Returns the expected coordinate, and True when it is a float."""
    digits = Decimal(text)
    value, unit = Fraction(digits), Fraction(10) ** digits.as_tuple().exponent
    narrow = nearest_float(value)
    keeps = abs(narrow) != float("inf") and round(Fraction(narrow) / unit) == value / unit
    return (narrow, True) if keeps else (float(text), False)


def random_text(r):
    kind = r.randrange(8)
    sign = r.choice(["", "", "-", "+"])
    if kind == 0:  # a random number of digits, with a point at a random position
        digits = "".join(r.choice("0123456789") for _ in range(r.randint(1, 24)))
        at = r.randint(0, len(digits))
        return sign + digits[:at] + "." + digits[at:]
    if kind == 1:
        return f"{sign}{r.randrange(10 ** r.randint(1, 12))}"
    if kind == 2:  # with exponent
        digits = "".join(r.choice("0123456789") for _ in range(r.randint(1, 12)))
        exponent = r.choice(["", "-", "+"]) + f"{r.randint(0, 30):0{r.randint(1, 3)}}"
        return f"{sign}{r.randrange(10)}.{digits}{r.choice('eE')}{exponent}"
    narrow = float_of(r.randrange(0x2f800000, 0x5f000000))
    if kind == 3:  # a float, as programs print it
        return f"{sign}{narrow:.{r.randint(0, 30)}f}"
    if kind == 4:
        return f"{sign}{narrow:.{r.randint(0, 25)}e}"
    if kind == 5:  # near the middle between two floats
        above = float_of(struct.unpack("<I", struct.pack("<f", narrow))[0] + 1)
        return sign + f"{(Decimal(narrow) + Decimal(above)) / 2:f}"[:40]
    if kind == 6:  # quarters, for which two texts give one float
        return f"{sign}{r.randrange(2097152, 4194304)}.{r.randrange(10)}"
    edges = ["0.5", "691234.567", "5334567.891", ".000", "1e-45", "1.0e-44", "1.2e-45", "1e39", "3.4028235e38"]
    return "0" * r.randint(0, 3) + r.choice(edges)


def write(path, vertices):
    """Writes a triangle for every three vertices, whose coordinates are texts."""
    rows = [" ".join(v) for v in vertices]
    faces = range(0, len(rows), 3)
    with open(path, "w", encoding="ascii") as f:
        if path.endswith(".obj"):
            f.writelines(f"v {row}\n" for row in rows)
            f.writelines(f"f {i + 1} {i + 2} {i + 3}\n" for i in faces)
        elif path.endswith(".off"):
            f.write(f"OFF\n{len(rows)} {len(faces)} 0\n" + "\n".join(rows) + "\n")
            f.writelines(f"3 {i} {i + 1} {i + 2}\n" for i in faces)
        else:
            f.write("solid\n")
            for i in faces:
                corners = "".join(f"vertex {row}\n" for row in rows[i:i + 3])
                f.write(f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
            f.write("endsolid\n")


def ebpo(*words):
    done = subprocess.run(["ebpo", *words], capture_output=True, check=False)
    if done.returncode:
        sys.exit(f"ebpo {' '.join(words)}: {done.stderr.decode()}")
    return done.stdout


def check_one(path, text):
    """Checks a file with one decisive number."""
    write(path, [(text, "0", "0"), ("0", "1", "0"), ("0", "0", "1")])
    mesh = json.loads(ebpo("check", "--json", path), parse_int=float)
    value, narrow = expected(text)
    found = mesh["report"]["min" if value < 0 else "max"][0]
    if mesh["source"]["double_coordinates"] == narrow or found != value:
        sys.exit(f"{path}: {text} became {found!r}, not {value!r}; float: {narrow}")


def read_ply(path):
    data = open(path, "rb").read()
    head, body = data.split(b"end_header\n", 1)
    kind = "d" if b"property double x" in head else "f"
    count = int(head.split(b"element vertex ")[1].split()[0])
    faces = int(head.split(b"element face ")[1].split()[0])
    size = struct.calcsize("<3" + kind)
    points = [struct.unpack_from("<3" + kind, body, i * size) for i in range(count)]
    corners = [struct.unpack_from("<B3i", body, count * size + i * 13)[1:] for i in range(faces)]
    return kind == "f", [points[c] for f in corners for c in f]


def check_many(path, texts, narrow):
    write(path, texts)
    ebpo("convert", "-q", path, "digits.ebpo.h5")
    ebpo("verify", "-q", "digits.ebpo.h5", "--against", path)
    ebpo("extract", "-q", "--mesh", "digits.ebpo.h5", "digits.ply")
    found, points = read_ply("digits.ply")
    if found != narrow:
        sys.exit(f"{path}: coordinates are {'float' if found else 'double'}")
    for vertex, point in zip(texts, points):
        for text, value in zip(vertex, point):
            if value != (expected(text)[0] if narrow else float(text)):
                sys.exit(f"{path}: {text} became {value!r}")


r = random.Random(7)
paths = ["digits.obj", "digits.off", "digits.stl"]
share = min(1, max(0.3, float(os.environ.get("EBPO_TEST_SCALE", "1"))))
for i in range(int(int(sys.argv[1]) * share)):
    check_one(paths[i % 3], random_text(r))
for path in paths:
    middling = [f"{r.uniform(-99, 99):.{r.randint(0, 6)}f}" for _ in range(3000)]
    texts = [t for t in middling if expected(t)[1]][:900]
    rows = [tuple(texts[i:i + 3]) for i in range(0, 900, 3)]
    check_many(path, rows, True)
    check_many(path, rows[:-1] + [("0.1", "16.000001", "-7e-3")], False)
print("fine")
