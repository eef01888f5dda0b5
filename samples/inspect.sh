#!/bin/sh
# Inspects a file with the tools of HDF5: prints its kind, its contents and one level. The tools use the
# plugin of the ebpo in PATH, unless HDF5_PLUGIN_PATH is set.
# Usage: samples/inspect.sh FILE.ebpo.h5 [LEVEL]
set -eu
file=${1:?usage: inspect.sh FILE.ebpo.h5 [LEVEL]}
case ${2:-1} in
[0-9]) level=0${2:-1} ;;
[0-9][0-9]) level=$2 ;;
*) echo "inspect.sh: $2: not a level; levels are 0 to 20" >&2; exit 2 ;;
esac

plugin=$(ebpo --version --verbose 2>/dev/null | sed -n 's,^HDF5 plugin: /,/,p')
[ -z "$plugin" ] || export HDF5_PLUGIN_PATH="${HDF5_PLUGIN_PATH-$plugin}"

h5ls "$file" >/dev/null 2>&1 || { echo "inspect.sh: $file: missing, or not an HDF5 file" \
    >&2; exit 1; }
h5ls "$file/levels/$level" >/dev/null 2>&1 || { echo \
    "inspect.sh: $file has no level $level; see ebpo info $file" >&2; exit 1; }

echo "== kind of file"
for name in about format_version kind vertex_count face_count box_origin box_size; do
    printf '%-16s' "$name"
    h5dump -a "/$name" "$file" | sed -n 's/^ *([0-9]*): //p'
done

echo "== contents"
h5ls -r "$file"

echo "== level $level, first values: types of eight siblings, planes of each gray node, plane codes"
for name in types plane_counts planes; do
    h5ls "$file/levels/$level" | grep -q "^$name " &&
        h5dump -d "/levels/$level/$name" -A 0 -s 0 -c 1 "$file" | sed -n 's/^ *(0): /'"$name"': /p'
done

echo "== complete, as HDF5 prints it: h5dump -A 0 -d /levels/$level/types $file"
h5dump -A 0 -d "/levels/$level/types" "$file"
