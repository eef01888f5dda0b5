#!/bin/sh
# Counts the instructions of queries on ARM: instructions.sh MODEL.ebpo.h5 PROGRAM...
# PROGRAM: query_counts, compiled for arm64 and linked statically. For each program and kind of query, prints the
# instructions per query and the hash of the results, which must be the same for every program and machine. Needs
# qemu-user. A library with -DEBPO_PORTABLE_SIMD in its flags has the kernels without NEON.
set -eu
[ $# -ge 2 ] || { echo "usage: instructions.sh MODEL.ebpo.h5 PROGRAM..." >&2; exit 2; }
model=$1
shift
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${CC:-cc}" -O2 -shared -fPIC -o "$work/libcount.so" "$here/count_instructions.c"
queries=20000

# Prints the hash and the number of instructions.
run() { # program, kind, queries
    qemu-aarch64 -plugin "$work/libcount.so" "$1" "$model" "$2" "$3" 2>&1 | sed 's/^instructions //' | tr '\n' ' '
}
for kind in ray distance inside; do
    for program; do
        for count in 0 $queries; do
            run "$program" $kind $count >"$work/$count"
        done
        awk -v name="$kind, $program" -v queries=$queries '{ for (i = 1; i <= 2; i++) if (length($i) == 16) hash = $i
            else value[NR] = $i } END { printf "%s: %.0f instructions, results %s\n", name,
            (value[2] - value[1]) / queries, hash }' "$work/0" "$work/$queries"
    done
done
