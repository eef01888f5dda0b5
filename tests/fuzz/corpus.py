#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Corpora as one file each: corpus.py pack CORPUS.pack FOLDER, corpus.py unpack CORPUS.pack FOLDER.

A pack is a row of inputs, the shortest first: their length in four bytes, little-endian, and
their bytes. So a thousand inputs of some bytes are one file, which the driver in fuzz_main.c reads.
pack leaves out inputs longer than --most bytes."""
import argparse
import hashlib
import pathlib
import struct

parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
parser.add_argument("what", choices=("pack", "unpack"))
parser.add_argument("pack", type=pathlib.Path)
parser.add_argument("folder", type=pathlib.Path)
parser.add_argument("--most", type=int, default=1 << 22, help="bytes of the longest input")
options = parser.parse_args()

if options.what == "pack":
    inputs = {path.read_bytes() for path in options.folder.iterdir() if path.stat().st_size <= options.most}
    ordered = sorted(inputs, key=lambda data: (len(data), data))
    options.pack.write_bytes(b"".join(struct.pack("<I", len(data)) + data for data in ordered))
    print(f"{options.pack}: {len(ordered)} inputs, {options.pack.stat().st_size} bytes")
else:
    options.folder.mkdir(parents=True, exist_ok=True)
    data, at, count = options.pack.read_bytes(), 0, 0
    while at < len(data):
        size = struct.unpack_from("<I", data, at)[0]
        one = data[at + 4:at + 4 + size]
        (options.folder / hashlib.sha1(one).hexdigest()).write_bytes(one)
        at += 4 + size
        count += 1
    print(f"{options.folder}: {count} inputs")
