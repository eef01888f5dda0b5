#!/bin/sh
# Builds the npm package and runs its tests: wasm.sh NODE SOURCE_ROOT FOLDER NATIVE_RESULTS EBPO
set -eu
node=$1 root=$2 folder=$3
EBPO_NATIVE=$(realpath "$4") ebpo=$(realpath "$5")
command -v emcc >/dev/null || { echo "skipped: emcc is missing (Debian: emscripten)"; exit 77; }
sh "$root/tools/npm/build.sh" "$folder"
EBPO_ROOT=$root EBPO_PACKAGE=$folder/package EBPO_VECTORS=$root/format-spec/vectors EBPO_FUZZ=$folder/fuzz EBPO_FILES=
# Compressed size of the core, as servers send it.
gzip -9c "$EBPO_PACKAGE/ebpo.wasm" >"$folder/ebpo.wasm.gz"
bytes=$(wc -c <"$folder/ebpo.wasm.gz")
echo "ebpo.wasm: $bytes bytes with gzip -9"
[ "$bytes" -le 400000 ] || { echo "more than 400,000 bytes"; exit 1; }
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
