#!/usr/bin/env python3
"""Which points are inside, and how far away is the surface? The C library through ctypes: nothing
to build.

    samples/query.py MODEL.ebpo.h5 <points.txt

Reads lines "x y z", with blanks or commas between, and answers each. The library is that of
EBPO_LIBRARY=/path/to/libebpo.so, else the one that the ebpo of PATH uses, else the system's. As a
module:  model = Model("bunny.ebpo.h5"); model.inside([(0, 0, 0)]); model.distance([(0, 0, 0)])
"""
import ctypes
import ctypes.util
import os
import re
import subprocess
import sys

NOT_SOLID = -7  # ebpo/base.h


class Error(ctypes.Structure):  # ebpo/base.h
    _fields_ = [("status", ctypes.c_int), ("message", ctypes.c_char * 480),
                ("file", ctypes.c_char * 256),
                ("object", ctypes.c_char * 64), ("offset", ctypes.c_int64),
                ("reserved", ctypes.c_uint64 * 4)]


class Inside(ctypes.Structure):  # ebpo/query.h, as all below
    _fields_ = [("where", ctypes.c_int32), ("winding", ctypes.c_int32), ("doubt", ctypes.c_double)]
    word = property(lambda self: ("OUT", "IN", "ON", "MAYBE")[self.where])


class Distance(ctypes.Structure):
    _fields_ = [("distance", ctypes.c_double), ("lo", ctypes.c_double), ("hi", ctypes.c_double),
                ("point", ctypes.c_double * 3),
                ("normal", ctypes.c_double * 3), ("face", ctypes.c_uint64)]


def library_path():
    """None: there is none."""
    if os.environ.get("EBPO_LIBRARY"):
        return os.environ["EBPO_LIBRARY"]
    try:
        told = subprocess.run(["ebpo", "--version", "--verbose"], capture_output=True, text=True)
        found = re.search(r"^library: (/.*) \([0-9.]+\)$", told.stdout, re.MULTILINE)
    except OSError:
        found = None
    return found[1] if found else ctypes.util.find_library("ebpo")


class Model:
    """Answers raise RuntimeError with the library's message."""

    def __init__(self, path):
        name = library_path()
        if not name:
            raise RuntimeError("libebpo is not found; install it, or name it in EBPO_LIBRARY")
        self.library = ctypes.CDLL(name)
        self.file, self.model, self.context = ctypes.c_void_p(), ctypes.c_void_p(), ctypes.c_void_p()
        self.call("ebpo_open", os.fsencode(path), ctypes.byref(self.file))
        self.call("ebpo_model_new", self.file, None, ctypes.byref(self.model))
        self.call("ebpo_context_new", self.model, ctypes.byref(self.context))

        error = Error()  # a question about no points tells whether there is an inside
        self.solid = self.library.ebpo_inside_many(self.context, None, ctypes.c_uint64(0), None,
                                                   None, ctypes.byref(error)) != NOT_SOLID

    def call(self, function, *arguments):
        error = Error()
        if getattr(self.library, function)(*arguments, ctypes.byref(error)) != 0:
            raise RuntimeError(error.message.decode("utf-8", "replace"))

    def ask(self, function, answer, points):
        flat = (ctypes.c_double * (3 * len(points)))(*[c for x, y, z in points for c in (x, y, z)])
        answers = (answer * len(points))()
        self.call(function, self.context, flat, ctypes.c_uint64(len(points)), None, answers)
        return answers

    def inside(self, points):
        return self.ask("ebpo_inside_many", Inside, points)

    def distance(self, points):
        return self.ask("ebpo_distance_many", Distance, points)


def parse(line, number):
    """A point, or None for an empty line."""
    line = line.split("#")[0].strip()
    if not line:
        return None
    try:
        x, y, z = map(float, re.split(r"\s*,\s*|\s+", line))
    except ValueError:
        raise RuntimeError(f"line {number}: three numbers are expected") from None
    return x, y, z


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: query.py MODEL.ebpo.h5 <points.txt")
    try:
        model = Model(sys.argv[1])
        for number, line in enumerate(sys.stdin, 1):
            point = parse(line, number)
            if point is None:
                continue
            where = model.inside([point])[0].word if model.solid else "surface"
            nearest = model.distance([point])[0]
            print(f"{where}, {nearest.distance!r} from face {nearest.face} at",
                  *map(repr, nearest.point))
    except (RuntimeError, OSError) as error:
        sys.exit(f"query.py: {error}")


if __name__ == "__main__":
    main()
