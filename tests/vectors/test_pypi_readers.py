#!/usr/bin/env python3
"""Tests that h5py and hdf5plugin from PyPI read the files: test_pypi_readers.py ROOT VECTORS EBPO GENERATE

In a new virtual environment, without the project's plugin, the second reader (format-spec/read_ebpo.py) reads all passed
vectors and finds what their JSON files state. Then h5py reads every array of files that this build writes with each
codec; only the checksums of chunks depend on the codec. Exit code 77: the packages cannot be
installed.
"""
import os
import pathlib
import subprocess
import sys
import tempfile

PACKAGES = ["h5py", "hdf5plugin"]
READ_ALL = """
import sys
import h5py, hdf5plugin, numpy
from importlib.metadata import version
assert not h5py.h5z.filter_avail(32015) or "hdf5plugin" in sys.modules
def arrays(name):
    found = {}
    with h5py.File(name) as file:
        file.visititems(lambda path, item: found.update({path: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return found
first, *others = map(arrays, sys.argv[1:])
for other in others:
    assert first.keys() == other.keys()
    for path, values in first.items():
        assert path == "chunk_checksums" or numpy.array_equal(values, other[path]), path
assert len(first["mesh/faces"]) > 0
print(f"{len(first)} arrays of {len(sys.argv) - 1} files, h5py {version('h5py')}, hdf5plugin {version('hdf5plugin')}")
"""
READ_VECTORS = "import runpy, sys, hdf5plugin; sys.argv = sys.argv[1:]; runpy.run_path(sys.argv[0], run_name='__main__')"


def main():
    root, vectors, ebpo, generate = (pathlib.Path(word).resolve() for word in sys.argv[1:])
    env = {name: value for name, value in os.environ.items() if not name.startswith(("HDF5", "PYTHON", "LD_", "EBPO"))}
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        python = folder / "venv/bin/python"
        for words in ([sys.executable, "-m", "venv", folder / "venv"],
                      [python, "-m", "pip", "install", "-q", "--only-binary=:all:", "--retries=0", "--timeout=15",
                       "--disable-pip-version-check", *PACKAGES]):
            done = subprocess.run(words, env=env, capture_output=True, text=True)
            if done.returncode:
                print(f"skipped: pip cannot install {' and '.join(PACKAGES)}:", *(done.stdout + done.stderr).splitlines()[-1:])
                sys.exit(77)
        subprocess.run([python, "-c", READ_VECTORS, root / "format-spec/read_ebpo.py", "--vectors", vectors], env=env,
                       check=True)
        subprocess.run([generate, "--base", "torus", "--faces", "20000", folder / "torus.ply"], env=env, check=True)
        files = [folder / f"{codec}.ebpo.h5" for codec in ("zstd", "deflate", "none")]
        for file in files:
            subprocess.run([ebpo, "convert", "--codec", file.name.partition(".")[0], folder / "torus.ply", file], env=env,
                           check=True, stdout=subprocess.DEVNULL)
        subprocess.run([python, "-c", READ_ALL, *files], env=env, check=True)


if __name__ == "__main__":
    main()
