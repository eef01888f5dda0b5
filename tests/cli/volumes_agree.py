"""volumes_agree.py JSON <output of ebpo extract --level 0, 1, ...: the volumes are those that ebpo info tells."""
import json
import math
import re
import sys

levels = json.loads(sys.argv[1])["levels"]
volumes = [float(v) for v in re.findall(r"envelope volume (\S+)", sys.stdin.read())]
assert len(volumes) >= 2
for level, volume in enumerate(volumes):
    assert math.isclose(volume, levels[level]["envelope_volume"], rel_tol=1e-7), (level, volume, levels[level])
print("fine")
