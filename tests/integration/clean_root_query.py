"""clean_root_query.py MODEL FOLDER: queries a million points and rays, and writes the results as .npy files."""
import os
import sys
import time

import numpy as np

import ebpo

COUNT = 1_000_000


def main(path, folder):
    os.makedirs(folder, exist_ok=True)
    print(ebpo.library())
    model = ebpo.open(path)
    low, high = (np.asarray(corner) for corner in model.info.box)
    points = low + (high - low) * np.random.default_rng(1).random((COUNT, 3))
    began = time.monotonic()
    inside = model.inside(points)
    print(f"{COUNT} points in {time.monotonic() - began:.2f} s, {inside.sum()} of them inside")
    found = model.distance(points[:100_000])
    ray = model.ray(points[:100_000], points[1:100_001] - points[:100_000])
    assert 0 < inside.sum() < COUNT
    assert ((found.distance <= 0) == inside[:100_000]).all()
    np.save(os.path.join(folder, "points.npy"), points)
    np.save(os.path.join(folder, "inside.npy"), inside)
    np.save(os.path.join(folder, "distance.npy"), found.distance)
    np.save(os.path.join(folder, "t.npy"), ray.t)


main(*sys.argv[1:])
