"""Lets programs read .ebpo.h5 files with h5py, with or without the rest of this package.

The files are HDF5 files; format-spec/README.md describes their contents. Every h5py reads the arrays of files
that were written with `--codec deflate` or `none`. The default codec is zstd, HDF5's filter 32015, which
needs a plugin. One of these is sufficient:

    import hdf5plugin                   # from PyPI: registers zstd and other filters on import
    import h5py

    HDF5_PLUGIN_PATH=/usr/local/lib/hdf5/plugin python3 ...     # the plugin that this project installs

    import ebpo.h5
    ebpo.h5.enable()                    # uses whichever of the two exists, or the plugin in the wheel

`ebpo --version --verbose` prints the folder of the project's plugin. Then `h5py` reads the file:

    with h5py.File("bunny.ebpo.h5") as file:
        file.attrs["box_origin"], file["/levels/01/plane_counts"][:]

Arrays with a coding (vertices, faces, lists of faces) are read as codes. Section 7 of format-spec/README.md
describes how to decode them; `ebpo.Model` decodes them. samples/read_level.py reads a level with h5py alone.
format-spec/read_ebpo.py reads the whole file: it is a second reader, written from the specification.
"""
from __future__ import annotations

import os
import re
import subprocess

ZSTD = 32015


def plugin_folder() -> str | None:
    """Return the folder of the project's zstd plugin: that in the wheel, or that which `ebpo` prints; or None."""
    bundled = os.path.join(os.path.dirname(os.path.abspath(__file__)), "lib", "hdf5", "plugin")
    if os.path.isdir(bundled):
        return bundled
    try:
        printed = subprocess.run(["ebpo", "--version", "--verbose"], capture_output=True, text=True)
    except OSError:
        return None
    found = re.search(r"^HDF5 plugin: (/.*)$", printed.stdout, re.MULTILINE)
    return found[1] if found and os.path.isdir(found[1]) else None


def enable() -> str:
    """Enable zstd for h5py in this process. Returns the name of the plugin.

    Call it before the first file is opened: HDF5 does not search again for a plugin that it did not find.

    Raises ImportError when no plugin is found.
    """
    import h5py
    if h5py.h5z.filter_avail(ZSTD):
        return "built into HDF5"
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
                      "that `ebpo --version --verbose` prints")
