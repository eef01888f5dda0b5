#!/usr/bin/env python3
"""test_described.py SOURCE: in files as the library writes them, each object has the attribute
`about`, and each array with two dimensions names its columns in `columns`."""
import pathlib
import sys

import h5py

VECTORS = ("06_four_levels_leaf_planes", "28_leaf_index", "29_types_and_gray_index", "32_chunks_of_maps",
           "41_attributes_of_a_subset", "50_gates_of_subtrees", "51_textures", "55_chunk_checksums_of_subtrees",
           "60_subset_with_subtrees")
folder = pathlib.Path(sys.argv[1]) / "format-spec" / "vectors" / "passed"
problems, seen = [], 0
for name in VECTORS:
    with h5py.File(folder / f"{name}.ebpo.h5", "r") as file:
        objects = [("/", file)]
        file.visititems(lambda path, item, out=objects: out.append((path, item)))
        for path, item in objects:
            seen += 1
            if not item.attrs.get("about"):
                problems.append(f"{name}: {path} has no about")
            if (isinstance(item, h5py.Dataset) and item.ndim == 2 and item.attrs["coding"] != b"gates" and
                    len(item.attrs.get("columns", b"").split(b" ")) !=
                    (1 if "list" in item.attrs else item.shape[1])):
                problems.append(f"{name}: {path} does not name {item.shape[1]} columns")
print("\n".join(problems) or f"{seen} objects")
sys.exit(bool(problems) or seen < 100)
