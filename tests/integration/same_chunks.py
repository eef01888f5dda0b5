#!/usr/bin/env python3
"""Checks that files compressed on two machines have the same content, chunk by chunk.

    same_chunks.py FOLDER OTHER [--differs NUMBER...]

Every .ebpo.h5 of FOLDER has a counterpart in OTHER, except 20_version_1_0, which an old version made. Attributes,
types, filters and shapes are compared directly, chunks after decompression. Files whose names begin with a NUMBER
must differ in a chunk; a file without a difference is reported too.
"""
import ctypes
import pathlib
import sys

import h5py

ZSTD, MOST = 32015, 1 << 26
library = ctypes.CDLL("libzstd.so.1")
library.ZSTD_decompress.restype = ctypes.c_size_t
library.ZSTD_decompress.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p,
                                    ctypes.c_size_t]
room = ctypes.create_string_buffer(MOST)


def undone(stored):
    size = library.ZSTD_decompress(room, MOST, stored, len(stored))
    if library.ZSTD_isError(ctypes.c_size_t(size)):
        raise ValueError("a chunk is not a zstd frame")
    return ctypes.string_at(room, size)


def attributes(thing):
    return [(f"{thing.name}@{name}", (thing.attrs.get_id(name).dtype.str, str(value)))
            for name, value in sorted(thing.attrs.items())]


def chunks(dataset):
    """Yield the description of a dataset, then a pair for each chunk."""
    plist = dataset.id.get_create_plist()
    filters = [plist.get_filter(i)[0] for i in range(plist.get_nfilters())]
    yield dataset.name, (dataset.dtype.str, dataset.shape, dataset.chunks, filters)
    if dataset.chunks is None:
        yield f"{dataset.name} data", dataset[()].tobytes()
        return
    for i in range(dataset.id.get_num_chunks()):
        at = dataset.id.get_chunk_info(i).chunk_offset
        mask, stored = dataset.id.read_direct_chunk(at)
        zstd = ZSTD in filters and not mask & 1 << filters.index(ZSTD)
        yield f"{dataset.name} {at}", undone(stored) if zstd else stored


def content(path):
    found = {}
    with h5py.File(path) as file:
        things = [file]
        file.visititems(lambda name, thing: things.append(thing))
        for thing in things:
            found.update(attributes(thing))
            if isinstance(thing, h5py.Dataset):
                found.update(chunks(thing))
    return found


def difference(path, other):
    """Return the first difference or nothing, and the number of compared items."""
    one, two = content(path), content(other)
    for key in sorted(one.keys() | two.keys()):
        if one.get(key) != two.get(key):
            return key, len(one)
    return None, len(one)


def main():
    folder, other = (pathlib.Path(a) for a in sys.argv[1:3])
    differs = tuple(f"{number}_" for number in sys.argv[4:])
    problems, same, compared = [], 0, 0
    paths = sorted(path for path in folder.glob("*.ebpo.h5") if not path.name.startswith("20_version_1_0"))
    for path in paths:
        where, count = difference(path, other / path.name)
        compared += count
        same += path.read_bytes() == (other / path.name).read_bytes()
        if bool(where) != path.name.startswith(differs or "-"):
            problems.append(f"{path.name}: {where or 'has the same content'}")
    print("\n".join(problems) or f"{len(paths)} files, {compared} attributes, arrays and chunks, {same}"
                                 f" files with equal bytes; different contents as expected: {len(differs)}")
    return 1 if problems or len(paths) < 32 else 0


sys.exit(main())
