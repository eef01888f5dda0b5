#!/bin/sh
# Downloads Debian's source packages: debian_sources.sh FOLDER PACKAGE...
# Writes FOLDER/NAME.dsc and the files that it names. apt uses the Debian mirrors of this system and checks the
# signatures. The system's lists of packages do not change. If a mirror lists a version but does not have its files
# (mirrors of debian-security may lag), the next older version is used, with a warning.
set -eu
mkdir -p "$1/apt/parts" "$1/apt/lists/partial" "$1/apt/cache/archives/partial"
folder=$(cd "$1" && pwd)
shift
for list in /etc/apt/sources.list.d/debian.sources /etc/apt/sources.list; do
    [ ! -f "$list" ] || sed 's/^Types: .*/Types: deb-src/; s/^deb /deb-src /' "$list" \
        >"$folder/apt/parts/$(basename "$list" | sed 's/^sources.list$/debian.list/')"
done
apt() { # command, arguments...
    command=$1
    shift
    "$command" -qq -o Dir::Etc::SourceList=/dev/null -o Dir::Etc::SourceParts="$folder/apt/parts" \
        -o Dir::State::Lists="$folder/apt/lists" -o Dir::Cache="$folder/apt/cache" \
        -o APT::Sandbox::User="$(id -un)" "$@"
}
download() { # package
    for version in $(apt apt-cache showsrc "$1" | sed -n 's/^Version: //p' | sort -rVu); do
        (cd "$folder" && apt apt-get source --download-only "$1=$version") && return
        echo "debian_sources.sh: the mirrors do not have the sources of $1 $version" >&2
    done
    echo "debian_sources.sh: the sources of $1 cannot be downloaded" >&2
    return 1
}
apt apt-get update
for package in "$@"; do
    download "$package"
done
rm -rf "$folder/apt"
