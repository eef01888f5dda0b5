#!/bin/sh
# Looks into a file with HDF5's own tools: what it is, what it holds, one level. Needs no environment variable once ebpo is installed.
# Usage: samples/inspect.sh FILE.ebpo.h5 [LEVEL]
set -eu
file=${1:?usage: inspect.sh FILE.ebpo.h5 [LEVEL]}
level=$(printf '%02d' "${2:-1}")

echo "== what it is"
for name in about format_version kind vertex_count face_count box_origin box_size; do
    printf '%-16s' "$name"
    h5dump -a "/$name" "$file" | sed -n 's/^ *([0-9]*): //p'
done

echo "== what it holds"
h5ls -r "$file"

echo "== level $level: types of eight siblings in two bits each, planes of each gray node, the first plane codes"
for name in types plane_counts planes; do
    h5ls "$file/levels/$level" | grep -q "^$name " && h5dump -d "/levels/$level/$name" -s 0 -c 1 "$file" | sed -n 's/^ *(0): /'"$name"': /p'
done

echo "== all of it, as HDF5 sees it: h5dump -d /levels/$level/plane_counts $file"
h5dump -A 0 -d "/levels/$level/plane_counts" "$file" || true
