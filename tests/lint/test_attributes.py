#!/usr/bin/env python3
"""test_attributes.py SOURCE: the specification's tables of root attributes have each one that the
library writes, with its type, whether it is required, and how long a text may be."""
import pathlib
import re
import sys

KINDS = {"TEXT": ("text", "yes"), "NOTE": ("text", "no"), "DIGEST": ("text", "yes"),
         "WORD": ("text", "yes"), "COUNT": ("u64", "yes"), "COUNT32": ("u64", "yes"),
         "YES_NO": ("u64", "yes"), "HINT": ("u64", "no"), "NUMBER": ("i64", "yes"),
         "INTEGER": ("i64", "yes"), "REAL": ("f64", "yes"), "REAL3": ("f64[3]", "yes")}
# of some files only: the table says in words when
SOME = ("selection_percent", "selection_k_root", "selection_seed", "subtree_level", "colours_sha256",
        "mend_dropped_faces", "mend_weld_distance", "mend_weld_moved", "mend_collapsed_faces")

root = pathlib.Path(sys.argv[1])
section = re.search(r"^## 5\. .*?^## 6\. ", (root / "format-spec/README.md").read_text(),
                    re.M | re.S).group(0) + (root / "format-spec/border.md").read_text() + (root / "format-spec/surface.md").read_text()
said = {}
for row in re.findall(r"^\| (`.*) \|$", section, re.M):
    cells = [cell.strip() for cell in row.split("|")]
    if len(cells) == 4:
        cells = [cells[0], cells[1].rstrip("?"), "no" if cells[1].endswith("?") else "yes", cells[2]]
        said.update({name: cells for name in re.findall(r"`([a-z0-9_]+)`", cells[0])})
table = (root / "lib/format/head_facts.c").read_text()
written = dict(re.findall(r'\{ "(\w+)", FACT_(\w+),', table))
room = {name: int(size) - 1 for name, size in
        re.findall(r"\b(\w+)\[(\d+)\][,;]", (root / "lib/include/ebpo/file.h").read_text())}
problems = []
for name, kind in written.items():
    if name in ("pruned", "gray_volume", "leaf_volume"):
        continue  # of a level
    kind_said, required = KINDS[kind]
    if name not in said:
        problems.append(f"{name}: no row")
    elif said[name][1] != kind_said or (name not in SOME and said[name][2] != required):
        problems.append(f"{name}: {said[name][1:3]}, and it is {kind_said}, required: {required}")
    elif kind in ("TEXT", "NOTE") and not said[name][3].endswith(f".. {room[name]:,}"):
        problems.append(f"{name}: {said[name][3]}, and the library has room for {room[name]} bytes")
for source in ("head_facts.c",):
    named = re.findall(r'(?:put|get)_\w+\([^;]*?"([a-z0-9_]+)"',
                       (root / "lib/format" / source).read_text())
    problems += [f"{name} ({source}): no row" for name in set(named)
                 if name not in said and "_" in name]
if len(written) < 50:
    problems.append(f"only {len(written)} attributes found in head_facts.c")
print("\n".join(problems) or f"{len(written)} attributes, all in the table")
sys.exit(1 if problems else 0)
