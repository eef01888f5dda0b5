#!/bin/sh
# Builds the Debian packages of the current commit in a clean root: build_deb.sh [-l] [-r] OUT [SUITE]
# If the web viewer was built (tools/web/dist), the package ebpo contains it.
#   -l      checks the packages with lintian; its errors and warnings are failures. The viewer is left out,
#           because lintian requires the sources of all libraries in its scripts
#   -r      builds again in a different environment, and compares every .deb
#   OUT     folder for the packages and the source package
#   SUITE   suite of Debian; default: bookworm
# Run as root, with debootstrap. The clean root is made in $TMPDIR from the mirror $EBPO_DEBIAN_MIRROR, and removed
# at the end. With EBPO_DEB_ROOT=FOLDER it is kept in FOLDER and used again. EBPO_DEB_ARCH selects another
# architecture whose programs run on this machine, such as i386 on amd64.
set -eu
usage() { echo "usage: build_deb.sh [-l] [-r] OUT [SUITE]" >&2 && exit 2; }
lint=no twice=no
while getopts lr option; do
    case $option in
    l) lint=yes ;;
    r) twice=yes ;;
    *) usage ;;
    esac
done
shift $((OPTIND - 1))
[ $# = 1 ] || [ $# = 2 ] || usage
mkdir -p "$1"
out=$(cd "$1" && pwd) suite=${2:-bookworm}
source=$(cd "$(dirname "$0")/../.." && pwd)
mirror=${EBPO_DEBIAN_MIRROR:-} # empty: the default of debootstrap
[ "$(id -u)" = 0 ] || { echo "build_deb.sh: making a Debian root needs root (or sudo)" >&2 && exit 1; }
command -v debootstrap >/dev/null ||
    { echo "build_deb.sh: debootstrap is missing: apt install debootstrap" >&2 && exit 1; }

made=
root=${EBPO_DEB_ROOT:-}
[ -n "$root" ] || { root=$(mktemp -d) && made=$root; }
ended() {
    umount "$root/proc" "$root/dev/shm" 2>/dev/null || true
    [ -z "$made" ] || rm -rf "$made"
}
trap ended EXIT
trap 'exit 1' INT TERM HUP
[ -e "$root/etc/debian_version" ] ||
    debootstrap --variant=minbase ${EBPO_DEB_ARCH:+--arch="$EBPO_DEB_ARCH"} "$suite" "$root" ${mirror:+"$mirror"}
cp /etc/resolv.conf "$root/etc/"
mount -t proc proc "$root/proc"
mount -t tmpfs -o mode=1777 tmpfs "$root/dev/shm" # for faketime
within() {
    chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"
}
install() { within apt-get install -y -qq -o Dpkg::Use-Pty=0 --no-install-recommends "$@" >/dev/null; }

version=$(sed -n "s/^  version: '\(.*\)',$/\1/p" "$source/meson.build")
name=ebpo-octree-$version
# Makes the source package: a tarball of the commit, and debian/ beside meson.build.
unpack() { # folder in the root
    to=${root:?}$1
    rm -rf "$to" && mkdir -p "$to"
    set --
    for file in "$source"/tools/web/dist/*; do
        [ $lint = yes ] || [ ! -f "$file" ] || set -- "$@" --add-file="$file"
    done
    git -C "$source" -c tar.umask=022 archive --format=tar --prefix="$name/tools/web/dist/" "$@" \
        --prefix="$name/" HEAD | xz -T1 >"$to/ebpo-octree_$version.orig.tar.xz"
    tar -C "$to" -xf "$to/ebpo-octree_$version.orig.tar.xz"
    cp -R "$to/$name/tools/packaging/debian" "$to/$name/debian"
}
build() { # folder in the root, a command before dpkg-buildpackage...
    folder=$1
    shift
    within "$@" sh -c "cd $folder/$name && dpkg-buildpackage -us -uc"
}
sums() { (cd "$1" && sha256sum ./*.deb); }

unpack /build/ebpo
within apt-get update -qq
install build-essential fakeroot
within sh -c "cd /build/ebpo/$name && apt-get build-dep -y -qq -o Dpkg::Use-Pty=0 --no-install-recommends ./" >/dev/null
build /build/ebpo
find "$root/build/ebpo" -maxdepth 1 -type f -exec cp -p {} "$out/" \;
if [ $lint = yes ]; then
    install lintian
    within sh -c "cd /build/ebpo && lintian --allow-root --fail-on error,warning -i -I --pedantic ./*.changes"
fi
if [ $twice = yes ]; then
    # Another path, user, host, umask, year, time zone, language (Turkish has a special capital i) and number of jobs.
    install faketime locales
    within localedef -i tr_TR -f UTF-8 tr_TR.UTF-8
    (umask 027 && unpack /build/else/where)
    chown -R 1234:1234 "$root/build/else" && chmod 755 "$root/build/else" "$root/build/else/where"
    build /build/else/where \
        unshare --uts sh -c 'hostname another && umask 027 && exec "$@"' sh \
        setpriv --reuid 1234 --regid 1234 --clear-groups \
        env HOME=/nonexistent USER=another TZ=XYZ+11 LC_ALL=tr_TR.UTF-8 DEB_BUILD_OPTIONS=parallel=1 \
        NO_FAKE_STAT=1 faketime -f +400d
    sums "$root/build/ebpo" >"$root/build/first"
    sums "$root/build/else/where" >"$root/build/second"
    diff "$root/build/first" "$root/build/second" || {
        echo "build_deb.sh: the packages of the two builds differ; with EBPO_DEB_ROOT set, compare them with" \
            "diffoscope in build/ebpo and build/else/where there" >&2 && exit 1
    }
    echo "build_deb.sh: both builds have the same $(wc -l <"$root/build/first") packages"
fi
sums "$out"
