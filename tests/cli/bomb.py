#!/usr/bin/env python3
"""Makes a small file that claims very many faces, as an attack on memory would: bomb.py IN OUT FACES

IN has one leaf and zstd; its maps are lost. All blocks of faces become the same few bytes.
"""
import ctypes
import shutil
import sys

import h5py
import numpy as np

ZSTD, BLOCK, INDEX_BLOCK = 32015, 4096, 8192
source, out, faces = sys.argv[1], sys.argv[2], int(sys.argv[3])
zstd = ctypes.CDLL("libzstd.so.1")
zstd.ZSTD_createCCtx.restype = ctypes.c_void_p
zstd.ZSTD_compress2.restype = ctypes.c_size_t
context = ctypes.c_void_p(zstd.ZSTD_createCCtx())
zstd.ZSTD_CCtx_setParameter(context, 201, 1)  # ZSTD_c_checksumFlag


def packed(values):
    """Encodes like the filter pipeline: bytes are grouped by their significance, then compressed by zstd with a checksum."""
    shuffled = np.ascontiguousarray(values.view(np.uint8).reshape(values.size, -1).T).tobytes()
    room = ctypes.create_string_buffer(len(shuffled) + 1000)
    size = zstd.ZSTD_compress2(context, room, ctypes.c_size_t(len(room)), shuffled,
                               ctypes.c_size_t(len(shuffled)))
    return room.raw[:size]


def anew(file, path, dtype, rows, columns, block, coding):
    """Replaces the rows of an array and keeps its attributes."""
    rank = 1 if path.startswith("levels") else 2
    kept = [(k, v, file[path].attrs.get_id(k).dtype) for k, v in file[path].attrs.items()] if path in file \
        else [("coding", np.bytes_(coding), f"S{len(coding)}")]
    if path in file:
        del file[path]
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_chunk((block, columns)[:rank])
    plan.set_shuffle()
    plan.set_filter(ZSTD, h5py.h5z.FLAG_OPTIONAL, (3,))
    plan.set_obj_track_times(False)
    made = h5py.Dataset(h5py.h5d.create(file.id, path.encode(), h5py.h5t.py_create(np.dtype(dtype)),
                                        h5py.h5s.create_simple((rows, columns)[:rank]), plan))
    for name, value, kind in kept:
        made.attrs.create(name, value, dtype=kind)
    return made


shutil.copy(source, out)
with h5py.File(out, "r+", libver="latest") as file:
    blocks = -(-faces // BLOCK)
    faces = blocks * BLOCK
    later = np.tile(np.array([4, 3, 2], "u4"), (BLOCK, 1))  # code k: the k-th vertex before the newest
    first = later.copy()
    first[0], first[1] = [0, 0, 0], [0, 2, 3]
    array = anew(file, "mesh/faces", "<u4", faces, 3, BLOCK, "")
    first, later = packed(first), packed(later)
    for i in range(blocks):
        array.id.write_direct_chunk((i * BLOCK, 0), later if i else first, 0)
    index = np.full(blocks, 4, "u8")
    index[0] = 0
    each = min(blocks, INDEX_BLOCK)
    array = anew(file, "mesh/faces_index", "<u8", blocks, 1, each, "plain")
    for i in range(0, blocks, each):
        block = np.zeros(each, "u8")
        block[:min(each, blocks - i)] = index[i:i + each]
        array.id.write_direct_chunk((i, 0), packed(block), 0)
    for name in "face_count", "source_face_count":
        file.attrs.modify(name, np.uint64(faces))
    file.attrs.create("optional_parts", np.bytes_(b"planes"), dtype="S6")
    del file["maps"]
    file["levels/00"].attrs.modify("faces_new", np.uint64(faces))
    array = anew(file, "levels/00/leaf_new", "<u4", 1, 1, 1, "")
    array.id.write_direct_chunk((0,), packed(np.array([faces], "<u4")), 0)
print(faces)
