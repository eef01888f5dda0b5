#!/usr/bin/env python3
"""envelope_colours.py FILE.ebpo.h5 ...: measures the size of the colours of envelopes.

Prints for each level the stored bytes of types and planes, and of colours. Needs h5py.
"""
import sys

import h5py

SHAPE = ("types", "planes", "plane_counts")


def stored(level, names):
    return sum(level[name].id.get_storage_size() for name in names if name in level)


for path in sys.argv[1:]:
    with h5py.File(path, "r") as file:
        rows = [(int(level.attrs["gray"]), stored(level, SHAPE), stored(level, ["gray_colours"]))
                for _, level in sorted(file["levels"].items())]
        print(f"{path}\n\n| level | gray | types and planes, bytes | colours |\n|---|---|---|---|")
        for name, row in [*enumerate(rows), ("all", [sum(column) for column in zip(*rows)])]:
            print("|", name, "|", " | ".join(f"{value:,}" for value in row), "|")
