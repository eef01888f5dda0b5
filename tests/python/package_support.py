"""Support for tests of the package: a folder with models, and results of the command.

Run as  NAME.py EBPO EBPO_INPUTS EBPO_GENERATE  with PYTHONPATH naming the package's folder.
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
    """Open a new model of one of the inputs. The command converts each input once."""
    if name not in MADE:
        subprocess.run([COMMAND, "convert", "-q", f"{name}.ply", f"{name}.ebpo.h5"], check=True)
        MADE[name] = f"{name}.ebpo.h5"
    return ebpo.open(MADE[name], **options)


def command_results(command, name, queries, *options):
    """Return the command's results for rows of numbers, as the array that --npy writes."""
    np.save("queries.npy", np.ascontiguousarray(queries, dtype=np.float64))
    done = subprocess.run([COMMAND, command, "--npy", *options, f"{name}.ebpo.h5", "queries.npy"],
                          check=True, capture_output=True)
    return np.load(io.BytesIO(done.stdout))


def points(count, seed=1, reach=1.2):
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 3))


EXTRAS = hasattr(ctypes.CDLL(ebpo.library()), "ebpo_collider_new")  # False: the library is only the core


class Case(unittest.TestCase):
    def _callTestMethod(self, method):
        """Skip a test that needs functions which a library without extras lacks."""
        try:
            super()._callTestMethod(method)
        except ebpo.UnsupportedError as error:
            if EXTRAS or "-Dextras=disabled" not in str(error):
                raise
            self.skipTest(str(error))

    def same(self, one, other):
        """Assert that two tuples of arrays are equal bit for bit; nan equals nan."""
        for a, b in zip(one, other):
            np.testing.assert_array_equal(a, b)


def run():
    result = unittest.main(argv=sys.argv[:1], exit=False).result
    if not result.testsRun:
        sys.exit("no test ran")
    sys.exit(not result.wasSuccessful())
