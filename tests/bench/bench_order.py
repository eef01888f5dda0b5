#!/usr/bin/env python3
"""bench_order.py FILE.ebpo.h5 [--memory 8M] [--points 200000]

What it is worth that ebpo.dask asks points in Morton order: subtrees loaded, bytes read and seconds for
points at random in the root cell, as they come and by a catalogue of the one model. With PYTHONPATH at the
package, as docs/guide/python.md says.
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
    raise SystemExit("the answers differ")
before, after = model.stats, process_models().stats()
for name in ("loads", "bytes_read"):
    print(f"{name}: {before[name]} as they come, {after[name]} in order: {before[name] / max(1, after[name]):.1f} times")
print(f"time: as they come {loose / ordered:.1f} times as long")
