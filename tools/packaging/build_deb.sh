#!/bin/sh
# Builds the Debian packages of what is committed, in a clean root: build_deb.sh [-l] OUT [SUITE]
#   -l      lintian looks at them, too
#   OUT     folder for the packages and the source package
#   SUITE   of Debian, bookworm unless named
# As root, with debootstrap. The root is made in $TMPDIR, of the mirror $EBPO_DEBIAN_MIRROR, and goes away
# afterwards; with $EBPO_DEB_ROOT=FOLDER it is kept there, for the next time. $EBPO_DEB_FOLDER: where in it
# below /build it is built, ebpo by default: to see whether the packages depend on that.
set -eu
look=no
[ "${1:-}" != -l ] || { look=yes && shift; }
[ $# = 1 ] || [ $# = 2 ] || { echo "usage: build_deb.sh [-l] OUT [SUITE]" >&2 && exit 2; }
mkdir -p "$1"
out=$(cd "$1" && pwd) suite=${2:-bookworm}
source=$(cd "$(dirname "$0")/../.." && pwd)
mirror=${EBPO_DEBIAN_MIRROR:-} # empty: the one that debootstrap knows
[ "$(id -u)" = 0 ] || { echo "build_deb.sh: making a root of Debian's needs root (or sudo)" >&2 && exit 1; }
command -v debootstrap >/dev/null ||
    { echo "build_deb.sh: debootstrap is missing: apt install debootstrap" >&2 && exit 1; }

made=
root=${EBPO_DEB_ROOT:-}
[ -n "$root" ] || { root=$(mktemp -d) && made=$root; }
ended() {
    umount "$root/proc" 2>/dev/null || true
    [ -z "$made" ] || rm -rf "$made"
}
trap ended EXIT
trap 'exit 1' INT TERM HUP
[ -e "$root/etc/debian_version" ] || debootstrap --variant=minbase "$suite" "$root" ${mirror:+"$mirror"}
cp /etc/resolv.conf "$root/etc/"
mount -t proc proc "$root/proc"
within() {
    chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"
}

# The source package: a tarball of what is committed, and debian/ beside meson.build.
version=$(sed -n "s/^  version: '\(.*\)',$/\1/p" "$source/meson.build")
name=ebpo-octree-$version
work=/build/${EBPO_DEB_FOLDER:-ebpo}
rm -rf "${root:?}$work" && mkdir -p "$root$work"
git -C "$source" -c tar.umask=022 archive --format=tar --prefix="$name/" HEAD |
    xz -T1 >"$root$work/ebpo-octree_$version.orig.tar.xz"
tar -C "$root$work" -xf "$root$work/ebpo-octree_$version.orig.tar.xz"
cp -R "$root$work/$name/tools/packaging/debian" "$root$work/$name/debian"

within apt-get update -qq
within apt-get install -y -qq --no-install-recommends build-essential fakeroot >/dev/null
within sh -c "cd $work/$name && apt-get build-dep -y -qq --no-install-recommends ./" >/dev/null
within sh -c "cd $work/$name && dpkg-buildpackage -us -uc"
find "$root$work" -maxdepth 1 -type f -exec cp -p {} "$out/" \;
if [ $look = yes ]; then
    within apt-get install -y -qq --no-install-recommends lintian >/dev/null
    within sh -c "cd $work && lintian --allow-root -i -I --pedantic ./*.changes"
fi
(cd "$out" && sha256sum ./*.deb)
