#!/bin/sh
# The tests, in three tiers. Each installs what it needs, builds (warnings are errors) and tests:
#   tests/run.sh           medium, what CI runs: gcc, clang, sanitize, thread, memory (< 1 h)
#   tests/run.sh short     gcc alone, few inputs and nothing costly: while one works
#   tests/run.sh long      every check in every build, all inputs with gcc; posix: before a release
#   tests/run.sh [TIER] BUILD...    only these of its builds; sanitize: address and undefined;
#                          memory: fuzz targets alone, whose corpora MemorySanitizer looks at;
#                          posix: without what Linux has beyond POSIX, the tests of what serves then
# What a tier leaves out is in the table below, nowhere else. Needs no model files; with
# ../shared/models or $EBPO_MODELS the real ones are tested too.
set -eu
cd "$(dirname "$0")/.."
tier=medium
case "${1:-}" in short | medium | long) tier=$1 && shift ;; esac
[ $# -gt 0 ] || case $tier in
short) set -- gcc ;;
medium) set -- gcc clang sanitize thread memory ;;
long) set -- gcc clang sanitize thread memory posix ;;
esac

# The share of repeated inputs (EBPO_TEST_SCALE), and the suites that are left out:
#   once     not compiled: one build is enough
#   costly   compiled, but no compiler's business: with gcc, and in the long tier with sanitizers
#   calls    each public call, its allocations and files failing: gcc, and sanitizers
#   viewer   the web viewer in node and a browser
#   flags    the sources once more with four sets of flags, which is more than half of what is compiled
plan() { # build
    case $tier-$1 in
    short-*) echo "0.05 costly viewer flags" ;;
    medium-gcc) echo "0.15" ;;
    medium-clang) echo "0.1 once costly calls viewer flags" ;;
    medium-sanitize) echo "0.05 once costly viewer" ;;
    long-gcc) echo "1" ;;
    long-clang) echo "0.2" ;;
    long-sanitize) echo "0.2" ;;
    *-thread) echo "1" ;; # only the suite threads, all of it
    *-memory) echo "1" ;; # only the suite fuzz
    *-posix) echo "0.1" ;; # only the tests that are named below
    esac
}

# Publishing, temporary files, sources of bytes; threads; the clock of a hand; the command.
without_linux="io workspace source many_threads touch_hand touch_probe touch_udp
    cli_convert cli_files cli_query cli_touch cli_usage"

jobs=$(nproc)
configure() { # build, meson options...
    folder=build-$1
    shift
    [ -d "$folder" ] || meson setup "$folder" -Dwerror=true -Dtests=enabled "$@"
}
sanitized() { # sanitizers
    stop=-fno-sanitize-recover=all
    echo "-Db_sanitize=$1 -Db_lundef=false --buildtype=debugoptimized -Dc_args=$stop -Dcpp_args=$stop"
}
run() { # build
    # shellcheck disable=SC2046
    case $1 in
    gcc | clang) CC=$1 configure "$1" ;;
    sanitize) CC=gcc configure "$1" $(sanitized address,undefined) ;;
    thread) CC=gcc configure "$1" $(sanitized thread) ;;
    posix) CC=gcc configure "$1" -Dposix_only=true ;;
    # without what is not instrumented, as far as that goes; msan_outside.c tells of the rest
    memory)
        CC=clang configure "$1" $(sanitized memory) -Dtests=disabled -Dfuzzing=true \
            -Dhdf5=disabled -Dhttp=disabled -Dassimp=disabled -Drender=disabled \
            -Dcaptions=disabled -Dqhull=disabled -Doptimization=0 # as soon built as run
        ;;
    esac
    read -r share left_out <<EOF
$(plan "$1")
EOF
    suites=
    case $1 in
    thread) suites="--suite threads" ;;
    memory) suites="--suite fuzz" ;;
    posix) suites=$without_linux ;;
    esac
    for suite in $left_out; do suites="$suites --no-suite $suite"; done
    # Everything where everything is tested; else meson builds what the chosen tests need.
    if [ -z "$left_out$suites" ]; then
        ninja -C "build-$1" -j "$jobs"
        suites=--no-rebuild
    fi
    # shellcheck disable=SC2086
    EBPO_TEST_SCALE=${EBPO_TEST_SCALE:-$share} meson test -C "build-$1" -v $suites
}

for build in "$@"; do
    case $build in
    gcc | clang | sanitize | thread | memory | posix) ;;
    *)
        echo "usage: tests/run.sh [short|medium|long]" \
            "[gcc] [clang] [sanitize] [thread] [memory] [posix]" >&2
        exit 2
        ;;
    esac
done
sh tools/install-deps.sh --tests
for build in "$@"; do
    echo "=== $tier: $build ==="
    began=$(date +%s)
    run "$build"
    echo "=== $tier: $build took $((($(date +%s) - began + 30) / 60)) minutes ==="
done
