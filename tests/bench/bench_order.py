#!/usr/bin/env python3
"""bench_order.py FILE.ebpo.h5 [--memory 8M] [--points 200000]

Measures the benefit of Morton order, in which ebpo.dask queries points. Prints subtrees loaded, bytes read and seconds
for random points in the root cell: in random order, and through a catalogue of the one model, which sorts them. Needs
PYTHONPATH as in docs/guide/python.md.
"""
import argparse
import time

import numpy as np

import ebpo
from ebpo.catalogue import Catalogue
from ebpo.open_models import process_models

parser = argparse.ArgumentParser()
parser.add_argument("file")
parser.add_argument("--memory", default="8M")
parser.add_argument("--points", type=int, default=200_000)
given = parser.parse_args()

model = ebpo.open(given.file, memory=given.memory)
points = np.random.default_rng(1).uniform(*model.info.box, (given.points, 3))
begin = time.monotonic()
expected = model.winding(points)
loose = time.monotonic() - begin
process_models(given.memory)
catalogue = Catalogue.of([given.file])
begin = time.monotonic()
winding = catalogue.winding(points)
ordered = time.monotonic() - begin
if (winding != expected).any():
    raise SystemExit("the results differ")
before, after = model.stats, process_models().stats()
for name in ("loads", "bytes_read"):
    print(f"{name}: {before[name]} unsorted, {after[name]} sorted: {before[name] / max(1, after[name]):.1f} times")
print(f"time: unsorted takes {loose / ordered:.1f} times as long")
