"""info_adds_up.py FILE <JSON of ebpo info: checks that bytes, volumes and counts are consistent with each
other and with the file.
"""
import json
import math
import os
import sys

info = json.load(sys.stdin)
size = os.path.getsize(sys.argv[1])
b, levels = info["bytes"], info["levels"]
assert b["file"] == size, (b["file"], size)
assert sum(b.values()) - b["file"] == size and b["other"] == 0, b
subtrees = info.get("subtrees")
assert (subtrees is None) == (b["subtrees"] == 0), (subtrees, b)
if subtrees:
    assert subtrees["count"] == levels[subtrees["level"]]["gray"] > 0, subtrees
    assert b["head"] < subtrees["top_bytes"] <= size, subtrees
assert levels[-1]["cumulative_bytes"] == b["head"] + b["index"] + b["levels"]
cell = math.prod(info["box_size"])
below = 0
for i, level in enumerate(levels):
    below += level["leaf_volume"] + level["black"] * cell / 8**i
    assert math.isclose(level["envelope_volume"], below + level["gray_volume"], rel_tol=1e-12)
    # the header alone does not state more for several components, or for a mesh that is not a 2-manifold
    known = info["report"]["components"] == 1 and info["report"]["manifold"]
    assert level["percent_of_solid" if known else "percent_of_integral"] >= 99.999999
    nodes = level["gray"] + level["leaf"] + level["white"] + level["black"]
    assert nodes == (8 * levels[i - 1]["gray"] if i else 1), (i, nodes)
    assert i == 0 or level["envelope_volume"] <= levels[i - 1]["envelope_volume"] * (1 + 1e-9)
assert sum(level["faces_new"] for level in levels) == (info["faces"] if "mesh" in info["parts"]
                                                       else 0)
memory = info.get("memory")
if memory:
    held = memory["top"] + memory["chunks"] + memory["skeletons"]
    assert 0 < memory["least"] <= memory["whole"], memory
    assert memory["resident"] == (memory["budget"] in (0, max(memory["budget"], memory["whole"])))
    assert memory["resident"] or held <= memory["budget"], memory
    assert memory["subtrees_held"] <= memory["subtrees"], memory
print("fine")
