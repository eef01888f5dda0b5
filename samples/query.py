#!/usr/bin/env python3
"""Classifies points and computes their distances to the surface with the Python package.

    PYTHONPATH=/usr/local/lib/ebpo/python samples/query.py MODEL.ebpo.h5 <points.txt

Reads lines "x y z" with coordinates separated by blanks or commas. Queries all points with one call for
each kind of result, as arrays. docs/guide/python.md describes the location of the package.
"""
import re
import sys

import numpy as np

try:
    import ebpo
except ImportError as error:
    sys.exit(f"query.py: {error}; set PYTHONPATH to the folder of the package: PREFIX/lib/ebpo/python of an "
             "installation, or tools/python of a build folder")


def parse(line, number):
    """Returns a point, or None for an empty line."""
    line = line.split("#")[0].strip()
    if not line:
        return None
    try:
        x, y, z = map(float, re.split(r"\s*,\s*|\s+", line))
    except ValueError:
        raise ValueError(f"line {number}: expected three numbers") from None
    return x, y, z


def print_results(model, points):
    words = [place.name for place in ebpo.Where]
    try:
        where = [words[place] for place in model.locate(points).where]
    except ebpo.NotSolidError: # a surface without a border has only distances
        where = ["surface"] * len(points)
    nearest = model.distance(points)
    for word, *values in zip(where, nearest.distance.tolist(), nearest.face.tolist(), nearest.point.tolist()):
        print(f"{word}, {values[0]!r} from face {values[1]} at", *map(repr, values[2]))


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: query.py MODEL.ebpo.h5 <points.txt")
    points, wrong = [], None
    try:
        model = ebpo.open(sys.argv[1])
        for number, line in enumerate(sys.stdin, 1):
            try:
                point = parse(line, number)
            except ValueError as error:
                wrong = error  # reported after the results of earlier points
                break
            if point is not None:
                points.append(point)
        print_results(model, np.array(points).reshape(-1, 3))
    except (ebpo.Error, OSError) as error:
        sys.exit(f"query.py: {error}")
    if wrong:
        sys.exit(f"query.py: {wrong}")


if __name__ == "__main__":
    main()
