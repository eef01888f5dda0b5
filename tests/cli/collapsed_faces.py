#!/usr/bin/env python3
"""Writes an OBJ file whose faces collapse when it is simplified.

    collapsed_faces.py segments|component

segments: a sphere of 10,800 faces, of which only every ninth has three different corners.
component: two spheres in opposite octants, and a tetrahedron between them that is much smaller than
a border cell."""
import math
import sys

AROUND, RINGS = 90, 60
written = 0


def put_sphere(offset, segments):
    global written
    for ring in range(RINGS + 1):
        for step in range(AROUND):
            a, b = math.pi * ring / RINGS, 2 * math.pi * step / AROUND
            print("v", offset + math.sin(a) * math.cos(b), offset + math.sin(a) * math.sin(b),
                  offset + math.cos(a))
    for ring in range(RINGS):
        for step in range(AROUND):
            a, b = (1 + written + ring * AROUND + (step + k) % AROUND for k in (0, 1))
            for i, face in enumerate(((a, a + AROUND, b + AROUND), (a, b + AROUND, b))):
                flat = segments and (2 * (ring * AROUND + step) + i) % 9
                print("f", face[0], face[1], face[1] if flat else face[2])
    written += (RINGS + 1) * AROUND


if sys.argv[1] == "segments":
    put_sphere(0, True)
else:
    put_sphere(1, False)
    put_sphere(-1, False)
    for corner in ((0, 0, 0), (.002, 0, 0), (0, .002, 0), (0, 0, .002)):
        print("v", *corner)
    for face in ((1, 3, 2), (1, 2, 4), (2, 3, 4), (1, 4, 3)):
        print("f", *(written + k for k in face))
