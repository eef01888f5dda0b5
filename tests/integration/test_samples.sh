#!/bin/sh
# Tests the samples: test_samples.sh EBPO SAMPLES PLUGIN_FOLDER INPUTS QUERY LIBEBPO
# GENERATE PACKAGE_FOLDER PYTHON_WITH_NUMPY (or "") TOUCH_DEVICE
set -u
ebpo=$1 samples=$2 inputs=$4 query=$5 library=$6 generate=$7 package=$8 numpy=$9
export HDF5_PLUGIN_PATH="$3"
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
fail() { echo "FAILED: $1"; cat "$work/out"; exit 1; }

"$inputs" "$work" || exit 1

# Queries from C and from Python give the same results. The cube is 0 .. 1.
"$ebpo" convert -q "$work/quads.ply" "$work/cube.ebpo.h5" >"$work/out" 2>&1 || fail convert
printf '0.5 0.25 0.5\n3 0.25 0.5\n1 1 1\n' >"$work/points"
"$query" "$work/cube.ebpo.h5" <"$work/points" >"$work/out" 2>&1 || fail query
[ "$(sed 's/face [0-9]*/face N/' "$work/out")" = "IN, -0.25 from face N at 0.5 0 0.5
OUT, 2 from face N at 1 0.25 0.5
ON, 0 from face N at 1 1 1" ] || fail "query results"
export EBPO_LIBRARY="$library" PYTHONDONTWRITEBYTECODE=1 PYTHONPATH="$package"
if [ -n "$numpy" ]; then
    "$numpy" "$samples/query.py" "$work/cube.ebpo.h5" <"$work/points" >"$work/out.py" 2>&1 ||
        { cp "$work/out.py" "$work/out"; fail query.py; }
    sed 's/\.0\b//g' "$work/out.py" | cmp - "$work/out" >/dev/null ||
        fail "query.py gives the results of query"

    # Without EBPO_LIBRARY, the package uses the library beside it, else that of the ebpo in PATH, and
    # not another one of the system.
    mkdir "$work/elsewhere" && cp -R "$package/ebpo" "$work/elsewhere" || exit 1
    for folder in "$package" "$work/elsewhere"; do
        PATH=$(cd "$(dirname "$ebpo")" && pwd):$PATH PYTHONPATH=$folder EBPO_LIBRARY= \
            "$numpy" -c 'import ebpo; print(ebpo.library())' >"$work/out" 2>&1 || fail "ebpo imports"
        [ "$(readlink -f "$(cat "$work/out")")" = "$(readlink -f "$library")" ] ||
            fail "which library the package takes in $folder"
    done
fi

# A surface has an inside if its border is stored, otherwise only distances. An invalid line ends both
# programs, after the results of the lines before it.
"$ebpo" convert -q "$work/open_box.ply" "$work/holes.ebpo.h5" >"$work/out" 2>&1 &&
    "$ebpo" convert -q --parts=-border "$work/open_box.ply" "$work/box.ebpo.h5" >>"$work/out" 2>&1 ||
    fail "convert open_box"
printf '0.5 0.25 0.5\n\n \t\n3 0.25\t0.5\r\n1 2\n7 7 7\n' >"$work/points"
for model in cube holes box; do
    "$query" "$work/$model.ebpo.h5" <"$work/points" >"$work/out" 2>"$work/err" &&
        fail "query accepts a bad line of $model"
    [ "$(cat "$work/err")" = "query: line 5: expected three numbers" ] ||
        fail "query prints the line: $(cat "$work/err")"
    [ "$(wc -l <"$work/out")" = 2 ] || fail "query prints the results before a bad line"
    [ -n "$numpy" ] || continue
    "$numpy" "$samples/query.py" "$work/$model.ebpo.h5" <"$work/points" >"$work/out.py" 2>"$work/err" &&
        fail "query.py accepts a bad line"
    [ "$(cat "$work/err")" = "query.py: line 5: expected three numbers" ] ||
        fail "query.py prints the line: $(cat "$work/err")"
    sed 's/\.0\b//g' "$work/out.py" | cmp - "$work/out" >/dev/null ||
        { diff "$work/out.py" "$work/out"; fail "query.py gives the results of query for $model"; }
done
[ "$(grep -c '^surface, [0-9]' "$work/out")" = 2 ] || fail "a surface has distances"
for line in '1 2 3 4' '1,,2,3' '1 2 3x' 'x'; do
    echo "$line" | "$query" "$work/cube.ebpo.h5" >"$work/out" 2>&1 && fail "query accepts '$line'"
done
if [ -n "$numpy" ]; then
    printf '# points\n3, 0.25 ,0.5 # far\n' | "$numpy" "$samples/query.py" "$work/cube.ebpo.h5" >"$work/out" 2>&1
    grep -q '^OUT, 2.0 from' "$work/out" || fail "query.py accepts commas and comments"
fi
echo 1 2 3 | "$query" "$work/cube.ebpo.h5" >/dev/full 2>"$work/out" &&
    fail "query does not detect a full disk"
grep -q 'No space left' "$work/out" || fail "query reports that the disk is full"

# A file's components become instances, and so do its named groups if the build reads OBJ.
python3 "$samples/furniture.py" "$work/furniture" >"$work/out" 2>&1 || fail furniture.py
"$ebpo" convert -q --split-components "$work/furniture/furniture.ply" "$work/bodies" >"$work/out" 2>&1 ||
    fail "split components"
"$ebpo" scene report -q "$work/bodies/components.scene.json" >"$work/out" 2>&1 || fail bodies
[ "$(cut -f 2-4 "$work/out")" = "crossing	component-0	component-5
crossing	component-0	component-7" ] || fail "bodies intersect"
if "$ebpo" check -q "$work/furniture/furniture.obj" >/dev/null 2>&1; then
    "$ebpo" convert -q --split-groups "$work/furniture/furniture.obj" "$work/pieces" >"$work/out" 2>&1 ||
        fail "split groups"
    "$ebpo" scene report -q "$work/pieces/groups.scene.json" >"$work/out" 2>&1 || fail pieces
    [ "$(cut -f 2-4 "$work/out")" = "crossing	table/top	lamp
crossing	table/top	chair back" ] || fail "pieces intersect"
fi

# The message names the missing programs in one line.
python=$(python3 -c 'import sys; print(sys.executable)')
mkdir "$work/few"
for sample in many_parts robot_among_scans; do
    PATH="$work/few" "$python" "$samples/$sample.py" "$work/none" >"$work/out" 2>&1 &&
        fail "$sample.py without programs"
    [ "$(wc -l <"$work/out")" = 1 ] && grep -q "^$sample.py: ebpo.* is not in PATH; " "$work/out" ||
        fail "$sample.py names the missing program"
done

# Scenes of many parts, and of a robot, whose packed scene gives the same results.
PATH=$(dirname "$ebpo"):$(dirname "$generate"):$PATH
python3 "$samples/many_parts.py" "$work/plant" 300 >"$work/out" 2>&1 || fail many_parts.py
! grep WARNING "$work/out" || fail "many_parts.py: a part is not the intended solid"
"$ebpo" scene report -q --time 5 "$work/plant/plant.scene.json" >"$work/out" 2>&1 || fail "plant"
grep -q '^5	crossing	' "$work/out" || fail "parts intersect"
"$ebpo" scene pairs --from 0 --to 10 "$work/plant/plant.scene.json" >"$work/out" 2>&1 || fail pairs
[ "$(grep -c '	tool	' "$work/out")" -gt 10 ] || fail "the tool flies through"
if "$ebpo" render "$work/cube.ebpo.h5" "$work/cube.png" 2>/dev/null; then
    PATH=$(cd "$(dirname "$ebpo")" && pwd):$PATH sh "$samples/clash_report.sh" "$work/clashes" 60 \
        >"$work/out" 2>&1 || fail clash_report.sh
    grep -q '^clashes.h5$' "$work/out" || fail "the clash report is written"
    grep -q '<b>tool</b>.*protruding' "$work/clashes/clashes.html" || fail "the tool clashes"
    [ "$(grep -c '<img' "$work/clashes/clashes.html")" -gt 3 ] || fail "clashes have pictures"
    grep -q ',"tool",protruding,' "$work/clashes/clashes.csv" || fail "a table of clashes"
fi
python3 "$samples/robot_among_scans.py" "$work/robot" 20000 >"$work/out" 2>&1 ||
    fail robot_among_scans.py
"$ebpo" scene pack -q -o "$work/packed" "$work/robot/robot.scene.json" >"$work/out" 2>&1 ||
    fail "pack the robot"
for scene in robot/robot packed/packed; do
    "$ebpo" scene report -q --count --csv --from 4 --to 7 --step 0.1 "$work/$scene.scene.json" \
        >"$work/$(basename $scene).csv" 2>"$work/out" || fail "report of $scene"
done
cmp "$work/robot.csv" "$work/packed.csv" >"$work/out" 2>&1 || fail "the packed robot gives the same results"
grep -q '"hand",near,' "$work/robot.csv" || { cat "$work/robot.csv"; fail "the hand comes near"; }
ring=$(wc -c <"$work/robot/ring.ebpo.h5") part=$(wc -c <"$work/packed/model-1.ebpo.h5")
[ "$part" -lt $((ring / 2)) ] || fail "the packed ring is too large: $part of $ring bytes"

# A device over UDP gets a force on top of the cube, and its positions are recorded. The system
# chooses a free port of this machine.
shift 9
"$ebpo" haptic --device udp:0 --seconds 30 --rate 500 --stiffness 100 --record "$work/hand.txt" \
    "$work/cube.ebpo.h5" >"$work/touched" 2>"$work/out" &
touching=$!
for i in $(seq 60); do
    port=$(sed -n 's/.*waits for a device at 127.0.0.1, port //p' "$work/out")
    [ -n "$port" ] && break
    sleep 0.5
done
"$1" "$port" 0.3 0.4 1.5 0.8 100 >"$work/felt" 2>&1 || { cat "$work/felt"; fail "touch_device gets replies"; }
wait $touching || fail "ebpo haptic ends with its device"
[ "$(cat "$work/felt")" = "some replies, a force up, proxy at 0.30 0.40 1.00" ] ||
    { cat "$work/felt"; fail "touch_device feels the cube"; }
[ "$(wc -l <"$work/hand.txt")" -gt 50 ] && "$ebpo" haptic --path "$work/hand.txt" \
    "$work/cube.ebpo.h5" >"$work/out" 2>&1 || fail "a recorded path is replayed"

command -v h5dump >/dev/null && command -v h5ls >/dev/null || exit 77
"$ebpo" convert -q --leaf-faces 8 "$work/sphere.ply" "$work/a.ebpo.h5" || fail convert
sh "$samples/inspect.sh" "$work/a.ebpo.h5" 1 >"$work/out" 2>&1 || fail inspect.sh
grep -q 'vertex_count *[0-9]' "$work/out" || fail "inspect.sh shows the number of vertices"
grep -q 'plane_counts: [0-9]' "$work/out" || fail "inspect.sh shows a level's planes"
/usr/bin/python3 -c 'import h5py' 2>/dev/null || exit 0
/usr/bin/python3 "$samples/read_level.py" "$work/a.ebpo.h5" 1 >"$work/out" 2>&1 ||
    fail read_level.py
planes=$("$ebpo" info --json "$work/a.ebpo.h5" |
    /usr/bin/python3 -c 'import json, sys; print(json.load(sys.stdin)["levels"][1]["planes"])')
[ "$(grep -c '^1[0-7] ' "$work/out")" = "$planes" ] ||
    fail "read_level.py prints each plane of level 1 ($planes)"

# Without the plugin, a one-line message states what to do.
HDF5_PLUGIN_PATH=/nowhere /usr/bin/python3 "$samples/read_level.py" "$work/a.ebpo.h5" 1 \
    >"$work/out" 2>&1 && exit 0 # HDF5 finds another plugin
[ "$(wc -l <"$work/out")" = 1 ] && grep -q '^read_level.py: .*HDF5_PLUGIN_PATH' "$work/out" ||
    fail "read_level.py without plugin"
