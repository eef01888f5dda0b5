#!/usr/bin/env python3
"""components_agree.py TOOL WHOLE.ebpo.h5 FOLDER: checks the output of `ebpo convert --split-components`.

Each face of the whole is in one component, with its number in the whole. Intersections in the scene equal
those that `ebpo collide --self` finds between components in the whole. No two components may have a vertex
at one position, because `collide --self` takes their faces for neighbours. Prints the counts.
"""
import itertools
import json
import subprocess
import sys

tool, whole, folder = sys.argv[1:]


def run(*arguments, text=None):
    done = subprocess.run([tool, *arguments], input=text, capture_output=True, check=True,
                          encoding="utf-8")
    return done.stdout


def faces_of(path):
    return json.loads(run("box", "--json", path, text="-1e30 -1e30 -1e30 1e30 1e30 1e30\n"))


def pairs_of(lines):
    """Returns (lower face, higher face, relation of the two)."""
    return {(*sorted(map(int, line.split()[:2])), line.split()[2]) for line in lines.splitlines()
            if line != "none"}


with open(f"{folder}/components.scene.json", encoding="utf-8") as file:
    scene = json.load(file)
parts = {name: f"{folder}/{model['file']}" for name, model in scene["models"].items()}
assert [i["name"] for i in scene["instances"]] == list(parts) == sorted(parts)
assert all(set(i) == {"name", "model"} and i["name"] == i["model"] for i in scene["instances"])

owner = {}
for name, path in parts.items():
    for face in faces_of(path):
        assert face not in owner, f"face {face} is in {owner[face]} and {name}"
        owner[face] = name
assert sorted(owner) == sorted(faces_of(whole)) == list(range(len(owner)))

of_parts = {}
for a, b in itertools.combinations(parts, 2):
    contacts = pairs_of(run("collide", "-q", "--all", parts[a], parts[b]))
    assert all({owner[f], owner[g]} == {a, b} for f, g, _ in contacts)
    if contacts:
        of_parts[a, b] = contacts
of_whole = {p for p in pairs_of(run("collide", "-q", "--self", whole)) if owner[p[0]] != owner[p[1]]}
assert set().union(*of_parts.values()) == of_whole, (of_parts, of_whole)

report = run("scene", "report", "-q", "--count", f"{folder}/components.scene.json").splitlines()
reported = {tuple(line.split("\t")[2:4]): int(line.split("\t")[4].split()[0]) for line in report}
assert reported == {pair: len(contacts) for pair, contacts in of_parts.items()}, (reported, of_parts)
print(len(parts), "components,", len(owner), "faces,", len(of_parts), "pairs meet,",
      len(of_whole), "pairs of faces")
