#!/bin/sh
# Builds the npm package for the viewer, if it is missing or older than its sources, and runs a command:
# with_package.sh SOURCE_ROOT FOLDER COMMAND...    The test is skipped when emscripten is missing.
set -eu
root=$1 folder=$2
shift 2
package=$root/tools/web/ebpo/package.json
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
