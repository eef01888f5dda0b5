"""levels_add_up.py LEVELS.json <JSON of ebpo info: checks that ebpo levels and ebpo info print the same
values, and that the nodes fill the levels.
"""
import json
import math
import sys

with open(sys.argv[1], encoding="utf-8") as f:
    levels = json.load(f)["levels"]
reported = json.load(sys.stdin)["levels"]
assert 1 <= len(levels) <= len(reported)
last = reported[-1]["envelope_volume"]
parents, ms = None, 0
for level, info in zip(levels, reported):
    for key in ("gray", "leaf", "white", "black", "planes", "cumulative_bytes"):
        assert level[key] == info[key], (key, level[key], info[key])
    assert math.isclose(level["volume"], info["envelope_volume"], rel_tol=1e-12)
    assert (last == 0 or math.isclose(level["percent_of_last"],
                                      100 * info["envelope_volume"] / last, rel_tol=1e-12))
    assert level["ms"] >= ms
    ms = level["ms"]
    if "nodes" not in level:
        continue
    codes = [n["octcode"] for n in level["nodes"]]
    assert codes == ([1] if parents is None else [8 * p + i for p in parents for i in range(8)])
    parents = [n["octcode"] for n in level["nodes"] if n["type"] == "gray"]
    for kind in ("gray", "leaf", "white", "black"):
        assert sum(n["type"] == kind for n in level["nodes"]) == level[kind]
    assert sum(len(n["planes"]) for n in level["nodes"]) == level["planes"] + level["leaf_planes"]
    for a, b, c, d in (p for n in level["nodes"] for p in n["planes"]):
        assert math.isclose(a * a + b * b + c * c, 1, rel_tol=1e-12)
print("fine")
