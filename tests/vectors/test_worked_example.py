#!/usr/bin/env python3
"""test_worked_example.py SOURCE [--update]: compares the worked example of format-spec/vectors/README.md
with its vector: offsets of chunks, and their contents. --update corrects offsets and sizes only."""
import pathlib
import re
import struct
import sys

import h5py

CHECKSUM = 4  # fletcher32, behind each chunk
source, update = pathlib.Path(sys.argv[1]), "--update" in sys.argv
page = source / "format-spec" / "vectors" / "README.md"
text = page.read_text()
begin, end = text.index("## 1. "), text.index("## 2. ")
section = text[begin:end]
vector = page.parent / re.search(r"\[(passed/\S+)\]", section).group(1)


def bytes_of(cell):
    """`02 00` and `0000007f` are bytes; single digits are numbers, u32."""
    words = re.search(r"`([^`]*)`", cell).group(1).split()
    if all(len(word) == 1 for word in words):
        return b"".join(struct.pack("<I", int(word)) for word in words)
    return bytes.fromhex("".join(words))


rows = []  # [line, offset, path, bytes]
for line in re.findall(r"^\|.*\|$", section, re.M)[2:]:
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    if cells[0]:
        rows.append([line, int(cells[0]), cells[1].strip("`"), b""])
    rows[-1][3] += bytes_of(cells[2])

problems, mended, present = [], section, []
with h5py.File(vector, "r") as file:
    file.visititems(lambda name, item:
                    present.append("/" + name) if isinstance(item, h5py.Dataset) else None)
    for line, offset, path, content in rows:
        chunk = file[path].id.get_chunk_info(0)
        stored = vector.read_bytes()[chunk.byte_offset:chunk.byte_offset + chunk.size - CHECKSUM]
        if content != stored:
            problems.append(f"{path}: the page has {content.hex(' ')}, the file {stored.hex(' ')}")
        if offset != chunk.byte_offset:
            problems.append(f"{path}: the page says {offset}, it lies at {chunk.byte_offset}")
            mended = mended.replace(line, line.replace(str(offset), str(chunk.byte_offset), 1))
    head = file[rows[0][2]].id.get_chunk_info(0).byte_offset
if sorted(present) != sorted(row[2] for row in rows):
    problems.append(f"the file has {sorted(present)}")
sizes = f"{vector.stat().st_size:,} bytes of which {head:,}"
if sizes not in section:
    problems.append(f"the page does not say: {sizes}")
    mended = re.sub(r"[\d,]+ bytes of which [\d,]+", sizes, mended)
if update:
    page.write_text(text[:begin] + mended + text[end:])
elif problems:
    print(f"{page}, section 1, and {vector.name}:", *problems, sep="\n  ")
    print("After a change that is meant: tests/vectors/test_worked_example.py . --update")
    sys.exit(1)
