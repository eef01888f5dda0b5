#!/bin/sh
# Runs the tests of the viewer's modules under node: viewer_modules.sh NODE VIEWER EBPO GENERATE INPUTS
set -eu
EBPO_TOOL=$(realpath "$3") generate=$(realpath "$4") inputs=$(realpath "$5")
cd "$2"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$inputs" "$work"
"$generate" --base torus --faces 8000 "$work/ring.ply"
convert() { out=$1; shift; "$EBPO_TOOL" convert -q "$@" \
    "$work/$out.ebpo.h5"; EBPO_FILES="${EBPO_FILES:-} $work/$out.ebpo.h5"; }
convert ring --profile full "$work/ring.ply"
convert ring_without_mesh --parts -mesh "$work/ring.ply"
convert ring_deflate --codec deflate --leaf-faces 4 "$work/ring.ply"
"$generate" --base torus --faces 20000 "$work/ring2.ply"
convert ring_blocks --leaf-faces 1 --subtree-faces none "$work/ring2.ply"
convert ring_subtrees --leaf-faces 4 --subtree-faces 200 --profile full "$work/ring.ply"
convert ring_subtrees_bare --subtree-faces 500 --codec none --parts -maps "$work/ring.ply"
convert cube --profile full --max-level 4 --leaf-faces 0 "$work/quads.ply"
for solid in cavity overlapping_cubes inside_out_cube zero_area_face repeated_faces mobius; do \
    convert $solid "$work/$solid.ply" 2>/dev/null; done
subset() { out=$1; shift; "$EBPO_TOOL" subset -q "$@" "$work/ring.ebpo.h5" \
    "$work/$out.ebpo.h5"; EBPO_FILES="$EBPO_FILES $work/$out.ebpo.h5"; }
subset ring_levels --levels 0-3
subset ring_box --box 0,0,-1,1,1,1 --profile lod
export EBPO_TOOL EBPO_FILES
"$1" --test test/*.test.js
