#!/usr/bin/env python3
"""Each selection of the library's table is in the specification and in convert's man page."""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
table = (root / "lib/planes/selections.c").read_text(encoding="utf-8")
names = re.findall(r'\.name = "(\w+)"', table)
texts = {page: (root / page).read_text(encoding="utf-8")
         for page in ("format-spec/README.md", "tools/man/ebpo-convert.1")}
missing = [f"{page}: the selection '{name}' is missing"
           for name in names if name != "inherit"
           for page, text in texts.items() if not re.search(rf"\b{name}\b", text)]
print("\n".join(missing) or f"{len(names)} selections are documented")
sys.exit(1 if missing or len(names) < 4 else 0)
