#!/bin/sh
# SPDX-License-Identifier: MIT
# Fuzz targets for an engine, as OSS-Fuzz builds them: tests/fuzz/build.sh
#   CC, CFLAGS            compiler and its sanitizers; default: clang with address and undefined
#   LIB_FUZZING_ENGINE    what the targets are linked with; default: -fsanitize=fuzzer (libFuzzer);
#                         AFL++: CC=afl-clang-fast LIB_FUZZING_ENGINE=/usr/lib/afl/libAFLDriver.a
#   WORK, OUT             where is built, and where the targets, seeds and dictionaries go
# Then, for instance: OUT/fuzz_ply -dict=OUT/fuzz_ply.dict new_corpus OUT/fuzz_ply_seeds
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
WORK=${WORK:-$root/build-fuzz} OUT=${OUT:-$root/build-fuzz/out}
export CC="${CC:-clang}" CXX="${CXX:-clang++}"
export CFLAGS="${CFLAGS:--g1 -O1 -fno-sanitize-recover=all -fsanitize=address,undefined}"
export LDFLAGS="${LDFLAGS:-$CFLAGS}" CXXFLAGS="${CXXFLAGS:-$CFLAGS}"
engine=${LIB_FUZZING_ENGINE:--fsanitize=fuzzer}
[ -d "$WORK" ] || meson setup "$WORK" "$root" -Dfuzzing=true "-Dfuzzing_engine=$engine" \
    -Dtests=disabled -Db_lundef=false --buildtype=plain
targets=$(cd "$root/tests/fuzz" && ls fuzz_*.c | grep -v main | sed 's/\.c$//')
ninja -C "$WORK" tests/fuzz/seeds_made $(for t in $targets; do echo "tests/fuzz/$t"; done)
mkdir -p "$OUT"
for t in $targets; do
    name=${t#fuzz_}
    cp "$WORK/tests/fuzz/$t" "$OUT/"
    [ ! -f "$root/tests/fuzz/dict/$name.dict" ] ||
        cp "$root/tests/fuzz/dict/$name.dict" "$OUT/$t.dict"
    mkdir -p "$OUT/${t}_seeds"
    for from in "$root/tests/fuzz/seeds/$name" "$WORK/tests/fuzz/seeds_made/$name"; do
        [ ! -d "$from" ] || cp "$from"/* "$OUT/${t}_seeds/"
    done
    [ ! -f "$root/tests/fuzz/corpus/$name.pack" ] ||
        python3 "$root/tests/fuzz/corpus.py" unpack "$root/tests/fuzz/corpus/$name.pack" \
            "$OUT/${t}_seeds"
    case $name in
    export | file | head | levels | pair | questions | verify)
        find "$root"/format-spec/vectors "$root/tests/fuzz/seeds/file" -name '*.h5' -size -24k \
            -exec cp '{}' "$OUT/${t}_seeds/" ';'
        [ $name = head ] || cp "$root/tests/fuzz/dict/file.dict" "$OUT/$t.dict"
        ;;
    paint) cp "$root"/format-spec/vectors/paint/*/*.h5 "$OUT/${t}_seeds/" ;;
    esac
done
echo "built: $OUT"
