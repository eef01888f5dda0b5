#!/usr/bin/env python3
"""The files of format-spec/vectors/paint are what make_paint.py makes: test_paint_vectors.py FOLDER"""
import filecmp
import pathlib
import sys
import tempfile

import make_paint


def names(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*.*"))


def main(folder):
    with tempfile.TemporaryDirectory() as made:
        make_paint.main(pathlib.Path(made))
        there = names(folder)
        if there != names(pathlib.Path(made)):
            return f"other files than are made: {set(there) ^ set(names(pathlib.Path(made)))}"
        _, differ, unread = filecmp.cmpfiles(folder, made, there, shallow=False)
        return f"not as made: {differ + unread}" if differ or unread else None


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1])))
