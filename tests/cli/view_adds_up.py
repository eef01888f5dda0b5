"""view_adds_up.py LEVELS.json VIEW.json: checks that an exhausted view has the nodes of the levels, with planes
and winding numbers, and each parent before its children.
"""
import json
import sys

with open(sys.argv[1], encoding="utf-8") as a, open(sys.argv[2], encoding="utf-8") as b:
    levels, view = json.load(a), json.load(b)
reported = {node["octcode"]: node for level in levels["levels"] for node in level["nodes"]}
come, siblings = {}, []
for node in view["nodes"]:
    code = node["octcode"]
    assert code == 1 or code >> 3 in come, f"{code} before its parent"
    siblings.append(code)
    assert (len({c >> 3 for c in siblings}) == 1
            and node["complete"] == (len(siblings) == (8 if code > 1 else 1))), siblings
    if node["complete"]:
        siblings = []
    come[code] = {key: node[key] for key in reported[code]}
assert come == reported, "other nodes"
last = view["last"]
kinds = {kind: sum(1 for n in come.values() if n["type"] == kind)
         for kind in ("leaf", "white", "black")}
assert (all(last[kind] == count for kind, count in kinds.items())
        and last["gray"] == last["waiting"] == 0 and last["nodes"] == len(come)
        and view["end"] == "done"), last
print("fine")
