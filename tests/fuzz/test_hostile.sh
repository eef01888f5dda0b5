#!/bin/sh
# SPDX-License-Identifier: MIT
# Files like those of libhdf5's published defects are refused: test_hostile.sh PYTHON MAKER GOOD PROGRAM
set -eu
"$1" -c 'import h5py' 2>/dev/null || { echo "skipped: h5py is missing"; exit 77; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$1" "$2" "$3" "$work"
"$4" "$work"
