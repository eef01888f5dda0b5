#!/bin/sh
# All tests: installs what they need, builds with gcc, clang and sanitizers (warnings are errors) and runs every suite with gcc; with clang and sanitizers less of it, as said below.
# Usage: tests/run.sh [gcc] [clang] [sanitize]; all three by default. Needs no model files; with ../shared/models or $EBPO_MODELS the real ones are tested too.
set -eu
cd "$(dirname "$0")/.."
sh tools/install-deps.sh --tests
jobs=$(nproc)
run() { # name, compiler, meson options...
    name=$1 compiler=$2
    shift 2
    echo "=== $name ==="
    [ -d "build-$name" ] || CC=$compiler meson setup "build-$name" -Dwerror=true -Dtests=enabled "$@"
    ninja -C "build-$name" -j "$jobs"
    # The viewer is not compiled: once is enough. What is long and no business of the compiler's: not with clang.
    case $name in
    gcc) less= ;;
    clang) less="--no-suite viewer --no-suite long" ;;
    *) less="--no-suite viewer" ;;
    esac
    # shellcheck disable=SC2086
    EBPO_TEST_SCALE=${EBPO_TEST_SCALE:-1} meson test -C "build-$name" -v --no-rebuild $less
}
[ $# -gt 0 ] || set -- gcc clang sanitize
for suite in "$@"; do
    case $suite in
    gcc) run gcc gcc ;;
    clang) EBPO_TEST_SCALE=0.2 run clang clang ;; # the number of random points is gcc's business
    sanitize) EBPO_TEST_SCALE=0.2 run sanitize gcc -Db_sanitize=address,undefined -Db_lundef=false --buildtype=debugoptimized -Dc_args=-fno-sanitize-recover=all -Dcpp_args=-fno-sanitize-recover=all ;;
    *) echo "usage: tests/run.sh [gcc] [clang] [sanitize]" >&2; exit 2 ;;
    esac
done
