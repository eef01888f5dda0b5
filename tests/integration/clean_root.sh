#!/bin/sh
# clean_root.sh DEBS WHEEL: what users do who build nothing, each in a fresh Debian 12.
#
#   DEBS    folder with the packages that tools/packaging/build_deb.sh made
#   WHEEL   the file that pip wheel tools/python made
#
# By hand, with root and debootstrap, in some ten minutes; $EBPO_DEBIAN_MIRROR is another mirror.
# In one root the packages: README's main job, a million points from Python, Dask with two workers.
# In another the wheel, in a virtual environment with numpy: the same questions. The answers of both
# must be the same bytes. Both roots are made in $TMPDIR and go away.
set -eu
[ $# = 2 ] && [ -d "$1" ] && [ -f "$2" ] || { echo "usage: clean_root.sh DEBS WHEEL" >&2 && exit 2; }
[ "$(id -u)" = 0 ] || { echo "clean_root.sh: makes root folders, so run it as root" >&2 && exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' INT TERM HUP

# Mounts are those of a child, and end with it.
inside() { # root, command...
    root=$1
    shift
    unshare --mount --fork sh -c 'mount -t proc proc "$0/proc" && mount --rbind /dev "$0/dev" &&
        exec chroot "$0" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 \
        DEBIAN_FRONTEND=noninteractive "$@"' "$root" "$@"
}
install() { # root, packages...
    root=$1
    shift
    inside "$root" sh -c 'apt-get update -qq && apt-get install -y -qq --no-install-recommends "$@"' \
        install "$@" >"$work/apt.log" 2>&1 </dev/null || { tail -20 "$work/apt.log" >&2 && exit 1; }
}
say() { echo "=== $* ==="; }

debootstrap --variant=minbase bookworm "$work/debs" ${EBPO_DEBIAN_MIRROR:+"$EBPO_DEBIAN_MIRROR"} \
    >"$work/made.log" 2>&1 || { tail "$work/made.log" >&2 && exit 1; }
cp -a "$work/debs" "$work/wheel"

say "packages"
mkdir "$work/debs/packages"
for package in "$1"/*.deb; do
    case $package in *-dbgsym_*) ;; *) cp "$package" "$work/debs/packages/" ;; esac
done
install "$work/debs" glmark2-data hdf5-tools python3-distributed
inside "$work/debs" sh -c \
    'apt-get install -y -qq --no-install-recommends /packages/*.deb' >"$work/apt.log" 2>&1 </dev/null ||
    { tail -20 "$work/apt.log" >&2 && exit 1; }
cp -R "$here/../../tools/packaging/debian/tests" "$work/debs/tests"
cp "$here/clean_root_ask.py" "$here/clean_root_dask.py" "$work/debs/"
for job in main-job ask-from-python; do
    say "packages: $job"
    inside "$work/debs" sh -c "mkdir /$job && AUTOPKGTEST_TMP=/$job sh /tests/$job"
done
say "packages: a million points"
inside "$work/debs" /usr/bin/python3 /clean_root_ask.py /main-job/bunny.ebpo.h5 /answers
say "packages: Dask, two workers"
inside "$work/debs" sh -c 'cd /
    dask-scheduler --host 127.0.0.1 --port 8786 --no-dashboard >/scheduler.log 2>&1 & first=$!
    dask-worker --nthreads 1 --no-dashboard 127.0.0.1:8786 >/worker1.log 2>&1 & second=$!
    dask-worker --nthreads 1 --no-dashboard 127.0.0.1:8786 >/worker2.log 2>&1 & third=$!
    /usr/bin/python3 /clean_root_dask.py /main-job/bunny.ebpo.h5 /answers 127.0.0.1:8786
    code=$?; kill $third $second $first; wait; exit $code'

say "wheel"
install "$work/wheel" python3-venv python3-numpy
cp "$2" "$here/clean_root_ask.py" "$work/wheel/root/"
cp "$work/debs/main-job/bunny.ebpo.h5" "$work/wheel/root/"
# numpy is the system's, as there may be no registry; nothing of the project is there.
inside "$work/wheel" sh -c 'cd /root && python3 -m venv --system-site-packages venv &&
    venv/bin/pip install -q --no-index --no-deps ebpo-*.whl &&
    venv/bin/python clean_root_ask.py bunny.ebpo.h5 /answers'
for answers in "$work/debs/answers"/*.npy; do
    cmp "$answers" "$work/wheel/answers/${answers##*/}"
done
say "all is well: packages and wheel give the same bytes"
