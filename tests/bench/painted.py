#!/usr/bin/env python3
"""painted.py MODEL.ply OUT.ply: adds colours to the vertices of a binary PLY of floats.

The PLY must have only positions and faces. The colours are waves, dark bands across y, and noise as in scans. Equal
input gives equal bytes with one version of numpy.
"""
import sys

import numpy as np

NOISE, BAND = 4, 0.125

with open(sys.argv[1], "rb") as f:
    data = f.read()
end = data.index(b"end_header\n") + 11
count = int(data[:end].split(b"element vertex ")[1].split()[0])
at = np.frombuffer(data, "<f4", 3 * count, end).reshape(-1, 3)
x, y, z = ((at - at.min(0)) / np.ptp(at, axis=0).max()).T
wave = np.sin(28 * x + 6 * np.sin(9 * y)) * np.sin(22 * z + 3 * y)
rgb = np.stack([150 + 80 * wave, 110 + 60 * np.sin(17 * y), 90 + 90 * (z - .5)], 1)
rgb[np.abs(y % BAND - .06) < .006] = 30
rgb = np.clip(rgb + np.random.default_rng(1).normal(0, NOISE, rgb.shape), 0, 255).astype("u1")
rows = np.zeros(count, dtype=[("at", "<f4", 3), ("rgb", "u1", 3)])
rows["at"], rows["rgb"] = at, rgb
names = b"".join(b"property uchar %s\n" % name for name in (b"red", b"green", b"blue"))
with open(sys.argv[2], "wb") as f:
    f.write(data[:end].replace(b"property float z\n", b"property float z\n" + names))
    f.write(rows.tobytes() + data[end + 12 * count:])
