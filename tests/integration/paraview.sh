#!/bin/sh
# paraview.sh EBPO CLI_INPUTS SOURCE_ROOT: checks that ParaView opens the files of ebpo export,
# counts the same cells as ebpo, and draws them. Skips (77) without pvpython, or without a display and xvfb-run.
# tools/install-deps.sh --paraview installs the required packages.
set -eu
tests=$(cd "$(dirname "$0")" && pwd)
ebpo=$(realpath "$1") inputs=$(realpath "$2") root=$3
skip() { echo "skipped: no $1; tools/install-deps.sh --paraview installs it"; exit 77; }
command -v pvpython >/dev/null || skip pvpython
display=
if [ -z "${DISPLAY:-}" ]; then
    command -v xvfb-run >/dev/null || skip "display and no xvfb-run"
    display="xvfb-run -a"
fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir "$folder/in"
"$inputs" "$folder/in"
cd "$folder"
"$ebpo" convert -q --leaf-faces 4 in/torus.ply model.ebpo.h5
last=$("$ebpo" info --json model.ebpo.h5 | python3 -c \
    'import json, sys; print(len(json.load(sys.stdin)["levels"]) - 1)')
"$ebpo" export --json --levels "0-$last" --mesh model.ebpo.h5 model.xdmf >xdmf.json
"$ebpo" export --json --levels "0-$last" --mesh model.ebpo.h5 model.vtkhdf >vtkhdf.json
"$ebpo" export --json --level "$last" model.ebpo.h5 model.glb >glb.json
$display pvpython "$tests/integration/paraview_opens.py" "$folder"
$display pvpython "$root/samples/paraview_levels.py" model.xdmf levels.png 1 "$last"
$display pvpython "$tests/integration/paraview_opens.py" "$folder" levels.png
