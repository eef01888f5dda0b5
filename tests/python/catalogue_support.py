"""Support for tests of catalogues: results of the command, and parts that the sample cuts.

Run as described in package_support, with the source folder as an additional argument.
"""
import contextlib
import importlib.util
import io
import pathlib
import subprocess
import sys

from package_support import COMMAND, np

import ebpo
from ebpo.catalogue import Catalogue

CUT = pathlib.Path(sys.argv[4]).absolute() / "samples/cut_along_octcodes.py"
RAW = {"inside": np.dtype([("where", "<i4"), ("winding", "<i4")]),
       "distance": np.dtype([("distance", "<f8"), ("point", "<f8", 3), ("normal", "<f8", 3), ("face", "<i8"), ("model", "<i8")]),
       "ray": np.dtype([("t", "<f8"), ("face", "<i8"), ("side", "<i8"), ("model", "<i8")])}


def by_command(command, catalogue, rows, *options):
    """Save a catalogue, and return the command's results for it."""
    catalogue.save("queried.json")
    np.ascontiguousarray(rows, float).tofile("queried.raw")
    done = subprocess.run([COMMAND, command, "--raw", *options, "queried.json", "queried.raw"], capture_output=True)
    assert done.returncode == 0, done.stderr
    return np.frombuffer(done.stdout, RAW[command])


def same(results, expected):
    for name in expected.dtype.names:
        np.testing.assert_array_equal(results[name], expected[name], name)


def cut_by_sample(whole, folder, *level):
    """Run the sample cut_along_octcodes. Return it as a module, its catalogue, and its output."""
    spec = importlib.util.spec_from_file_location("cut_along_octcodes", CUT)
    cut = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(cut)
    sys.argv, kept = ["cut", whole, folder, *level], sys.argv
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        cut.main()
    sys.argv = kept
    return cut, Catalogue.open(folder + "/catalogue.json"), printed.getvalue()


def caps_of(catalogue, corners):
    """Return the corners of the caps of all parts, which are the faces that the whole model lacks.

    corners: (f, 3, 3), the corners of the whole model's faces.
    """
    caps = []
    for entry in catalogue.entries:
        vertices, faces = ebpo.open(entry.path).mesh(order="source")
        numbers = np.load(entry.numbers)
        real = set(map(bytes, corners[numbers]))
        of_part = np.ascontiguousarray(vertices.astype(float)[faces])
        capped = np.array([bytes(face) not in real for face in of_part])
        assert (~capped).sum() == len(numbers)
        caps.append(of_part[capped])
    return np.concatenate(caps)


def on_triangles(corners):
    """Return points at corners, on edges and inside faces. They are exact doubles if the corners are floats."""
    return np.concatenate([corners[:, 0], (corners[:, 0] + corners[:, 1]) / 2,
                           (2 * corners[:, 0] + corners[:, 1] + corners[:, 2]) / 4])
