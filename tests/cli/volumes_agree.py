"""volumes_agree.py JSON <output of ebpo extract --level 0, 1, ...: checks that the volumes are those of ebpo
info. Volumes are smaller when planes derived from faces cut the leaves, because the file does not count these
planes.
"""
import json
import math
import re
import sys

levels = json.loads(sys.argv[1])["levels"]
volumes = [float(v) for v in re.findall(r"envelope volume (\S+)", sys.stdin.read())]
assert len(volumes) >= 2
for level, volume in enumerate(volumes):
    stated = levels[level]["envelope_volume"]
    derived = any(l["leaf"] and not l["leaf_planes"] for l in levels[: level + 1])
    assert (math.isclose(volume, stated, rel_tol=1e-7)
            or (derived and 0 < volume < stated)), (level, volume, levels[level])
print("fine")
