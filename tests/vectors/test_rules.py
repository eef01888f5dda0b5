#!/usr/bin/env python3
"""test_rules.py SOURCE: compares the numbered rules of the specification with the failed vectors.

Each number is defined once. Each failed vector states an existing number. Each rule has a vector, or
is in the table of rules without one, but not both. The core has at most 4,500 words. References to
headings and rules lead somewhere."""
import collections
import pathlib
import re
import sys

MOST_WORDS = 4500
folder = pathlib.Path(sys.argv[1]) / "format-spec"
vectors_page = folder / "vectors" / "README.md"
pages = [folder / f"{name}.md" for name in (
    "README", "gates", "subtrees", "attributes", "colours", "border", "surface", "checksums", "history",
    "hdf5-messages", "reasons", "building")] + [vectors_page]
RULE = r"R(?:\d+|[A-L])\.\d+"
problems = []

defined, mentioned = collections.Counter(), {}
for page in pages:
    text = page.read_text()
    defined.update(re.findall(rf"\*\*({RULE})\*\*", text))
    mentioned.update({rule: page.name for rule in re.findall(rf"\b{RULE}\b", text)})
problems += [f"{rule} is defined {count} times" for rule, count in defined.items() if count > 1]
problems += [f"{page}: {rule} is not defined" for rule, page in mentioned.items()
             if rule not in defined]

table = vectors_page.read_text().split("Rules without a vector:")[1]
without = re.findall(rf"^\| ({RULE}) \| \S.* \|$", table, re.M)
cited = {}
for vector in sorted((folder / "vectors" / "failed").glob("*.ebpo.h5")):
    reason = vector.with_name(vector.name.replace(".ebpo.h5", ".txt"))
    found = re.search(rf"^Breaks ({RULE})$", reason.read_text() if reason.exists() else "", re.M)
    if not found:
        problems.append(f"{vector.name}: no rule is stated")
    elif found.group(1) not in defined:
        problems.append(f"{vector.name}: {found.group(1)} is not defined")
    else:
        cited[found.group(1)] = vector.name
problems += [f"{rule} has no vector and is not listed as such" for rule in defined
             if rule not in cited and rule not in without]
problems += [f"{rule} is listed as without a vector, but {cited[rule]} breaks it" for rule in without
             if rule in cited]
problems += [f"{rule} is listed as without a vector, but is not defined" for rule in without
             if rule not in defined]


def anchors(page):
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")
            for title in re.findall(r"^#+ (.*)$", page.read_text(), re.M)}


for page in pages:
    for target, anchor in re.findall(r"\]\(([^)#\s]*)#([^)]*)\)", page.read_text()):
        path = (page.parent / target).resolve() if target else page
        if "://" not in target and path.exists() and anchor not in anchors(path):
            problems.append(f"{page.name}: no heading for {target}#{anchor}")
words = len(pages[0].read_text().split())
if words > MOST_WORDS:
    problems.append(f"README.md has {words} words, at most {MOST_WORDS}")
if len(defined) < 90 or len(cited) < 70:
    problems.append(f"only {len(defined)} rules and {len(cited)} with vectors were found")
print("\n".join(problems) or f"{len(defined)} rules, {len(cited)} with vectors, {words} words")
sys.exit(1 if problems else 0)
