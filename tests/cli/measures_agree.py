"""measures_agree.py INFO <JSON of ebpo measure: checks that the output agrees with the file's header (ebpo
info --json).
"""
import json
import math
import sys

info, mass = json.loads(sys.argv[1]), json.load(sys.stdin)
assert mass["kind"] == info["kind"]
assert math.isclose(mass["area"], info["report"]["area"], rel_tol=1e-9)
assert len(mass["levels"]) == len(info["levels"])
for mine, other in zip(mass["levels"], info["levels"]):
    assert mine["envelope_volume"] == other["envelope_volume"]
if mass["kind"] == "solid":
    assert math.isclose(mass["volume"], info["report"]["volume"], rel_tol=1e-9)
    low, size = info["box_origin"], info["box_size"]
    assert all(low[k] <= mass["centroid"][k] <= low[k] + size[k] for k in range(3))
    inertia = mass["inertia"]
    assert all(inertia[k][l] == inertia[l][k] for k in range(3) for l in range(3))
    assert all(inertia[k][k] <= inertia[k - 1][k - 1] + inertia[k - 2][k - 2] for k in range(3))
elif "border" in info:
    assert mass["volume_lo"] <= mass["volume"] <= mass["volume_hi"] and mass["caps"]["integral"] >= 0
else:
    assert "volume" not in mass and "inertia" not in mass
print("fine")
