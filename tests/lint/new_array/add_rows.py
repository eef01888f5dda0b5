#!/usr/bin/env python3
"""add_rows.py FROM TO: a copy of file.h or array_table.inc with two arrays more, as somebody adds
them who follows the recipe:
one for each leaf, which may be absent, and one for each plane of a leaf, which the part calls
for."""
import pathlib
import re
import sys

ADDED = {
    "file.h": (r"    uint32_t \*gray_colours;[^\n]*\n",
               "    uint8_t *leaf_mark;    /* [leaf_count], NULL: all 0 */\n"
               "    uint32_t *plane_share; /* [leaf_plane_count] */\n"),
    "array_table.inc": (r"LEVEL_ARRAY\(GRAY_COLOURS,[^)]*\)\n",
                        'LEVEL_ARRAY(LEAF_MARK, leaf_mark, leaf_mark, uint8_t, 1, LEAF, ALWAYS, '
                        '"plain", WITH_DEFAULT(0), 1, "a mark")\n'
                        'LEVEL_ARRAY(PLANE_SHARE, plane_share, plane_share, uint32_t, 1 + 2 + 4, '
                        'LEAF_PLANE, LEAF_PLANES, "plain",\n'
                        '            REQUIRED, 1, "faces behind each plane")\n'),
}

source, target = map(pathlib.Path, sys.argv[1:])
after, added = ADDED[source.name]
text, count = re.subn(after, lambda m: m.group(0) + added, source.read_text())
if count != 1:
    sys.exit(f"{source}: {count} places for a new array; the pattern in add_rows.py is out of date")
target.write_text(text)
