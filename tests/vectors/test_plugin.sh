#!/bin/sh
# The zstd filter as a plugin, in the hands of HDF5's own tools: test_plugin.sh PLUGIN_FOLDER
# VECTORS EBPO
set -u
export HDF5_PLUGIN_PATH="$1"
vector="$2/passed/05_two_levels.ebpo.h5"
plain="$2/passed/01_one_leaf_unfiltered.ebpo.h5"
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
command -v h5dump >/dev/null && command -v h5repack >/dev/null || exit 77

fail() { echo "FAILED: $1"; exit 1; }

h5dump -d /mesh/faces "$vector" >"$work/dump" 2>&1 || fail "h5dump with the plugin"
grep -q '(3,0): 2, 3, 1' "$work/dump" || fail "h5dump prints the codes of the faces"
h5repack -f NONE "$vector" "$work/bare.h5" || fail "h5repack with the plugin"
h5dump -d /mesh/faces "$work/bare.h5" | grep -q '(3,0): 2, 3, 1' || fail "h5repack keeps the values"
h5repack -f SHUF -f UD=32015,0,1,5 "$plain" "$work/packed.h5" ||
    fail "h5repack compresses with the plugin"
h5dump -p -d /mesh/faces "$work/packed.h5" | grep -q 'FILTER_ID 32015' ||
    fail "the filter is recorded"
h5repack -f SHUF -f GZIP=6 -f FLET "$vector" "$work/deflate.h5" &&
    ! "$3" verify --quiet "$work/deflate.h5" 2>"$work/said" && grep -q -- --compat "$work/said" &&
    "$3" verify --quiet --compat "$work/deflate.h5" || fail "h5repack makes the pipeline deflate"

# Programs that load HDF5 for themselves alone, as h5py does, have none of its symbols to give.
nm -D --undefined-only "$1/libebpo_h5zstd.so" | grep ' H5' && fail "the plugin needs symbols of HDF5"

# What the specification says of tools without the plugin.
HDF5_PLUGIN_PATH=/nowhere h5dump -d /mesh/faces "$vector" >"$work/dump" 2>&1 ; [ $? = 1 ] ||
    fail "h5dump without the plugin fails"
grep -q '(3,0): 2, 3, 1' "$work/dump" && fail "h5dump without the plugin prints nothing"
exit 0
