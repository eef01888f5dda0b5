"""wider_types.py FILE: stores one array of an .ebpo.h5 file, without filters and without subtrees, in a wider
type than it needs, as another program might, and updates the content checksum.
"""
import hashlib
import sys

import h5py

with h5py.File(sys.argv[1], "r+", libver=("v110", "v110")) as f:
    path = next(p for p in (f"/levels/{i:02}/leaf_new" for i in range(21)) if p in f)
    old = f[path]
    values, attributes = old[...], dict(old.attrs.items())
    assert values.dtype.itemsize == 1
    types = {name: old.attrs.get_id(name).dtype for name in attributes}
    del f[path]
    new = f.create_dataset(path, data=values.astype("<u2"), chunks=(len(values),), fletcher32=True,
                           maxshape=values.shape, track_times=False)
    for name, value in attributes.items():
        new.attrs.create(name, value, dtype=types[name])
    names = []
    f.visititems(lambda name, item: names.append("/" + name) if isinstance(item, h5py.Dataset)
                 and name != "chunk_checksums" else None)
    total = hashlib.sha256()
    for name in sorted(names):
        total.update(name.encode() + b"\0" + hashlib.sha256(f[name][...].tobytes()).digest())
    f.attrs.modify("content_sha256", total.hexdigest().encode())
