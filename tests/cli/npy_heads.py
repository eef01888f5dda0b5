#!/usr/bin/env python3
"""npy_heads.py CUBE.ebpo.h5: tests headers of NumPy arrays as programs write them. Common headers are read;
others are refused by name. Needs ebpo in PATH, but not NumPy.
"""
import struct
import subprocess
import sys

POINTS = ((0.5, 0.25, 0.5), (2, 2, 2))
READ = "IN 1\nOUT 0\n"


def array(head, numbers="<6d", version=1, points=POINTS):
    size = struct.pack("<H" if version == 1 else "<I", len(head))
    return (b"\x93NUMPY" + bytes([version, 0]) + size + head.encode("utf-8")
            + struct.pack(numbers, *[c for p in points for c in p]))


def head(descr="'<f8'", order="False", shape="(2, 3)"):
    return f"{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}".ljust(117) + "\n"


FINE = {
    **{f"version {v}": array(head(), version=v) for v in (1, 2, 3)},
    "'<f4'": array(head("'<f4'"), "<6f"), "'>f4'": array(head("'>f4'"), ">6f"),
    "'>f8'": array(head("'>f8'"), ">6d"),
    "no blanks": array("{'descr':'<f8','fortran_order':False,'shape':(2,3)}\n"),
    "many blanks": array("{  'shape' :  ( 2 , 3 , ) , 'fortran_order' :  False,  'descr' :   '<f8' }\n"),
    "other quotes": array(head().replace("'", '"')),
    "a long head": array(head() + " " * 3000, version=2)}
REFUSED = {
    "is stored column by column; save numpy.ascontiguousarray of it": array(head(order="True")),
    "holds numbers of type '<i8'; give float64 or float32 (astype)": array(head("'<i8'")),
    "holds numbers of type '<f2'; give": array(head("'<f2'")),
    "holds numbers of type '|O'; give": array(head("'|O'")),
    "holds named fields; save numpy.lib.recfunctions.structured_to_unstructured of it":
        array(head("[('x', '<f8'), ('y', '<f8'), ('z', '<f8')]", shape="(2,)")),
    "has the shape (6,); points are rows of three": array(head(shape="(6,)")),
    "has the shape (); points are rows of three": array(head(shape="()")),
    "has the shape (3, 2); points are rows of three": array(head(shape="(3, 2)")),
    "has the shape (1, 2, 3); points are rows of three": array(head(shape="(1, 2, 3)")),
    **{f"has the shape {shape}; points are rows of three": array(head(shape=shape)) for shape in (
        "(-1, 3)", "(-2, 3)", "(2, -3)", "(-3,)", "(+2, 3)", "(2, 4294967299)", "(4294967299,)", "(2, 3, -1)",
        "(18446744073709551617, 3)", "(18446744073709551615, 3)", "(99999999999999999999999, 3)", "(2 3)")},
    "is a NumPy array of version 4.0; supported: 1.0 to 3.0": array(head(), version=4),
    "has no valid NumPy header": array("{'descr': '<f8'}\n")}


def run_query(data):
    done = subprocess.run(["ebpo", "inside", sys.argv[1]], input=data, capture_output=True)
    return done.returncode, done.stdout.decode(), done.stderr.decode()


def main():
    wrong = [(name, got) for name, data in FINE.items() if (got := run_query(data)) != (0, READ, "")]
    one = run_query(array(head(shape="(3,)"), "<3d", points=POINTS[:1]))
    if one != (0, "IN 1\n", ""):
        wrong.append(("one point", one))
    for message, data in REFUSED.items():
        code, out, err = run_query(data)
        if code != 1 or out or not err.startswith("ebpo inside: standard input: " + message):
            wrong.append((message, code, out, err))
    print(wrong or "fine")


main()
