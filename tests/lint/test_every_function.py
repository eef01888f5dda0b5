#!/usr/bin/env python3
"""Checks that tests/unit/every_call_*.c calls every function of the headers: test_every_function.py SOURCE_ROOT"""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])


def code(path):
    return re.sub(r"/\*.*?\*/", "", path.read_text(), flags=re.S)


declared = set()
for header in (root / "lib/include/ebpo").glob("*.h"):
    declared |= set(re.findall(r"^EBPO_API\b[^;]*?\b(ebpo_\w+)\s*\(", code(header), flags=re.M))
called = set()
for calls in (root / "tests/unit").glob("every_call_*.c"):
    called |= set(re.findall(r"\b(ebpo_\w+)\s*\(", code(calls)))
for name in sorted(declared - called):
    print(f"{name}: not called by tests/unit/every_call_*.c, which owe each public function a call")
sys.exit(not declared or bool(declared - called))
