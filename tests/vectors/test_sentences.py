#!/usr/bin/env python3
"""test_sentences.py SOURCE: what a failed vector's .txt says that it violates stands in that
section of the specification, and every chapter that the text refers to is there."""
import pathlib
import re
import sys

folder = pathlib.Path(sys.argv[1]) / "format-spec"
text = (folder / "README.md").read_text()
sections = {match.group(1): " ".join(match.group(0).split())
            for match in re.finditer(r"^## (\d+)\. .*?(?=^## |\Z)", text, re.M | re.S)}
problems, vectors = [], sorted((folder / "vectors" / "failed").glob("*.txt"))
for vector in vectors:
    found = re.search(r'^Violates section (\d+): "(.+)"$', vector.read_text(), re.M)
    if not found:
        problems.append(f"{vector.name} does not say what it violates")
    elif " ".join(found.group(2).split()) not in sections.get(found.group(1), ""):
        problems.append(f"{vector.name}: section {found.group(1)} does not say: {found.group(2)}")
for page in (folder / "README.md", folder / "building.md"):
    anchors = {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")
               for title in re.findall(r"^#+ (.*)$", page.read_text(), re.M)}
    problems += [f"{page.name}: no heading for #{anchor}"
                 for anchor in re.findall(r"\]\(#([^)]*)\)", page.read_text())
                 if anchor not in anchors]
if len(vectors) < 80:
    problems.append(f"only {len(vectors)} failed vectors")
print("\n".join(problems) or f"{len(vectors)} sentences")
sys.exit(1 if problems else 0)
