#!/bin/sh
# Downloads Debian's source packages: debian_sources.sh FOLDER PACKAGE...
# Writes FOLDER/NAME.dsc and the files that it names. apt uses the Debian mirrors of this system and checks the
# signatures. The system's lists of packages do not change.
set -eu
mkdir -p "$1/apt/parts" "$1/apt/lists/partial" "$1/apt/cache/archives/partial"
folder=$(cd "$1" && pwd)
shift
for list in /etc/apt/sources.list.d/debian.sources /etc/apt/sources.list; do
    [ ! -f "$list" ] || sed 's/^Types: .*/Types: deb-src/; s/^deb /deb-src /' "$list" \
        >"$folder/apt/parts/$(basename "$list" | sed 's/^sources.list$/debian.list/')"
done
apt() {
    apt-get -qq -o Dir::Etc::SourceList=/dev/null -o Dir::Etc::SourceParts="$folder/apt/parts" \
        -o Dir::State::Lists="$folder/apt/lists" -o Dir::Cache="$folder/apt/cache" \
        -o APT::Sandbox::User="$(id -un)" "$@"
}
apt update
(cd "$folder" && apt source --download-only "$@")
rm -rf "$folder/apt"
