#!/bin/sh
# One object of all of the library's, in which only public names are global, in an archive:
# make_static.sh OUT.a INTERNAL.a OBJCOPY AR CC...
# Names within the library (json_enter, say) are then in nobody's way.
set -eu
out=$1 internal=$2 objcopy=$3 ar=$4
shift 4
object=$(dirname "$out")/ebpo.o
rm -f "$out"
"$@" -r -nostdlib -o "$object" -Wl,--whole-archive "$internal" -Wl,--no-whole-archive
"$objcopy" --localize-hidden "$object"
"$ar" csrD "$out" "$object"
rm -f "$object"
