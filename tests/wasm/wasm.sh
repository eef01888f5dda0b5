#!/bin/sh
# Builds the npm package and runs its tests: wasm.sh NODE SOURCE_ROOT FOLDER NATIVE_RESULTS EBPO
set -eu
node=$1 root=$2 folder=$3
EBPO_NATIVE=$(realpath "$4") ebpo=$(realpath "$5")
command -v emcc >/dev/null || { echo "skipped: emcc is missing (Debian: emscripten)"; exit 77; }
sh "$root/tools/npm/build.sh" "$folder"
EBPO_ROOT=$root EBPO_PACKAGE=$folder/package EBPO_FUZZ=$folder/fuzz EBPO_FILES=
EBPO_VECTORS=$root/format-spec/vectors
# The modules contain no path of the build, and a build in other folders gives equal bytes (scale 1: it takes minutes).
for module in ebpo ebpo-collide ebpo-view; do
    if grep -aqF -e "$(realpath "$folder")" -e "$(realpath "$root")" "$EBPO_PACKAGE/$module.wasm"; then
        echo "$module.wasm contains a path of the build" >&2
        exit 1
    fi
done
if [ "${EBPO_TEST_SCALE:-0.05}" = 1 ]; then
    again=$folder/another/folder
    rm -rf "$folder/another"
    mkdir -p "$again/root" "$again/build"
    tar -C "$root" -c --exclude=node_modules lib tools samples meson.build meson_options.txt LICENSE |
        tar -C "$again/root" -x
    cp -r "$folder/sources" "$again/build"
    sh "$again/root/tools/npm/build.sh" "$again/build"
    diff -r "$folder/package" "$again/build/package"
    rm -rf "$folder/another"
fi
# Compressed size of the core, as servers send it.
"$node" -e 'const { constants, brotliCompressSync, gzipSync } = require("zlib");
const bytes = require("fs").readFileSync(process.argv[1]), size = gzipSync(bytes, { level: 9 }).length;
const brotli = brotliCompressSync(bytes, { params: { [constants.BROTLI_PARAM_QUALITY]: 11 } }).length;
console.log(`ebpo.wasm: ${size} bytes with gzip, at most 400000; ${brotli} with brotli`);
process.exit(size > 400000 ? 1 : 0)' "$EBPO_PACKAGE/ebpo.wasm"
rm -rf "$EBPO_FUZZ"
mkdir -p "$folder/models" "$EBPO_FUZZ"
cp -r "$root/tests/fuzz/seeds/file" "$EBPO_FUZZ"
python3 "$root/tests/fuzz/corpus.py" unpack "$root/tests/fuzz/corpus/head.pack" "$EBPO_FUZZ/head" >/dev/null
for model in bunny_closed fertility armadillo igea cad_adis16480 conrod thingi99865 selfint_A; do
    [ -f "${EBPO_MODELS:-}/$model.ply" ] || continue
    file=$folder/models/$model.ebpo.h5
    [ -f "$file" ] || "$ebpo" convert -q "$EBPO_MODELS/$model.ply" "$file" 2>/dev/null
    EBPO_FILES="$EBPO_FILES $file"
done
export EBPO_ROOT EBPO_NATIVE EBPO_PACKAGE EBPO_VECTORS EBPO_FUZZ EBPO_FILES
exec "$node" --test "$root/tests/wasm"
