#!/usr/bin/env python3
"""test_array_table.py SOURCE: what is said of arrays in other languages says the same as the
library's table, row by row:
the specification's sections 6 and 9, and its reader in Python."""
import pathlib
import re
import sys

SIZES = {"uint8_t": (1, False), "uint16_t": (2, False), "uint32_t": (4, False),
         "uint64_t": (8, False),
         "int8_t": (1, True), "int16_t": (2, True), "int32_t": (4, True), "int64_t": (8, True)}


def table(text):
    """[(name, sizes, signed)], in order; and the names of arrays that are held in memory."""
    rows, held = [], []
    for kind, inside in re.findall(r"^(LEVEL_ARRAY|LEVEL_INDEX|ROOT_ARRAY)\((.*?)\)\n",
                                   re.sub(r"\n +", " ", text), re.M):
        cells = [cell.strip() for cell in inside.split(",")]
        name = cells[1].strip('"')
        stored = {"LEVEL_ARRAY": 4, "ROOT_ARRAY": 3}.get(kind)
        sizes = [8] if stored is None else [int(n) for n in cells[stored].split("+")]
        rows.append((name, sizes, kind == "LEVEL_ARRAY" and SIZES[cells[3]][1]))
        if kind == "LEVEL_ARRAY":
            held.append(name)
    return rows, held


def of_specification(text):
    return rows_of("".join(re.search(rf"^## {number}\. .*?^## {number + 1}\. ", text, re.M | re.S).group(0)
                           for number in (6, 9)))


def of_annex(text, group):
    return [row for row in rows_of(text) if row[0].startswith(group)]


def rows_of(section):
    rows = []
    for name, types in re.findall(r"^\| `([\w/]+)` \| ([^|]*) \|", section, re.M):
        found = re.findall(r"\b([ui])(8|16|32|64)\b", types)
        if found:
            rows.append((name, [int(bits) // 8 for _, bits in found], found[0][0] == "i"))
    return rows


def compare(where, rows, wanted):
    problems = [f"{where}: no row for {row[0]}, which is a row of array_table.inc" for row in wanted
                if row[0] not in [r[0] for r in rows]]
    problems += [f"{where}: {row[0]} is no row of array_table.inc" for row in rows
                 if row[0] not in [r[0] for r in wanted]]
    if not problems and [r[0] for r in rows] != [r[0] for r in wanted]:
        problems.append(f"{where}: another order than array_table.inc")
    return problems or [f"{where}: {a[0]} has sizes {a[1]}, signed {a[2]}; array_table.inc says "
                        f"{b[1]}, {b[2]}"
                        for a, b in zip(rows, wanted) if a != b]


def check_codings(root, text):
    """Each array's coding: in the specification's section 9, and in its reader."""
    wanted = {}
    for _, inside in re.findall(r"^(LEVEL_ARRAY|ROOT_ARRAY)\((.*?)\)\n", re.sub(r"\n +", " ", text),
                                re.M):
        name, coding = re.findall(r'^\w+, "?([\w/]+)"?,.*?"(plain|delta|skips|high-water|gap)"',
                                  inside)[0]
        if coding != "plain":
            wanted[name] = coding
    section = re.search(r"^## 9\. .*?^## 10\. ", (root / "format-spec/README.md").read_text(),
                        re.M | re.S).group(0)
    said = {name: coding for coding, names in re.findall(r"^\| `([\w-]+)` \| ([^|]*) \|", section, re.M)
            for name in re.findall(r"`([\w/]+)`", names.split(";")[0]) if coding != "gates"}
    others = [] if "| `gates` | `/mesh/faces`;" in section else \
        ["format-spec/README.md, section 9: gates is not a coding of /mesh/faces"]
    python = re.search(r"^CODINGS = .*?\}$", (root / "format-spec/read_ebpo.py").read_text(),
                       re.M | re.S).group(0)
    found = {"format-spec/README.md, section 9": said,
             "format-spec/read_ebpo.py":
             {name if name.startswith("leaf") else "/" + name: coding
              for name, coding in re.findall(r'"([\w/]+)": \("([\w-]+)"', python)}}
    others += [f"{place}: gates is not known" for place, form in
               (("format-spec/read_ebpo.py", '("gates",) if gates'),)
               if form not in (root / place).read_text()]
    return others + [f"{place}: codings are {codings}; array_table.inc says {wanted}"
                     for place, codings in found.items() if codings != wanted]


def check_parts(root):
    """Each part has a word in files, in the tools and in the npm package, and a need in the
    table."""
    parts = re.findall(r"^    EBPO_PART_(\w+) = \d+",
                       (root / "lib/include/ebpo/file.h").read_text(), re.M)
    places = {"lib/format/schema.h": "EBPO_NEEDS_{0} = EBPO_PART_{0},",
              "lib/format/head_facts.c": ", EBPO_PART_{0}, ",
              "tools/cli/words.c": '"{1}"', "tools/npm/ebpo/parts.js": "'{1}'",
              "format-spec/README.md": "| `{1}` |"}
    return [f"{place}: part {part} is not named" for part in parts for place, form in places.items()
            if form.format(part, part.lower().replace("_", "-")) not in (root / place).read_text()]


def main():
    root = pathlib.Path(sys.argv[1])
    rows, held = table((root / "lib/format/array_table.inc").read_text())
    if len(rows) < 20:
        sys.exit(f"only {len(rows)} rows found in array_table.inc: this test no longer reads it")
    problems = compare("format-spec/README.md, section 6, and annexes K and L",
                       of_specification((root / "format-spec/README.md").read_text()) +
                       of_annex((root / "format-spec/border.md").read_text(), "/border/") +
                       of_annex((root / "format-spec/surface.md").read_text(), "/surface/"), rows)
    reader = (root / "format-spec/read_ebpo.py").read_text()
    problems += [f"format-spec/read_ebpo.py: {name} is not read" for name in held
                 if f'"{name}"' not in reader]
    problems += check_parts(root)
    problems += check_codings(root, (root / "lib/format/array_table.inc").read_text())
    print("\n".join(problems) or f"{len(rows)} arrays, the same everywhere")
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
