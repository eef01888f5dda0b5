#!/usr/bin/env python3
"""test_versions.py SOURCE_ROOT: checks that all files have the version of meson.build.

Headers, packages and prose are read without Meson, so they cannot ask it."""
import json
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])


def text(name):
    return (root / name).read_text(encoding="utf-8")


def only(pattern, name):
    found = re.findall(pattern, text(name), re.MULTILINE)
    return found[0] if found else f"nothing like {pattern}"


version = only(r"^  version: '(\d+\.\d+\.\d+)'", "meson.build")
base = "lib/include/ebpo/base.h"
parts = [only(rf"^#define EBPO_VERSION_{part} (\d+)$", base) for part in ("MAJOR", "MINOR", "PATCH")]
lock = json.loads(text("tools/web/package-lock.json"))
repeated = {
    base: ".".join(parts),
    "CHANGELOG.md": only(r"^## (\d+\.\d+\.\d+)", "CHANGELOG.md"),
    "README.md": only(r"^The library is (\d+\.\d+\.\d+)", "README.md"),
    "tools/web/package.json": json.loads(text("tools/web/package.json"))["version"],
    "tools/web/package-lock.json": lock["version"],
    "tools/web/package-lock.json, packages": lock["packages"][""]["version"],
}
wrong = {name: said for name, said in repeated.items() if said != version}
for name, said in wrong.items():
    print(f"{name}: {said}, but meson.build says {version}")

# Who may do what with a public header is said in it: it leaves the project.
for header in sorted((root / "lib/include/ebpo").glob("*.h")):
    if not header.read_text(encoding="utf-8").startswith("/* SPDX-License-Identifier: MIT\n"):
        wrong[header.name] = True
        print(f"{header.name}: begins without '/* SPDX-License-Identifier: MIT'")
print(f"version {version}: {len(repeated)} places, {len(wrong)} wrong")
sys.exit(1 if wrong else 0)
