#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Files made like the proof files of published defects of libhdf5: make_hostile.py GOOD.ebpo.h5 FOLDER.

GOOD is a file in this format. Two sorts are made of it: with old metadata (superblock 0, version 1
headers), where most of the defects lie, written by libhdf5 itself and then damaged at the field that
the report names; and with the metadata of this format, the same field damaged and the checksums made
good, so that nothing but the field itself can be what is refused. Each must be refused.

The names begin with the year and number of the report whose defect they have."""
import pathlib
import shutil
import struct
import sys

import h5py
import numpy

good, folder = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
folder.mkdir(parents=True, exist_ok=True)


def lookup3(data):
    def rot(x, k):
        return (x << k | x >> 32 - k) & 0xffffffff
    a = b = c = (0xdeadbeef + len(data)) & 0xffffffff
    at = 0
    words = lambda i: struct.unpack("<3I", data[i:i + 12].ljust(12, b"\0"))
    while len(data) - at > 12:
        x, y, z = words(at)
        a, b, c = a + x & 0xffffffff, b + y & 0xffffffff, c + z & 0xffffffff
        for k in (4, 6, 8, 16, 19, 4):
            a = (a - c & 0xffffffff) ^ rot(c, k)
            c = c + b & 0xffffffff
            a, b, c = b, c, a
        at += 12
    if len(data) == at:
        return c
    x, y, z = words(at)
    a, b, c = a + x & 0xffffffff, b + y & 0xffffffff, c + z & 0xffffffff
    c = (c ^ b) - rot(b, 14) & 0xffffffff
    a = (a ^ c) - rot(c, 11) & 0xffffffff
    b = (b ^ a) - rot(a, 25) & 0xffffffff
    c = (c ^ b) - rot(b, 16) & 0xffffffff
    a = (a ^ c) - rot(c, 4) & 0xffffffff
    b = (b ^ a) - rot(a, 14) & 0xffffffff
    return (c ^ b) - rot(b, 24) & 0xffffffff


# --- old metadata ---

def copy_group(source, target):
    for name, value in source.attrs.items():
        target.attrs[name] = value
    for name, item in source.items():
        if isinstance(item, h5py.Group):
            copy_group(item, target.create_group(name))
        else:
            copied = target.create_dataset(name, data=numpy.zeros(item.shape, item.dtype), chunks=item.chunks)
            for key, value in item.attrs.items():
                copied.attrs[key] = value


def write_old(name, change=None):
    path = folder / name
    with h5py.File(good, "r") as source, h5py.File(path, "w", libver=("earliest", "latest")) as target:
        copy_group(source, target)
        if change:
            change(target)
    return path


def damaged(name, data):
    (folder / name).write_bytes(bytes(data))


def place(data, signature, which=0):
    at = -1
    for _ in range(which + 1):
        at = data.index(signature, at + 1)
    return at


def message(data, kind, which=0):
    """The body of a message in version 1 headers: type, size, flags, three zeros, body."""
    found = [at for at in range(96, len(data) - 16, 8)
             if struct.unpack_from("<H", data, at)[0] == kind and data[at + 5:at + 8] == b"\0\0\0"
             and 8 <= struct.unpack_from("<H", data, at + 2)[0] <= 4096 and data[at + 4] < 64
             and struct.unpack_from("<H", data, at + 2)[0] % 8 == 0]
    return found[which] + 8


old = bytearray(write_old("old_good.h5").read_bytes())


def old_with(name, at, value):
    data = bytearray(old)
    data[at:at + len(value)] = value
    damaged(name, data)


BIG, NONE = b"\xff" * 8, b"\0" * 8
tree, snod, heap = place(old, b"TREE"), place(old, b"SNOD"), place(old, b"HEAP")
space, kind, fill, layout = message(old, 1), message(old, 3), message(old, 5), message(old, 8)
attribute = message(old, 12)
old_with("2016-4330_rank_of_dataspace.h5", space + 1, b"\xff")
old_with("2016-4331_filter_of_scaleoffset.h5", kind, b"\x10\xff\xff\xff")
old_with("2016-4332_message_flags.h5", fill - 4, b"\x07")
old_with("2016-4333_size_of_array_type.h5", kind, b"\x1a\x00\x00\x00\x00\x00\x00\x00\xff")
old_with("2017-17505_filter_pipeline.h5", attribute, b"\x00\x00\x00\x00")
old_with("2017-17506_attribute_lengths.h5", attribute + 2, b"\xff\xff\xff\xff\xff\xff")
old_with("2017-17507_conversion_of_types.h5", kind, b"\x16\xff\xff\x00\xff\xff\xff\xff")
old_with("2017-17508_division_by_zero_in_type.h5", kind + 4, b"\0\0\0\0")
old_with("2017-17509_dense_link_name.h5", heap + 8, BIG)
old_with("2018-11202_hyperslab_sizes.h5", space + 8, BIG + BIG)
old_with("2018-11203_btree_division_by_zero.h5", tree + 6, b"\0\0")
old_with("2018-11204_object_header_chunk.h5", tree + 4, b"\xff\xff")
old_with("2018-11205_variable_length.h5", kind, b"\x19\x01\x00\x00\x10\x00\x00\x00")
old_with("2018-11206_old_and_new_fill.h5", fill, b"\x01\x01\x00\x01\xff\xff\xff\x7f")
old_with("2018-11207_chunk_of_zero.h5", layout + 11, b"\0\0\0\0\0\0\0\0")
old_with("2018-13866_size_of_address.h5", 13, b"\xff")
old_with("2018-13867_external_file_cache.h5", heap + 24, BIG)
old_with("2018-13868_fill_value_length.h5", fill + 4, b"\xff\xff\xff\xff")
old_with("2018-13869_link_overlap.h5", snod + 8, b"\xff" * 16)
old_with("2018-13870_name_beyond_the_heap.h5", snod + 8, struct.pack("<Q", 1 << 40))
old_with("2018-13871_shape_of_space.h5", space, b"\x02\xff\xff\xff")
old_with("2018-13872_group_entry.h5", snod + 6, b"\xff\xff")
old_with("2018-13873_header_message_count.h5", message(old, 1) - 24 + 2, b"\xff\xff")
old_with("2018-13874_shared_message.h5", kind - 4, b"\x02")
old_with("2018-13875_virtual_layout.h5", layout, b"\x04\x03")
old_with("2018-13876_driver_info.h5", 8 + 4 + 4 + 2 + 2 + 4 + 24, struct.pack("<Q", 4))
old_with("2018-14031_type_of_zero_members.h5", kind, b"\x16\x00\x00\x00")
old_with("2018-14033_layout_dimensions.h5", layout + 2, b"\xff")
old_with("2018-14034_index_of_pipeline.h5", message(old, 8), b"\x03\x02\xff")
old_with("2018-14035_array_index.h5", kind, b"\x2a\xff\xff\xff")
old_with("2018-14460_rank_of_space.h5", space + 1, b"\x21\x03")
old_with("2018-15671_recursion_of_paths.h5", snod + 8 + 16, struct.pack("<I", 2) + NONE[:4] + struct.pack("<I", 8))
old_with("2018-15672_chunk_division.h5", layout + 11, b"\0\0\0\0")
old_with("2018-16438_layout_of_deep_rank.h5", layout + 2, b"\x20")
old_with("2018-17233_hyperslab_of_empty.h5", space + 8, NONE)
old_with("2018-17234_header_continuation.h5", space - 8, b"\x10\x00\x10\x00\x00\0\0\0" + struct.pack("<QQ", 0, 1 << 40))
old_with("2018-17237_set_to_zero.h5", layout + 11, b"\xff\xff\xff\xff\0\0\0\0")
old_with("2018-17432_space_encode.h5", space + 1, b"\x20\x01")
old_with("2018-17433_compressed_reading.h5", layout, b"\x03\x01")
old_with("2018-17434_chunk_of_zero_rows.h5", layout + 11, NONE)
old_with("2018-17435_link_of_wrong_length.h5", heap + 16, BIG)
old_with("2018-17436_version_of_link.h5", snod + 4, b"\xff\xff")
old_with("2018-17437_recursive_type.h5", kind, b"\x1a" + b"\x1a\0\0\0" * 4)
old_with("2018-17438_type_of_size_zero.h5", kind + 4, NONE[:4])
old_with("2018-17439_extent_of_rank.h5", space + 1, b"\xfe\x00")
old_with("2019-8396_layout_version_and_rank.h5", layout, b"\x03\x02\xfe")
old_with("2019-8397_close_of_type.h5", kind, b"\x38\x00\x00\x00\x04\0\0\0\x00")
old_with("2019-8398_size_of_type.h5", kind + 4, b"\xff\xff\xff\x7f")
old_with("2019-9151_chunk_beyond_the_file.h5", tree + 24, BIG)
old_with("2019-9152_chunk_keys.h5", place(old, b"TREE", 1) + 24, b"\xff" * 32)
old_with("2020-10809_palette_of_attributes.h5", attribute + 4, b"\xff\xff")
old_with("2020-10810_closing_twice.h5", tree + 8, struct.pack("<Q", tree))
old_with("2020-10811_layout_decode.h5", layout + 3, struct.pack("<Q", len(old) - 2))
old_with("2020-10812_null_in_link_table.h5", snod + 8 + 8, NONE)
old_with("2020-18232_name_of_attribute.h5", attribute + 2, b"\xf8\xff")
old_with("2020-18494_truncated_superblock.h5", 24 + 16, struct.pack("<Q", 1 << 62))
old_with("2021-31009_version_of_superblock.h5", 8, b"\x01\x01\x01\x01")
old_with("2021-36977_attribute_data.h5", attribute + 6, b"\xff\x7f")
old_with("2021-37501_string_padding.h5", kind, b"\x13\xff\xff\xff\xff\xff\xff\xff")
old_with("2021-45829_driver_of_superblock.h5", 9, b"\xff\xff\xff\xff\xff")
old_with("2021-45830_attribute_size_large.h5", attribute + 4, b"\xff\xff\xff\xff")
old_with("2021-45832_recursion_of_btrees.h5", tree + 24 + 8, struct.pack("<Q", tree))
old_with("2021-45833_btree_of_level_255.h5", tree + 5, b"\xff")
old_with("2021-46242_heap_of_file.h5", heap + 24, struct.pack("<Q", heap))
old_with("2021-46243_reading_of_members.h5", kind, b"\x16\xff\x7f\x00\x08\0\0\0")
old_with("2021-46244_no_such_version.h5", layout, b"\x7f")
old_with("2024-29157_global_heap.h5", heap, b"GCOL\x01\0\0\0" + BIG)
old_with("2024-29158_btree_node_small.h5", tree + 6, b"\xff\xff")
old_with("2024-29160_heap_of_free_list.h5", heap + 16, struct.pack("<Q", 8))
old_with("2024-32605_variable_text_in_attribute.h5", attribute + 8, b"\x19\x01\x00\x00")
old_with("2024-32613_deflate_of_zero.h5", layout + 3, NONE)
old_with("2024-33874_message_longer_than_header.h5", kind - 6, b"\xf8\xff")
old_with("2024-33877_size_of_conversion.h5", kind + 4, b"\xff\xff\xff\xff")
old_with("2024-29163_bits_of_type.h5", kind + 8, b"\xff\xff\xff\xff")
old_with("2024-29165_checksum_of_three_bytes.h5", place(old, b"TREE", 1) + 24, struct.pack("<I", 3))
old_with("2024-32607_attribute_of_no_type.h5", attribute + 4, b"\0\0")
old_with("2024-32608_attribute_of_no_space.h5", attribute + 6, b"\0\0")
old_with("2024-32609_array_of_arrays.h5", kind, b"\x3a\0\0\0\xff\xff\xff\xff" * 2)
old_with("2024-32610_shared_type.h5", kind - 4, b"\x03")
old_with("2024-32612_free_list_of_heap.h5", heap + 16, struct.pack("<Q", (1 << 16) - 1))
old_with("2024-32614_layout_smaller_than_space.h5", layout + 3, struct.pack("<QQ", 96, 1))
old_with("2024-32616_compound_of_65535.h5", kind, b"\x36\xff\xff\x00\x04\0\0\0")
old_with("2024-32617_text_without_end.h5", attribute + 8, b"\xff" * 16)
old_with("2024-32618_member_beyond_its_type.h5", kind, b"\x16\x01\0\0\x04\0\0\0" + b"aaaaaaa\0" + b"\xff" * 4)
old_with("2024-32620_address_in_a_short_message.h5", kind - 6, b"\x08\0")
old_with("2024-32622_rank_and_no_sizes.h5", space + 1, b"\x20\x00")
old_with("2024-32623_fill_longer_than_its_type.h5", fill, b"\x02\x02\x02\x01\xff\xff\0\0")
old_with("2024-32624_fill_of_a_reference.h5", kind, b"\x17\x01\0\0\x0c\0\0\0")
old_with("2024-33873_chunk_larger_than_space.h5", layout + 11, b"\xff\xff\0\0\xff\xff\0\0")
old_with("2024-33875_layout_of_another_version.h5", layout, b"\x01")
old_with("2025-2309_precision_of_type.h5", kind + 8, b"\xff\0\x01\0")
old_with("2025-2310_name_of_attribute.h5", attribute + 2, b"\xff\x00")
old_with("2025-2912_version_of_header.h5", message(old, 1) - 24, b"\x02")
old_with("2025-2913_continuation_into_itself.h5", space - 8,
         struct.pack("<HHI", 16, 16, 0) + struct.pack("<QQ", space - 24, 64))
old_with("2025-2915_end_of_file.h5", 40, struct.pack("<Q", 100))
old_with("2025-2923_size_of_addresses.h5", 13, b"\x02")
old_with("2025-2924_free_block_at_the_end.h5", heap + 16, old[heap + 8:heap + 16])
old_with("2025-2925_heap_of_no_bytes.h5", heap + 8, NONE)
old_with("2025-2926_message_of_no_bytes.h5", space - 6, b"\0\0")
old_with("2025-6516_sizes_of_superblock.h5", 13, b"\x20\x20")
old_with("2025-6817_tree_at_its_own_place.h5", tree + 16, struct.pack("<Q", tree))
old_with("2025-6818_continuation_beyond_the_end.h5", space - 8,
         struct.pack("<HHI", 16, 16, 0) + struct.pack("<QQ", len(old) - 8, 1 << 20))
old_with("2025-6856_table_is_its_own_child.h5", tree + 24 + 8, struct.pack("<Q", snod - 8))
old_with("2025-6857_names_of_a_table.h5", snod + 8, struct.pack("<Q", 0xffffffff))
old_with("2025-6858_driver_block_is_the_root.h5", 48, struct.pack("<Q", 96))
old_with("2025-44904_space_larger_than_layout.h5", space + 8, struct.pack("<Q", 1 << 40))
old_with("2026-19024_negative_size_of_fill.h5", fill, b"\x02\x02\x02\x01\xff\xff\xff\xff")
old_with("2026-26200_conversion_of_members.h5", kind, b"\x26\x02\0\0\x04\0\0\0")


# --- what only files of other programs have: written by libhdf5, then damaged behind a signature ---

def made(name, change, signature, at, value, **how):
    path = folder / name
    with h5py.File(path, "w", **how) as target:
        change(target)
    data = bytearray(path.read_bytes())
    where = place(data, signature) + at
    data[where:where + len(value)] = value
    damaged(name, data)


def references(target):
    data = target.create_dataset("faces", data=numpy.zeros((4, 3), "<u4"))
    target.create_dataset("regions", (2,), h5py.regionref_dtype)[0] = data.regionref[[0, 2], :]


def texts(target):
    target.create_dataset("text", data=["one", "two"], dtype=h5py.string_dtype())


def many_attributes(target):
    for i in range(40):
        target.attrs[f"name_{i:02}"] = i


def many_links(target):
    for i in range(40):
        target.create_group(f"group_{i:02}")


def scale_offset(target):
    target.create_dataset("faces", data=numpy.arange(400, dtype="<u4").reshape(100, 4), chunks=(100, 4),
                          scaleoffset=12)


def freed(target):
    for i in range(30):
        target.create_dataset(f"{i}", data=numpy.zeros(1000 + i))
    for i in range(0, 30, 2):
        del target[f"{i}"]


GLOBAL_HEAP, SCALE, LATEST = b"GCOL", b"scaleoffset\0", {"libver": "latest"}
FREED = {"libver": "latest", "fs_strategy": "fsm", "fs_persist": True, "fs_threshold": 1}
made("2024-29159_scaleoffset_parameters.h5", scale_offset, SCALE, 16, b"\xff" * 16)
made("2024-29161_attributes_of_a_heap.h5", many_attributes, b"FRHP", 14, BIG, **LATEST)
made("2024-29162_object_of_global_heap.h5", references, GLOBAL_HEAP, 16, b"\xff" * 16)
made("2024-29164_reference_into_a_heap.h5", references, GLOBAL_HEAP, 24, BIG)
made("2024-29166_link_info.h5", many_links, b"OHDR", 16, b"\x02\xff\xff\xff\xff", **LATEST)
made("2024-32606_text_of_no_object.h5", texts, GLOBAL_HEAP, 16, NONE)
made("2024-32611_tree_of_attributes.h5", many_attributes, b"BTHD", 6, b"\xff" * 12, **LATEST)
made("2024-32615_nbit_parameters.h5", scale_offset, SCALE, -8, b"\x05\0")
made("2024-32619_heap_of_another_type.h5", references, GLOBAL_HEAP, 8, NONE)
made("2024-32621_length_in_global_heap.h5", texts, GLOBAL_HEAP, 24, BIG)
made("2024-33876_points_of_a_region.h5", references, GLOBAL_HEAP, 32, b"\x01\0\0\0" + b"\xff" * 28)
made("2025-2153_table_of_shared_messages.h5", many_attributes, b"\x89HDF", 20, struct.pack("<Q", 48), **LATEST)
made("2025-2308_bits_of_scaleoffset.h5", scale_offset, SCALE, 20, b"\x09\xff\xff\xff")
made("2025-2914_section_of_free_space.h5", freed, b"FSSE", 13, b"\xff" * 16, **FREED)
made("2025-6269_cache_image.h5", freed, b"FSHD", -8, b"MDCI\0\0\0\0", **FREED)
made("2025-6270_sections_that_overlap.h5", freed, b"FSSE", 13, b"\0" * 16, **FREED)
made("2025-6750_message_of_time.h5", many_links, b"OHDR", 16, b"\x12\0\0\0", **LATEST)
made("2025-6816_info_of_free_space.h5", freed, b"FSHD", 8, b"\xff" * 24, **FREED)
made("2025-7067_class_of_free_space.h5", freed, b"FSHD", 5, b"\xff", **FREED)
made("2025-7068_count_of_sections.h5", freed, b"FSHD", 14, BIG, **FREED)
made("2025-7069_size_of_sections.h5", freed, b"FSHD", 30, BIG, **FREED)
made("2025-44905_minimum_of_scaleoffset.h5", scale_offset, SCALE, 24, b"\xff\xff\xff\x7f")
made("2026-19023_text_of_two_elements.h5", texts, GLOBAL_HEAP, 40, b"\xff" * 16)


# --- what this format calls for, written by others ---

def external(target):
    del target["mesh/faces"]
    target["mesh"].create_dataset("faces", (4, 3), "<u4", external=[("/etc/passwd", 0, 48)])


def virtual(target):
    source = h5py.VirtualSource("/etc/passwd.h5", "faces", (4, 3), "<u4")
    sheet = h5py.VirtualLayout((4, 3), "<u4")
    sheet[:] = source
    del target["mesh/faces"]
    target.create_virtual_dataset("mesh/faces", sheet)


def linked(target):
    del target["mesh/faces"]
    target["mesh/faces"] = h5py.ExternalLink("/etc/passwd.h5", "/faces")


def variable(target):
    target.attrs["kind"] = "solid"


def scaled(target):
    del target["mesh/faces"]
    target["mesh"].create_dataset("faces", data=numpy.zeros((4, 3), "<u4"), chunks=(4, 3), scaleoffset=2)


for name, change in (("external_storage", external), ("virtual_dataset", virtual), ("external_link", linked),
                     ("text_of_variable_length", variable), ("scaleoffset", scaled)):
    write_old(f"old_{name}.h5", change)
shutil.move(folder / "old_good.h5", folder / "2021-46244_superblock_version_0.h5")


# --- the metadata of this format, checksums made good ---

new = bytearray(good.read_bytes())
headers = []  # begin, first message, end
at = new.find(b"OHDR")
while at >= 0:
    flags = new[at + 5]
    first = at + 6 + (16 if flags & 32 else 0) + (4 if flags & 16 else 0) + (1 << (flags & 3))
    size = int.from_bytes(new[first - (1 << (flags & 3)):first], "little")
    headers.append((at, first, first + size, flags))
    at = new.find(b"OHDR", at + 4)


def messages(kind):
    for begin, first, end, flags in headers:
        at = first
        while at + 4 <= end:
            size = struct.unpack_from("<H", new, at + 1)[0]
            body = at + 4 + (2 if flags & 4 else 0)
            if new[at] == kind:
                yield begin, at, body, size, end
            at = body + size


def new_with(name, found, where, value):
    begin, at, body, size, end = found
    data = bytearray(new)
    to = {"type": at, "size": at + 1, "flags": at + 3}.get(where, None)
    to = body + where if to is None else to
    data[to:to + len(value)] = value
    struct.pack_into("<I", data, end, lookup3(bytes(data[begin:end])))
    damaged("new_" + name + ".h5", data)


def superblock_with(name, at, value):
    data = bytearray(new)
    data[at:at + len(value)] = value
    struct.pack_into("<I", data, 44, lookup3(bytes(data[:44])))
    damaged("new_" + name + ".h5", data)


first = lambda kind: next(messages(kind))
new_with("2016-4330_rank_of_dataspace", first(1), 1, b"\xff")
new_with("2016-4332_message_flags", first(1), "flags", b"\x02")
new_with("2016-4333_array_type", first(3), 0, b"\x1a")
new_with("2017-17508_type_of_size_zero", first(3), 4, b"\0\0\0\0")
new_with("2018-11203_chunk_of_zero", first(8), 5, b"\0")
new_with("2018-11206_fill_of_4_gib", first(5), 0, b"\x03\x29\xff\xff\xff\x7f")
new_with("2018-13875_virtual_layout", first(8), 1, b"\x03")
new_with("2018-14460_rank_33", first(1), 1, b"\x21")
new_with("2018-17234_continuation_of_itself", first(10), "type", b"\x10")
new_with("2018-17432_huge_extent", first(1), 4, BIG)
new_with("2019-8396_layout_rank", first(8), 3, b"\xfe")
new_with("2021-37501_type_of_4_gib", first(3), 4, b"\xff\xff\xff\xff")
new_with("2021-46244_version_of_layout", first(8), 0, b"\x7f")
new_with("2024-33874_message_longer_than_header", first(3), "size", b"\xff\xff")
new_with("2024-29157_shared_message", first(3), "flags", b"\x02")
for kind, what in ((11, "pipeline_of_255_filters"), (12, "attribute_of_long_name")):
    if any(messages(kind)):
        new_with(what, first(kind), 1 if kind == 11 else 2, b"\xff\xff"[:1 if kind == 11 else 2])
if any(messages(11)):
    for report, filter_id in (("2024-29159_scaleoffset", 6), ("2024-29165_fletcher32_twice", 3),
                              ("2024-32615_nbit", 5), ("2024-33873_szip", 4)):
        new_with(report, first(11), 2, struct.pack("<H", filter_id))
new_with("2024-29163_bits_of_type", first(3), 8, b"\xff\xff\xff\xff")
new_with("2024-29166_link_info", first(1), "type", b"\x02")
new_with("2024-32614_layout_beyond_the_end", first(8), first(8)[3] - 8, BIG)
new_with("2024-32616_compound", first(3), 0, b"\x36\xff\xff\0")
new_with("2024-32621_variable_length", first(3), 0, b"\x19\x01\0\0")
new_with("2024-32622_rank_and_no_sizes", first(1), 1, b"\x00")
new_with("2024-32624_reference", first(3), 0, b"\x17\x01\0\0\x0c\0\0\0")
new_with("2025-2309_precision", first(3), 8, b"\xff\0\x01\0")
if any(messages(12)):
    new_with("2025-2310_name_of_attribute", first(12), 2, b"\xff\xff")
    new_with("2024-32607_attribute_of_no_type", first(12), 4, b"\0\0")
    new_with("2024-32608_attribute_of_no_space", first(12), 6, b"\0\0")
new_with("2025-2926_message_of_no_bytes", first(1), "size", b"\0\0")
new_with("2025-6818_continuation_beyond_the_end", first(3), "type", b"\x10")
superblock_with("2025-2153_extension_is_the_root", 20, bytes(new[36:44]))
superblock_with("2018-13866_size_of_address", 9, b"\xff\xff")
superblock_with("2021-31009_version_4", 8, b"\x04")
superblock_with("end_beyond_the_file", 28, BIG)
superblock_with("root_beyond_the_file", 36, struct.pack("<Q", 1 << 62))
superblock_with("root_is_the_superblock", 36, NONE)
superblock_with("base_of_4_gib", 12, struct.pack("<Q", 1 << 32))
superblock_with("extension", 20, struct.pack("<Q", 48))
print(len(list(folder.iterdir())), "files")
