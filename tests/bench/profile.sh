#!/bin/sh
# Measures the time of a conversion by stage, by source file and by function.
#
#     tests/bench/profile.sh BUILD_DIR MODEL.ply [CONVERT_OPTIONS...]       e.g. --memory 1GiB
#
# BUILD_DIR: a release build with symbols and frame pointers, which is made if it does not exist. perf
# samples 199 times per second of processor time, with threads and (as root) the kernel. If perf does
# not work, or PROFILER=callgrind, valgrind counts instructions. It is fifty times slower, uses one
# thread, and does not show waiting for memory. perf.data or callgrind.out remains in BUILD_DIR. Needs
# the packages of `tools/install-deps.sh --bench`.
set -eu
[ $# -ge 2 ] || { sed -n '2,11s/^# \{0,1\}//p' "$0" >&2; exit 2; }
build=$1 model=$2
shift 2
here=$(cd "$(dirname "$0")" && pwd)
# Stacks come from frame pointers: envelopes recurse with polytopes on the stack, and perf cannot copy
# enough of the stack to unwind it.
flags="-g -fno-omit-frame-pointer -mno-omit-leaf-frame-pointer"
[ -e "$build/build.ninja" ] || meson setup "$build" "$here/../.." --buildtype=release \
    -Dc_args="$flags" -Dtests=disabled >/dev/null
ninja -C "$build" tools/ebpo >/dev/null
meson introspect --buildoptions "$build" | grep -q -e "-fno-omit-frame-pointer" || {
    echo "profile.sh: $build has no symbols or no frame pointers; give a folder that does not" \
        "exist, or configure it with -Dc_args='$flags'" >&2
    exit 1
}
file=$build/profile.ebpo.h5
trap 'rm -f "$file"' EXIT INT TERM

if [ "${PROFILER:-perf}" = perf ] && perf record -q -e cpu-clock -o /dev/null true 2>/dev/null; then
    perf record -q -e cpu-clock -F 199 --call-graph fp -o "$build/perf.data" "$build/tools/ebpo" \
        convert --json -q "$@" "$model" "$file" >"$build/profile.json"
    perf script -i "$build/perf.data" --no-inline -F tid,ip,sym,dso 2>/dev/null |
        python3 "$here/profile_stacks.py" "$build" "$build/profile.json"
    exit
fi
if [ "${PROFILER:-}" != callgrind ]; then
    echo "profile.sh: perf does not run here; valgrind's callgrind counts instructions instead" >&2
fi
valgrind -q --tool=callgrind --callgrind-out-file="$build/callgrind.out" "$build/tools/ebpo" \
    convert -q --threads 1 "$@" "$model" "$file"
short() { # without folders and libraries
    sed -E "s%[^ ]*/((lib|tools)/[a-z0-9_/]+\.[ch]:)%\1%; s% \[[^]]*\]\$%%"
}
echo "## Instructions by function, exclusive"
callgrind_annotate --threshold=95 "$build/callgrind.out" | sed -n '/file:function/,$p' | short |
    head -45
echo "## Instructions by function, inclusive"
# A recursive function occurs a second time, with a number after its name. That row counts
# instructions repeatedly, so it is omitted.
callgrind_annotate --inclusive=yes --threshold=100 "$build/callgrind.out" |
    grep -E "lib/[a-z0-9]+/[a-z_0-9]+\.c:" | grep -v "'[0-9]" | short | head -60
