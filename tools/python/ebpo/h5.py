"""Lets programs with h5py read .ebpo.h5 files, with or without the rest of this package.

The files are HDF5, and format-spec/README.md says what is in them. Arrays of files that were written
with `--codec deflate` or `none` are read by any h5py. The default codec is zstd, HDF5's filter 32015,
which takes a plugin; one of these is enough:

    import hdf5plugin                   # of the package index: registers zstd, and others, on import
    import h5py

    HDF5_PLUGIN_PATH=/usr/local/lib/hdf5/plugin python3 ...     # the project's own, from its installation

    import ebpo.h5
    ebpo.h5.enable()                    # whichever of the two is there

`ebpo --version --verbose` names the folder of the project's plugin. `h5py` then reads as from any file:

    with h5py.File("bunny.ebpo.h5") as file:
        file.attrs["box_origin"], file["/levels/01/plane_counts"][:]

Arrays with a coding (vertices, faces, lists of faces) are read as numbers that format-spec/README.md,
section 7, says how to decode; `ebpo.Model` does that. samples/read_level.py reads a level with h5py alone,
and format-spec/read_ebpo.py all of a file: it is a second reader, made from the specification.
"""
from __future__ import annotations

import os
import re
import subprocess

ZSTD = 32015


def plugin_folder() -> str | None:
    """Return the folder of the project's zstd plugin, as the `ebpo` in PATH prints it, or None."""
    try:
        printed = subprocess.run(["ebpo", "--version", "--verbose"], capture_output=True, text=True)
    except OSError:
        return None
    found = re.search(r"^HDF5 plugin: (/.*)$", printed.stdout, re.MULTILINE)
    return found[1] if found and os.path.isdir(found[1]) else None


def enable() -> str:
    """Enable zstd for h5py in this process. Returns the name of the plugin. ImportError: no plugin found.

    Before the first file is opened: HDF5 remembers that it has found no plugin.
    """
    import h5py
    if h5py.h5z.filter_avail(ZSTD):
        return "HDF5 has it"
    try:
        import hdf5plugin  # noqa: F401
        return "hdf5plugin"
    except ImportError:
        pass
    folder = plugin_folder()
    if folder:
        h5py.h5pl.prepend(os.fsencode(folder))
        if h5py.h5z.filter_avail(ZSTD):
            return folder
    raise ImportError("h5py has no filter for zstd: install hdf5plugin, or set HDF5_PLUGIN_PATH to the folder "
                      "that `ebpo --version --verbose` names")
