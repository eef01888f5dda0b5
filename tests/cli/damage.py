#!/usr/bin/env python3
"""damage.py FILE NAME ...: flips some bits in the middle of the stored bytes of the largest dataset below
each name (a group or dataset of the file). Prints the dataset.
"""
import sys

import h5py


def largest(file, name):
    found = []

    def inspect(path, item):
        if isinstance(item, h5py.Dataset) and item.id.get_storage_size():
            found.append((item.id.get_storage_size(), path))

    item = file[name]
    if isinstance(item, h5py.Dataset):
        inspect(name, item)
    else:
        item.visititems(lambda path, below: inspect(name + "/" + path, below))
    return max(found)[1]


def place(dataset):
    if dataset.chunks is None:
        return dataset.id.get_offset(), dataset.id.get_storage_size()
    stored = dataset.id.get_chunk_info(dataset.id.get_num_chunks() // 2)
    return stored.byte_offset, stored.size


def main():
    path, names = sys.argv[1], sys.argv[2:]
    with h5py.File(path, "r") as file:
        wanted = [largest(file, name) for name in names]
        places = [place(file[name]) for name in wanted]
    with open(path, "r+b") as file:
        for offset, size in places:
            file.seek(offset + size // 2)
            old = file.read(1)
            file.seek(offset + size // 2)
            file.write(bytes([old[0] ^ 0x55]))
    print(*wanted)


main()
