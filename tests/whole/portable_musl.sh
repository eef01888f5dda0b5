#!/bin/sh
# portable_musl.sh: what portable.sh musl runs within a root folder. Builds the libraries with
# musl-gcc from Debian's sources, then the reading library and the command, statically, and asks
# them what the build for the GNU C library answers.
set -eu
export DEBIAN_FRONTEND=noninteractive
jobs=${EBPO_JOBS:-$(nproc)}
mkdir -p /src /musl /made
cd /src
fetch() { # source package: its folder
    [ -d "/src/$1.source" ] || {
        apt-get source -qq --download-only "$1" </dev/null >/dev/null
        dpkg-source -x /src/"$1"_*.dsc "/src/$1.source" >/dev/null
    }
    cd "/src/$1.source"
}
built() { [ -e "/musl/lib/$1" ]; }
{
    built libz.a || (fetch zlib && CC=musl-gcc ./configure --static --prefix=/musl &&
        make -j "$jobs" install)
    built libzstd.a || (fetch libzstd && make -C lib -j "$jobs" CC=musl-gcc PREFIX=/musl \
        libzstd.a install-static install-includes install-pc)
    built libgmp.a || (fetch gmp && ./configure CC=musl-gcc --prefix=/musl --disable-shared &&
        make -j "$jobs" install)
    built libnettle.a || (fetch nettle && ./configure CC=musl-gcc --prefix=/musl \
        --libdir=/musl/lib --disable-shared --disable-public-key --disable-documentation &&
        make -j "$jobs" install)
    built libjansson.a || (fetch jansson && ./configure CC=musl-gcc --prefix=/musl \
        --disable-shared && make -j "$jobs" install)
} >/made/libraries.log 2>&1 || { tail -5 /made/libraries.log; exit 1; }

[ -e /build/build.ninja ] || CC=musl-gcc PKG_CONFIG_LIBDIR=/musl/lib/pkgconfig meson setup /build \
    /ebpo -Dwerror=true -Dhdf5=disabled -Dtests=disabled -Dassimp=disabled -Dhttp=disabled \
    -Drender=disabled -Dcaptions=disabled -Dqhull=disabled -Dchart_js=none >/made/build.log 2>&1
ninja -C /build -k 0 -j "$jobs" tools/ebpo >/made/build.log 2>&1 || {
    grep -A3 -E ' (fatal )?error: |undefined reference' /made/build.log | head -60
    exit 1
}
