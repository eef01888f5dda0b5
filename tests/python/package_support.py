"""Support for tests of the package: a folder with models, and results of the command.

Run as  NAME.py EBPO EBPO_INPUTS EBPO_GENERATE  with PYTHONPATH at the package.
"""
import atexit
import ctypes
import io
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy as np

import ebpo

COMMAND, INPUTS, GENERATE = map(os.path.abspath, sys.argv[1:4])
FOLDER = pathlib.Path(tempfile.mkdtemp(prefix="ebpo-python-"))
atexit.register(shutil.rmtree, FOLDER, ignore_errors=True)
os.chdir(FOLDER)
subprocess.run([INPUTS, "."], check=True)
subprocess.run([GENERATE, "--base", "sphere", "--faces", "5000", "scan.ply"], check=True, capture_output=True)
MADE = {}


def model(name, **options):
    """A model of one of the inputs, opened anew; the command converts it once."""
    if name not in MADE:
        subprocess.run([COMMAND, "convert", "-q", f"{name}.ply", f"{name}.ebpo.h5"], check=True)
        MADE[name] = f"{name}.ebpo.h5"
    return ebpo.open(MADE[name], **options)


def command_results(command, name, queries, *options):
    """What the command answers to rows of numbers: an array of its own, from its --npy."""
    np.save("queries.npy", np.ascontiguousarray(queries, dtype=np.float64))
    done = subprocess.run([COMMAND, command, "--npy", *options, f"{name}.ebpo.h5", "queries.npy"],
                          check=True, capture_output=True)
    return np.load(io.BytesIO(done.stdout))


def points(count, seed=1, reach=1.2):
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 3))


EXTRAS = hasattr(ctypes.CDLL(ebpo.library()), "ebpo_collider_new")  # else the library is the core alone


class Case(unittest.TestCase):
    def _callTestMethod(self, method):
        """Tests of what a library without extras lacks are skipped."""
        try:
            super()._callTestMethod(method)
        except ebpo.UnsupportedError as error:
            if EXTRAS or "-Dextras=disabled" not in str(error):
                raise
            self.skipTest(str(error))

    def same(self, one, other):
        """Tuples of arrays, bit for bit; nan is nan."""
        for a, b in zip(one, other):
            np.testing.assert_array_equal(a, b)


def run():
    result = unittest.main(argv=sys.argv[:1], exit=False).result
    if not result.testsRun:
        sys.exit("no test ran")
    sys.exit(not result.wasSuccessful())
