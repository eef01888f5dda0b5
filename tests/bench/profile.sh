#!/bin/sh
# Where the time of a build goes: by stage, by source file, by function.
#
#     tests/bench/profile.sh BUILD_DIR MODEL.ply [CONVERT_OPTIONS...]       e.g. --memory 1GiB
#
# BUILD_DIR: a release build with symbols and frame pointers; made, if it is not there. perf samples
# 199 times a second of processor time, the threads and the kernel included (the kernel: as root).
# Where perf may not (its test fails, or PROFILER=callgrind): valgrind counts instructions, fifty
# times slower and on one thread, without information about waiting for memory. perf.data or
# callgrind.out stays in BUILD_DIR. Needs what `tools/install-deps.sh --bench` installs.
set -eu
[ $# -ge 2 ] || { sed -n '2,8s/^# \{0,1\}//p' "$0" >&2; exit 2; }
build=$1 model=$2
shift 2
here=$(cd "$(dirname "$0")" && pwd)
# Stacks by frame pointers: envelopes recurse with polytopes on the stack, of which perf cannot copy
# enough to unwind them.
flags="-g -fno-omit-frame-pointer -mno-omit-leaf-frame-pointer"
[ -e "$build/build.ninja" ] || meson setup "$build" "$here/../.." --buildtype=release \
    -Dc_args="$flags" -Dtests=disabled >/dev/null
ninja -C "$build" tools/ebpo >/dev/null
meson introspect --buildoptions "$build" | grep -q -e "-fno-omit-frame-pointer" || {
    echo "profile.sh: $build has no symbols or no frame pointers; give a folder that is not there" \
        "yet, or configure it with -Dc_args='$flags'" >&2
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
echo "## Instructions by function: its own"
callgrind_annotate --threshold=95 "$build/callgrind.out" | sed -n '/file:function/,$p' | short |
    head -45
echo "## Instructions by function: with all that it calls"
# What calls itself is there a second time, with a number behind its name: what it gathers so is
# counted again and again.
callgrind_annotate --inclusive=yes --threshold=100 "$build/callgrind.out" |
    grep -E "lib/[a-z0-9]+/[a-z_0-9]+\.c:" | grep -v "'[0-9]" | short | head -60
