#!/usr/bin/env python3
"""Each selection of the library's table is in the specification, man pages and help texts."""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
table = (root / "lib/planes/selections.c").read_text(encoding="utf-8")
names = re.findall(r'\.name = "(\w+)"', table)
spec = next(line for line in (root / "format-spec/README.md").read_text(encoding="utf-8").splitlines()
            if line.startswith("| `selection`"))
pages = {name: set(re.findall(r"^\.Cm (\w+)", (root / name).read_text(encoding="utf-8"), re.MULTILINE))
         for name in ("tools/man/ebpo-convert.1", "tools/man/ebpo-report.1")}
helps = {name: (root / name).read_text(encoding="utf-8")
         for name in ("tools/cmd/cmd_convert.c", "tools/cmd/cmd_report.c")}
missing = []
for name in names:
    if name != "inherit" and f"`{name}`" not in spec:
        missing.append(f"format-spec/README.md, section 3, selection: `{name}` is missing")
    missing += [f"{page}: .Cm {name} is missing" for page, words in pages.items() if name not in words]
    missing += [f"{source}: the help of --select does not name {name}" for source, text in helps.items()
                if not re.search(rf"\b{name}\b", text)]
print("\n".join(missing) or f"{len(names)} selections are documented")
sys.exit(1 if missing or len(names) < 4 else 0)
