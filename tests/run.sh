#!/bin/sh
# Builds the project and runs its tests, and stops at the first failure. Warnings are errors.
#   tests/run.sh         what CI runs
#   tests/run.sh quick   gcc alone and few inputs: while you work
#   tests/run.sh full    every check in every build, with more inputs: before a release
#   tests/run.sh [quick|full] BUILD...   only these builds of the tier
# Builds: gcc; clang; sanitize (gcc with address and undefined); undefined (clang); thread; memory (the fuzz
# targets and their corpora); posix (without what Linux has beyond POSIX). plan() says what each tier leaves out.
# No model files are needed; those in ../shared/models or $EBPO_MODELS are tested too.
set -eu
cd "$(dirname "$0")/.."
tier=default
case "${1:-}" in quick | full) tier=$1 && shift ;; esac
[ $# -gt 0 ] || case $tier in
quick) set -- gcc ;;
default) set -- gcc sanitize thread ;;
full) set -- gcc clang sanitize undefined thread memory posix ;;
esac

# Prints the share of random inputs (EBPO_TEST_SCALE) and the suites that a tier leaves out of a build.
# tests/meson.build says what the suites are.
plan() { # build
    case $tier-$1 in
    quick-*) echo "0.02 full costly once viewer wasm calls fuzz" ;;
    full-gcc) echo "1" ;;
    full-clang | full-undefined) echo "0.03 wasm" ;;
    full-sanitize) echo "0.02 wasm" ;;
    default-gcc) echo "0.05 full viewer wasm fuzz" ;; # sanitize runs the fuzz targets
    default-clang) echo "0.1 full once costly viewer wasm calls" ;;
    default-sanitize | default-undefined) echo "0.02 full once costly slow viewer calls" ;;
    *-memory) echo "1" ;; # one suite
    full-thread) echo "0.3" ;;
    *-thread) echo "0.1" ;;
    *-posix) echo "0.1" ;;           # the tests that are named here
    esac
}
without_linux="io workspace source many_threads haptic_ball haptic_probe haptic_udp
    cli_convert cli_files cli_query cli_haptic cli_usage"

configure() { # build, meson options...
    folder=build-$1
    shift
    [ -f "$folder/build.ninja" ] || meson setup "$folder" -Dwerror=true -Dtests=enabled "$@"
}
configure_sanitized() { # compiler, build, sanitizers, meson options...
    compiler=$1 folder=$2 sanitizers=$3
    shift 3
    # -g1: reports have lines, and compiling is faster than with variables.
    flags='-fno-sanitize-recover=all -g1'
    CC=$compiler configure "$folder" -Db_sanitize="$sanitizers" -Db_lundef=false \
        --buildtype=debugoptimized -Dc_args="$flags" -Dcpp_args="$flags" "$@"
}
configure_build() { # build
    case $1 in
    gcc | clang) CC=$1 configure "$1" ;;
    sanitize) configure_sanitized gcc "$1" address,undefined -Doptimization=1 ;;
    undefined) configure_sanitized clang "$1" undefined -Doptimization=1 ;;
    thread) configure_sanitized gcc "$1" thread ;;
    posix) CC=gcc configure "$1" -Dposix_only=true ;;
    # Without libraries that are not instrumented, as far as possible; msan_outside.c describes the rest.
    memory)
        configure_sanitized clang "$1" memory -Dtests=disabled -Dfuzzing=true -Dhdf5=disabled \
            -Dhttp=disabled -Dassimp=disabled -Drender=disabled -Dcaptions=disabled \
            -Dqhull=disabled -Doptimization=0
        ;;
    esac
}
run() { # build
    read -r share left_out <<EOF
$(plan "$1")
EOF
    chosen=
    case $1 in
    thread) chosen="--suite threads" ;;
    memory) chosen="--suite fuzz" ;;
    posix) chosen=$without_linux ;;
    esac
    for suite in $left_out; do chosen="$chosen --no-suite $suite"; done
    # meson builds what the chosen tests need, and begins with the first test when all is built.
    # shellcheck disable=SC2086
    # One process more than there are cores, as some tests wait for servers.
    EBPO_TEST_SCALE=${EBPO_TEST_SCALE:-$share} meson test -C "build-$1" -v --maxfail 1 \
        --num-processes $(($(nproc) + 1)) $chosen
}

for build in "$@"; do
    case $build in
    gcc | clang | sanitize | undefined | thread | memory | posix) ;;
    *)
        echo "tests/run.sh: unknown word: $build" >&2
        echo "usage: tests/run.sh [quick|full]" \
            "[gcc] [clang] [sanitize] [undefined] [thread] [memory] [posix]" >&2
        exit 2
        ;;
    esac
done
sh tools/install-deps.sh --tests
# Tests write tens of thousands of small files, and many wait for the disk. They need not in memory, where there
# are 4 GB for them and programs can run from there.
memory=/dev/shm
can_hold_tests() {
    free=$(df -Pk "$memory" 2>/dev/null | awk 'NR == 2 { print $4 }')
    [ "${free:-0}" -ge 4000000 ] && probe=$(mktemp "$memory/ebpo-run-XXXXXX") || return 1
    printf '#!/bin/sh\n' >"$probe"
    chmod +x "$probe"
    "$probe" 2>/dev/null && code=0 || code=1
    rm -f "$probe"
    return $code
}
if [ -z "${TMPDIR:-}" ] && can_hold_tests; then
    export TMPDIR="$memory"
fi
times= ahead=
# Ends the compilation that runs ahead; meson test continues it.
end_ahead() {
    [ -z "$ahead" ] || kill "$ahead" 2>/dev/null || true
    wait
}
trap end_ahead EXIT
trap 'exit 1' INT TERM
configure_build "$1"
while [ $# -gt 0 ]; do
    echo "=== $tier: $1 ==="
    began=$(date +%s)
    end_ahead
    ahead=
    # Tests leave cores idle while they wait. The next build is compiled meanwhile.
    if [ $# -gt 1 ]; then
        configure_build "$2"
        nice -n 19 ninja -C "build-$2" >/dev/null 2>&1 &
        ahead=$!
    fi
    run "$1"
    times="$times $1:$began:$(date +%s)"
    shift
done
# shellcheck disable=SC2086
python3 tests/summary.py $times
