#!/usr/bin/env python3
"""Checks that links in Markdown have targets: test_links.py ROOT."""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
skipped = {"node_modules", ".git"}
pages = [p for p in root.rglob("*.md")
         if not skipped & set(p.parts) and not any(part.startswith("build")
                                                   for part in p.relative_to(root).parts)]
problems = []
for page in pages:
    for link in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
        if "://" not in link and not (page.parent / link).exists():
            problems.append(f"{page.relative_to(root)}: {link} is not there")
print("\n".join(problems) or f"{len(pages)} pages: all links lead somewhere")
sys.exit(1 if problems else 0)
