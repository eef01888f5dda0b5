#!/bin/sh
# clean_root.sh DEBS WHEEL: tests the packages and the wheel, each in a new Debian 12.
#
#   DEBS    folder with the packages that tools/packaging/build_deb.sh made
#   WHEEL   the file that pip wheel tools/python made
#
# Run it by hand, as root and with debootstrap; it takes about ten minutes. EBPO_DEBIAN_MIRROR selects another mirror.
# The packages are installed in one root folder. There it runs README's main example, a million queries from Python,
# and Dask with two workers. The wheel is installed in another root folder, in a virtual environment with numpy, and
# runs the same queries. The results of both must be equal byte for byte. Both root folders are made in $TMPDIR and
# removed at the end.
set -eu
[ $# = 2 ] && [ -d "$1" ] && [ -f "$2" ] || { echo "usage: clean_root.sh DEBS WHEEL" >&2 && exit 2; }
[ "$(id -u)" = 0 ] || { echo "clean_root.sh: makes root folders, so run it as root" >&2 && exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' INT TERM HUP

# Runs a command in a root folder. A child process has the mounts, which end with it.
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
cp "$here/clean_root_query.py" "$here/clean_root_dask.py" "$work/debs/"
for job in quickstart query-from-python; do
    say "packages: $job"
    inside "$work/debs" sh -c "mkdir /$job && AUTOPKGTEST_TMP=/$job sh /tests/$job"
done
say "packages: a million points"
inside "$work/debs" /usr/bin/python3 /clean_root_query.py /quickstart/bunny.ebpo.h5 /results
say "packages: Dask, two workers"
inside "$work/debs" sh -c 'cd /
    dask-scheduler --host 127.0.0.1 --port 8786 --no-dashboard >/scheduler.log 2>&1 & first=$!
    dask-worker --nthreads 1 --no-dashboard 127.0.0.1:8786 >/worker1.log 2>&1 & second=$!
    dask-worker --nthreads 1 --no-dashboard 127.0.0.1:8786 >/worker2.log 2>&1 & third=$!
    /usr/bin/python3 /clean_root_dask.py /quickstart/bunny.ebpo.h5 /results 127.0.0.1:8786
    code=$?; kill $third $second $first; wait; exit $code'

say "wheel"
install "$work/wheel" python3-venv python3-numpy
cp "$2" "$here/clean_root_query.py" "$work/wheel/root/"
cp "$work/debs/quickstart/bunny.ebpo.h5" "$work/wheel/root/"
# numpy is the system's, because no package index may be reachable. Nothing of the project is installed here.
inside "$work/wheel" sh -c 'cd /root && python3 -m venv --system-site-packages venv &&
    venv/bin/pip install -q --no-index --no-deps ebpo-*.whl &&
    venv/bin/python clean_root_query.py bunny.ebpo.h5 /results'
for results in "$work/debs/results"/*.npy; do
    cmp "$results" "$work/wheel/results/${results##*/}"
done
say "OK: packages and wheel give equal results"
