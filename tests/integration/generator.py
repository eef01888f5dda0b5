#!/usr/bin/env python3
"""Checks that ebpo-generate writes closed manifolds without self-intersections, for every base, and the same in
each run.

    generator.py EBPO GENERATE CROSSING_FACES
"""
import filecmp
import json
import subprocess
import sys
import tempfile

EBPO, GENERATE, CROSSING_FACES = sys.argv[1:4]
# The base of the last model is the file of the first one.
MODELS = [["--base", "torus", "--faces", "5000"], ["--base", "torus", "--faces", "200000"],
          ["--base", "torus", "--faces", "50000", "--relief", "0.2", "--roughness", "0.5", "--seed",
           "9"],
          ["--base", "sphere", "--faces", "50000"],
          ["--base", "sphere", "--subdivide", "5", "--relief", "0.2", "--roughness", "0.5"],
          ["--base", "FILE", "--subdivide", "2"]]


def main():
    with tempfile.TemporaryDirectory() as folder:
        for i, options in enumerate(MODELS):
            path, again = f"{folder}/{i}.ply", f"{folder}/again.ply"
            options = [f"{folder}/0.ply" if o == "FILE" else o for o in options]
            for target in path, again:
                subprocess.run([GENERATE, *options, target], check=True, capture_output=True)
            assert (filecmp.cmp(path, again,
                                shallow=False)), f"{options}: another run writes other bytes"
            checked = subprocess.run([CROSSING_FACES, path], capture_output=True, text=True)
            assert checked.returncode == 0, checked.stdout
            report = json.loads(subprocess.run([EBPO, "check", "--json", path], check=True,
                                               capture_output=True, text=True).stdout)
            assert report["report"]["manifold"], f"{options}: not a manifold"
        lone = subprocess.run([GENERATE, "--base", "sphere", "--faces", "1", "--seed", "2", again],
                              capture_output=True, text=True)
        assert lone.returncode == 0 and not filecmp.cmp(path, again, shallow=False)
    print(f"{len(MODELS)} models are correct")


main()
