#!/bin/sh
# Builds the npm package for the viewer, if it is missing or older than its sources, and runs a command:
# with_package.sh SOURCE_ROOT FOLDER COMMAND...    The test is skipped when emscripten or the viewer's modules are
# missing; this is found before the package is built, which takes minutes.
set -eu
root=$1 folder=$2
shift 2
package=$root/tools/web/ebpo/package.json
if [ ! -d "$root/tools/web/node_modules/three" ]; then
    echo "skipped: $root/tools/web/node_modules is missing; run tools/install-deps.sh --tests"
    exit 77
fi
is_current() {
    [ -f "$package" ] &&
        [ -z "$(find "$root/lib" "$root/tools/npm" -type f -newer "$package" | head -n 1)" ]
}
if ! is_current; then
    command -v emcc >/dev/null || { echo "skipped: emcc is missing (Debian: emscripten)"; exit 77; }
    mkdir -p "$folder"
    (flock 9 && { is_current || sh "$root/tools/npm/build.sh" "$folder"; }) 9>"$folder/lock"
fi
exec "$@"
