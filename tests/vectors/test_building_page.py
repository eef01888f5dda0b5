#!/usr/bin/env python3
"""test_building_page.py SOURCE: the Python of format-spec/building.md reads the vectors, and answers
as their .nodes.json say. EBPO_TEST_SCALE below 1: every second vector."""
import json
import os
import pathlib
import re
import sys

import h5py

folder = pathlib.Path(sys.argv[1]) / "format-spec"
passed = folder / "vectors" / "passed"
sys.path.insert(0, str(folder))
sys.dont_write_bytecode = True
page = {}
for block in re.findall(r"^```python\n(.*?)^```", (folder / "building.md").read_text(), re.M | re.S):
    exec(block, page)  # pylint: disable=exec-used
import read_ebpo  # noqa: E402

asked = planes = 0
share = 2 if float(os.environ.get("EBPO_TEST_SCALE", "1")) < 1 else 1
for expected in sorted(passed.glob("*.nodes.json"))[::share]:
    said = json.loads(expected.read_text())
    with h5py.File(str(expected).replace(".nodes.json", ".ebpo.h5")) as file:
        nodes = page["read_tree"](file)
        words = ("white", "black", "leaf", "gray")
        assert {node["octcode"]: (words.index(node["type"]), node["rank"]) for node in said["nodes"]} \
            == {code: node[1:] for code, node in nodes.items()}, expected.name
        for node in said["nodes"]:
            own = [([*plane["n"]], plane["d"]) for plane in node["half_spaces"]]
            found = page["half_spaces"](file, nodes, node["octcode"])
            assert [(list(n), d) for n, d in found[len(found) - len(own):]] == own, expected.name
            planes += len(found)
        for point in said.get("points", []):
            if point["where"] != "on":
                asked += 1
                assert page["winding_number"](file, nodes, point["point"]) == point["winding"], \
                    (expected.name, point)
name, point, leaf, winding = page["assert_point"]
with h5py.File(passed / f"{name}.ebpo.h5") as file:
    nodes = page["read_tree"](file)
    assert page["look_up"](file, nodes, point) == leaf
    assert page["winding_number"](file, nodes, point) == winding
    assert page["faces_of_leaf"](file["levels/01"], 0) == [0, 1, 2, 3]
assert asked > 300 and planes > 300, (asked, planes)
print(f"{asked} points, {planes} half-spaces")
