#!/bin/sh
# Formats all C and C++ by .clang-format; with --check it only reports files with another format.
# Versions of clang-format break lines differently, so only that of Debian 12 is accepted (else exit code 77, skipped).
set -eu
cd "$(dirname "$0")/../.."
version=14
program=
for name in clang-format-$version clang-format; do
    if "$name" --version 2>/dev/null | grep -q "version $version\."; then
        program=$name
        break
    fi
done
if [ -z "$program" ]; then
    found=$(clang-format --version 2>/dev/null || echo "none")
    echo "skipped: clang-format $version is needed, found: $found" >&2
    exit 77
fi
sources=$(git ls-files '*.c' '*.h' '*.cpp' '*.hpp' '*.inc' 2>/dev/null || true)
[ -n "$sources" ] || { echo "skipped: this is not a git repository" >&2; exit 77; }
how=-i
[ "${1:-}" = --check ] && how="--dry-run -Werror --ferror-limit=3"
# shellcheck disable=SC2086
"$program" $how $sources
