#!/usr/bin/env python3
"""Finds bits of stored zstd chunks that can be flipped while libzstd still decodes the same values without an error.

zstd_bits.py FILE.ebpo.h5 ...: flips each bit of each chunk, one at a time, and prints what the bits stand for
(RFC 8878), how many there are of each, and of how many bits. Needs h5py and libzstd.so.1."""
import collections
import ctypes
import math
import sys

import h5py

zstd = ctypes.CDLL("libzstd.so.1")
zstd.ZSTD_decompress.restype = ctypes.c_size_t


def decode(frame, most):
    out = ctypes.create_string_buffer(most + 1)
    got = zstd.ZSTD_decompress(out, ctypes.c_size_t(most), bytes(frame), ctypes.c_size_t(len(frame)))
    return None if zstd.ZSTD_isError(ctypes.c_size_t(got)) else out.raw[:got]


def in_block(b, p, at):
    """What byte `at` is of a compressed block that begins at `p`."""
    kind, form = b[p] & 3, b[p] >> 2 & 3
    if kind < 2:
        head = (1, 2, 1, 3)[form]
        size = int.from_bytes(b[p:p + head], "little") >> (3 if head == 1 else 4)
        literals = size if kind == 0 else 1
    else:
        head, width = ((3, 10), (3, 10), (4, 14), (5, 18))[form]
        literals = int.from_bytes(b[p:p + head], "little") >> 4 + width & (1 << width) - 1
    if at < p + head:
        return "header of literals"
    p += head + literals
    if at < p:
        return "literals"
    count = 1 if b[p] < 128 else 2 if b[p] < 255 else 3
    if at < p + count:
        return "number of sequences"
    return "modes of sequences" if at == p + count else "sequences"


def field(b, at):
    single, sizes = b[4] >> 5 & 1, b[4] >> 6
    p = 5 + (not single) + (single, 2, 4, 8)[sizes]
    if at < p:
        return "magic" if at < 4 else "descriptor" if at == 4 else "window and content size"
    while True:
        header = int.from_bytes(b[p:p + 3], "little")
        kind, size = header >> 1 & 3, header >> 3
        if at < p + 3:
            return f"block header, of type {kind} and size {size}"
        p += 3
        if at < p + (1 if kind == 1 else size):
            return in_block(b, p, at) if kind == 2 else "bytes of a block that is not compressed"
        p += 1 if kind == 1 else size
        if header & 1:
            return "checksum"


def frames(path):
    with open(path, "rb") as file:
        data = file.read()
    found = []

    def visit(_, item):
        if isinstance(item, h5py.Dataset) and item.chunks:
            for i in range(item.id.get_num_chunks()):
                chunk = item.id.get_chunk_info(i)
                found.append((data[chunk.byte_offset:chunk.byte_offset + chunk.size],
                              math.prod(item.chunks) * item.dtype.itemsize))

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return [(b, most) for b, most in found if b[:4] == b"\x28\xb5\x2f\xfd"]


same, tried = collections.Counter(), 0
for frame, most in (f for path in sys.argv[1:] for f in frames(path)):
    right = decode(frame, most)
    for at in range(8 * len(frame)):
        flipped = bytearray(frame)
        flipped[at // 8] ^= 1 << at % 8
        tried += 1
        if decode(flipped, most) == right:
            same[field(frame, at // 8), at % 8] += 1
for (what, bit), count in sorted(same.items()):
    print(f"{count:6} {what}, bit {bit}")
print(f"{sum(same.values())} of {tried} bits; libzstd {zstd.ZSTD_versionNumber()}")
