#!/usr/bin/env python3
"""Each selection of the library's table is in the specification, and in the manual and the help of
--select."""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
table = (root / "lib/format/head_facts.c").read_text(encoding="utf-8")
names = re.findall(r'\.name = "(\w+)"', table)
spec = next(line for line in (root / "format-spec/README.md").read_text(encoding="utf-8").splitlines()
            if line.startswith("| `selection`"))


def record(name):
    """What tools/cli/options says of the option --select of a command."""
    text = (root / f"tools/cli/options/{name}.options").read_text(encoding="utf-8")
    return re.search(r"^option select .*?(?:\n\n|\Z)", text, re.MULTILINE | re.DOTALL).group()


texts = {name: record(name) for name in ("convert", "report")}
missing = []
for name in names:
    if name != "inherit" and f"`{name}`" not in spec:
        missing.append(f"format-spec/README.md, section 5, selection: `{name}` is missing")
    for command, text in texts.items():
        words, in_help, manual = (set(re.findall(r"\w+", part)) for part in (
            re.search(r"^  (?:word|set) (.*)", text, re.MULTILINE).group(1),
            re.search(r"^  help (.*(?:\n    .*)*)", text, re.MULTILINE).group(1),
            " ".join(re.findall(r"^\.Cm (\w+)", text, re.MULTILINE))))
        missing += [f"tools/cli/options/{command}.options, select: {name} is missing in {place}"
                    for place, found in (("its words", words), ("its help", in_help),
                                         ("the manual", manual)) if name not in found]
print("\n".join(missing) or f"{len(names)} selections are documented")
sys.exit(1 if missing or len(names) < 4 else 0)
