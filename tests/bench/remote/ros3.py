"""Reads once with HDF5's own ros3 driver: ros3.py URL TO|whole -> JSON. Needs HDF5_PLUGIN_PATH for zstd."""
import json
import sys
import time

import h5py

url, to = sys.argv[1:3]
begin = time.perf_counter()
values, first = 0, None
with h5py.File(url, "r", driver="ros3") as file:
    def take(name, item):
        global values
        if isinstance(item, h5py.Dataset):
            values += item[()].size

    if to == "whole":
        file.visititems(take)
    else:
        for level in range(int(to) + 1):
            file[f"levels/{level:02d}"].visititems(take)
            first = first if level else 1e3 * (time.perf_counter() - begin)
print(json.dumps({"first": first, "ms": 1e3 * (time.perf_counter() - begin), "values": values}))
