#!/usr/bin/env python3
"""findings_agree.py REPORT.json X.ply: compares the picture of `ebpo check --json --findings X.ply` with its JSON.

Reads the binary PLY with separate code. The face of every finding has the colour of one of its kinds, the
first in the legend. Vertices of the picture are at the middles of edges. No other face has a colour.
"""
import json
import struct
import sys

report, name = json.load(open(sys.argv[1])), sys.argv[2]
data = open(name, "rb").read()
end = data.index(b"end_header\n") + len(b"end_header\n")
header = data[:end].decode().splitlines()
colour, count = {}, {}
for line in header:
    words = line.split()
    if words[0] == "comment":
        colour[words[1]] = tuple(int(w) for w in words[3:6])
    if words[0] == "element":
        count[words[1]] = int(words[2])
vertices = [struct.unpack_from("<3d", data, end + 24 * i) for i in range(count["vertex"])]
at = end + 24 * count["vertex"]
faces = [struct.unpack_from("<B3I3B", data, at + 16 * i) for i in range(count["face"])]
assert at + 16 * count["face"] == len(data), "bytes are left over"
assert all(f[0] == 3 for f in faces)
assert (count["vertex"], count["face"]) == (report["source"]["vertices"], report["source"]["faces"])

order = list(colour)
face_kinds = {}
for place in report["locations"]:
    for f in place["faces"]:
        face_kinds.setdefault(f, set()).add(place["kind"])
    if place["kind"].endswith("edges"):
        ends = [vertices[v] for v in place["vertices"]]
        assert all(abs((a + b) / 2 - p) < 1e-6 for a, b, p in zip(*ends, place["point"])), place
        assert all(set(place["vertices"]) <= set(faces[f][1:4]) for f in place["faces"]), place
counted = {kind: sum(p["kind"] == kind for p in report["locations"]) for kind in order}
for kind in order:
    assert counted[kind] == report["report"][kind]["count"], kind
assert set(order) == {p["kind"] for p in report["locations"]}


def expected(kinds):
    return colour[min(kinds, key=order.index)] if kinds else (200, 200, 200)


for i, f in enumerate(faces):
    assert f[4:] == expected(face_kinds.get(i)), (i, f)
print(f"{name}: {len(face_kinds)} of {len(faces)} faces coloured; fine")
