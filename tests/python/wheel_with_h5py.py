#!/usr/bin/env python3
"""Uses the package and h5py in one process: wheel_with_h5py.py first|last SPHERE.ply

first, last: h5py is imported before or after the package. Both read and write files at the same time, from threads,
and each reads what the other has written.
"""
import importlib
import os
import sys
import threading

import numpy as np

order, sphere = sys.argv[1:]
names = ["h5py", "ebpo"] if order == "first" else ["ebpo", "h5py"]
modules = {name: importlib.import_module(name) for name in names}
h5py, ebpo = modules["h5py"], modules["ebpo"]
import ebpo.h5  # noqa: E402

P = np.random.default_rng(1).uniform(-1.2, 1.2, (20000, 3))
ebpo.convert(sphere, "both.ebpo.h5", codec="deflate", overwrite=True)
expected = ebpo.open("both.ebpo.h5").inside(P)
written = open("both.ebpo.h5", "rb").read()
failed = []


def convert(number):
    for turn in range(4):
        name = f"both{number}.ebpo.h5"
        ebpo.convert(sphere, name, codec="deflate", overwrite=True)
        with open(name, "rb") as file:
            assert file.read() == written, "the file depends on h5py"
        assert (ebpo.open(name).inside(P) == expected).all()


def write(number):
    for turn in range(40):
        with h5py.File(f"both{number}.h5", "w") as file:
            file.create_dataset("points", data=P, chunks=(1000, 3), compression="gzip")
            file.attrs["turn"] = turn
        with h5py.File(f"both{number}.h5", "r") as file:
            assert (file["points"][:] == P).all() and file.attrs["turn"] == turn
            assert (ebpo.open("both.ebpo.h5").inside(file["points"]) == expected).all()


def work(function, number):
    try:
        for _ in range(2):
            function(number)
    except BaseException as error:
        failed.append(repr(error))


threads = [threading.Thread(target=work, args=(function, i)) for i, function in enumerate([convert, write] * 2)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert not failed, failed
with h5py.File("both.ebpo.h5", "r") as file:  # deflate: every h5py reads it
    assert file["mesh/faces"].shape[0] > 0
try:  # errors of one do not appear in the other
    h5py.File("none.h5", "r")
except OSError as error:
    assert "none.h5" in str(error)
ebpo.convert(sphere, "zstd.ebpo.h5", overwrite=True)
how = ebpo.h5.enable()
with h5py.File("zstd.ebpo.h5", "r") as file:
    assert len(file["mesh/faces"][:]) == ebpo.open("zstd.ebpo.h5").info.face_count
mapped = {line.split()[-1] for line in open("/proc/self/maps") if "libhdf5" in line}
print(f"h5py {h5py.__version__} ({order}), HDF5 {h5py.version.hdf5_version}, zstd: {os.path.basename(how)}; "
      f"libhdf5 loaded: {len(mapped)}")
