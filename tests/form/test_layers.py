#!/usr/bin/env python3
"""Modules include downward only: lib/layers.txt says which module stands on which layer, siblings do not include each other,
only h5 includes <hdf5.h> and only http <curl/curl.h>, and only base and the public headers are included from everywhere."""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1]) / "lib"
layer = {}
for line in (root / "layers.txt").read_text().splitlines():
    if line and not line.startswith("#"):
        number, module = line.split()
        layer[module] = int(number)

problems = []
modules = [d for d in root.iterdir() if d.is_dir() and d.name != "include"]
for module in modules:
    if module.name not in layer:
        problems.append(f"lib/{module.name} has no layer in layers.txt")
        continue
    for source in sorted(module.rglob("*.[ch]")):
        for number, line in enumerate(source.read_text().splitlines(), 1):
            found = re.match(r'\s*#\s*include\s+(["<])([^">]+)[">]', line)
            if not found:
                continue
            name = found.group(2)
            place = f"{source.relative_to(root.parent)}:{number}"
            if name.startswith("hdf5") and module.name != "h5":
                problems.append(f"{place}: only lib/h5 includes {name}")
            if name.startswith("curl/") and module.name != "http":
                problems.append(f"{place}: only lib/http includes {name}")
            if found.group(1) == '"' and "/" in name:
                other = name.split("/")[0]
                if other == module.name or other not in layer:
                    continue
                if layer[other] >= layer[module.name]:
                    problems.append(f"{place}: {module.name} (layer {layer[module.name]}) includes {name} (layer {layer[other]})")
print("\n".join(problems) or f"{len(modules)} modules include downward only")
sys.exit(1 if problems else 0)
