#!/usr/bin/env python3
"""The shared library exports exactly what the public headers declare with EBPO_API: test_exports.py LIBEBPO SOURCE_ROOT"""
import pathlib
import re
import subprocess
import sys

library, root = sys.argv[1], pathlib.Path(sys.argv[2])
declared = set()
for header in (root / "lib/include/ebpo").glob("*.h"):
    text = re.sub(r"/\*.*?\*/", "", header.read_text(), flags=re.S)
    text = re.sub(r"^#(.*\\\n)*.*$", "", text, flags=re.M)
    declared |= set(re.findall(r"EBPO_API\b[^;]*?\b(ebpo_\w+)\s*\(", text))
output = subprocess.run(["nm", "-D", "--defined-only", library], check=True, capture_output=True, text=True).stdout
exported = {line.split()[2] for line in output.splitlines() if len(line.split()) == 3}
exported = {name for name in exported if not name.startswith(("_", "__"))}
problems = [f"declared, not exported: {name}" for name in sorted(declared - exported)]
problems += [f"exported, not declared: {name}" for name in sorted(exported - declared)]
print("\n".join(problems) or f"{len(exported)} public functions")
sys.exit(1 if problems else 0)
