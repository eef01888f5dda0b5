#!/bin/sh
# Installs the Debian packages that building needs; with --tests also what the tests need, with
# --demo what the quick start needs, with --bench the peers of the benchmarks and profilers, with
# --viewer what serves the web viewer, with --npm what builds the npm package, with --paraview
# ParaView (1 GB).
set -eu
here=$(cd "$(dirname "$0")" && pwd)
# Debian's nodejs comes without npm; others' brings it and conflicts with Debian's.
viewer="nginx-light nodejs"
command -v npm >/dev/null || viewer="$viewer npm"
modules=no
# meson finds the library folder of Debian with dpkg-dev.
packages="gcc dpkg-dev pkg-config meson ninja-build libhdf5-dev libzstd-dev zlib1g-dev \
    g++ libgmp-dev nettle-dev libassimp-dev libpng-dev libcairo2-dev libjs-chart.js \
    libcurl4-openssl-dev libqhull-dev libjansson-dev"
for option in "$@"; do
    case $option in
    --tests)
        packages="$packages abigail-tools check git hdf5-tools python3 python3-h5py python3-numpy \
            clang clang-format libclang-rt-14-dev mandoc chromium python3-pip python3-dask \
            python3-distributed python3-yaml libopenmpi-dev openmpi-bin ruby zsh fish $viewer"
        [ $modules = yes ] || modules=tests ;;
    --demo) packages="$packages hdf5-tools glmark2-data python3-h5py" ;;
    --bench)
        packages="$packages libembree-dev libcgal-dev libfcl-dev libjpeg62-turbo-dev python3 \
            linux-perf valgrind" ;;
    --npm) packages="$packages emscripten nodejs" ;;
    --paraview) packages="$packages paraview python3-paraview xvfb xauth" ;;
    --viewer) packages="$packages $viewer" modules=yes ;;
    *) echo "usage: install-deps.sh [--tests] [--demo] [--bench] [--viewer] [--npm] [--paraview]" \
        >&2; exit 2 ;;
    esac
done
missing=
for package in $packages; do
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' ||
        missing="$missing $package"
done
if [ -n "$missing" ]; then
    sudo=
    [ "$(id -u)" = 0 ] || sudo=sudo
    # shellcheck disable=SC2086
    $sudo env DEBIAN_FRONTEND=noninteractive sh -c \
        'apt-get update -qq && apt-get install -y -qq --no-install-recommends "$@"' sh $missing
fi
# The viewer's packages, as package-lock.json pins them.
limit=${EBPO_NPM_SECONDS:-600}
# npm alone waits for a silent server for many minutes, and says nothing.
npm_ci() { # options...
    (cd "$here/web" && timeout --foreground "$limit" npm ci --silent --no-audit --no-fund \
        --fetch-timeout=60000 --fetch-retries=1 "$@" && cp package-lock.json node_modules/.installed)
}
# Checks that the registry responds, with any status, within one minute.
registry_answers() {
    told=$(timeout 60 npm ping --fetch-timeout=25000 --fetch-retries=1 --fetch-retry-mintimeout=1000 2>&1) &&
        return 0
    ! echo "$told" | grep -q 'code E[0-9][0-9][0-9]$' || return 0
    why=$(echo "$told" | sed -n 's/.* code //p')
    echo "install-deps.sh: npm's registry cannot be reached (${why:-no answer}; npm ping says more)" >&2
    return 1
}
fetched() {
    echo "install-deps.sh: npm fetches the viewer's packages, for at most $limit s" >&2
    npm_ci || {
        echo "install-deps.sh: npm could not install the viewer's packages within $limit s" \
            "(npm ci in tools/web says why; more seconds: EBPO_NPM_SECONDS)" >&2
        return 1
    }
}
# Without network they come of npm's cache, if it has them all.
if [ $modules != no ] && ! cmp -s "$here/web/package-lock.json" "$here/web/node_modules/.installed" &&
    ! npm_ci --offline && { ! registry_answers || ! fetched; }; then
    [ $modules = tests ] || exit 1
    echo "install-deps.sh: the viewer's tests will be skipped" >&2
fi
