"""clean_root_dask.py MODEL FOLDER SCHEDULER: queries the points of clean_root_query.py again, on Dask."""
import os
import sys

import numpy as np
from dask.distributed import Client

import ebpo.dask


def main(path, folder, scheduler):
    with Client(scheduler) as client:
        client.wait_for_workers(2, timeout=60)
        points = ebpo.dask.points(os.path.join(folder, "points.npy"))
        query = ebpo.dask.inside(path, points, chunk=50_000)
        ebpo.dask.to_file(query, os.path.join(folder, "dask.npy"))
        for worker, did in ebpo.dask.stats(client).items():
            print(worker, did)
    results = np.load(os.path.join(folder, "dask.npy"))
    assert (results == np.load(os.path.join(folder, "inside.npy"))).all()
    os.remove(os.path.join(folder, "dask.npy"))
    print(len(results), "results of two workers equal those of one process")


main(*sys.argv[1:])
