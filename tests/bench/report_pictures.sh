#!/bin/sh
# Remakes docs/pictures/report-dragon.png and report-degenerate.png: pages of `ebpo report` for a
# dragon, and for a shell that is thinner than any cell.
#
#     tests/bench/report_pictures.sh BUILD_DIR MODELS_DIR [FOLDER]
#
# MODELS_DIR contains dragon100k.ply. The reports remain in FOLDER (default: report-pictures in
# BUILD_DIR). Needs chromium and python3.
set -eu
build=$1 models=$2 folder=${3:-$1/report-pictures}
root=$(cd "$(dirname "$0")/../.." && pwd)
methods=inherit,kmedoids,offset,random
mkdir -p "$folder" "$root/docs/pictures"

# Two tori, one in the other. The shell between them has a thickness of 1/2000 of the larger radius.
python3 - "$folder/thin_shell.ply" <<'PYTHON'
import math
import sys

AROUND, ACROSS, WALL = 120, 60, 5e-4


def torus(radius, first, turn):
    points = [((1 + radius * math.cos(b)) * math.cos(a), radius * math.sin(b), (1 + radius * math.cos(b)) * math.sin(a))
              for a in (2 * math.pi * i / AROUND for i in range(AROUND))
              for b in (2 * math.pi * k / ACROSS for k in range(ACROSS))]
    faces = []
    for i in range(AROUND):
        for k in range(ACROSS):
            p, q = first + i * ACROSS + k, first + i * ACROSS + (k + 1) % ACROSS
            r, s = first + (i + 1) % AROUND * ACROSS + k, first + (i + 1) % AROUND * ACROSS + (k + 1) % ACROSS
            faces += [t[::turn] for t in ((p, q, s), (p, s, r))]
    return points, faces


outer, inner = torus(0.4, 0, 1), torus(0.4 - WALL, AROUND * ACROSS, -1)
points, faces = outer[0] + inner[0], outer[1] + inner[1]
with open(sys.argv[1], "w", encoding="ascii") as f:
    f.write(f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n"
            "property double x\nproperty double y\nproperty double z\n"
            f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    f.writelines("%.17g %.17g %.17g\n" % p for p in points)
    f.writelines("3 %d %d %d\n" % t for t in faces)
PYTHON

page() { # NAME PICTURE
    chromium --headless --no-sandbox --disable-gpu --hide-scrollbars --window-size=1320,4150 \
        --screenshot="$root/docs/pictures/$2" "file://$(realpath "$folder/$1/report.html")"
}

"$build/tools/ebpo" report --select $methods --targets -o "$folder/dragon" "$models/dragon100k.ply"
"$build/tools/ebpo" report --select $methods --points 2000 --view 30,35 -o "$folder/degenerate" \
    "$folder/thin_shell.ply"
page dragon report-dragon.png
page degenerate report-degenerate.png
