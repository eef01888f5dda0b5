#!/bin/sh
# portable_inside.sh ARCH chosen|all: portable.sh runs this script in a complete root folder.
# Builds /ebpo for ARCH in /build and tests it. Writes checksums of bytes that must be the same on
# all machines to /made/sums.
set -eu
arch=$1 tests=$2 failed=
export EBPO_VECTORS=/ebpo/format-spec/vectors EBPO_TEST_SCALE="${EBPO_TEST_SCALE:-0.02}"
export CK_TIMEOUT_MULTIPLIER=20 # qemu is slow
qemu='' cross=''
case $arch in
s390x) triplet=s390x-linux-gnu qemu=qemu-s390x-static family=s390x endian=big ;;
armhf) triplet=arm-linux-gnueabihf qemu=qemu-arm-static family=arm endian=little ;;
arm64) triplet=aarch64-linux-gnu qemu=qemu-aarch64-static family=aarch64 endian=little ;;
i386) triplet=i686-linux-gnu qemu=qemu-i386-static family=x86 endian=little ;;
esac
libraries=$(dpkg-architecture -a "$arch" -q DEB_HOST_MULTIARCH 2>/dev/null)

make_cross() { # where
    cat >"$1" <<END
[binaries]
c = ['ccache', '$triplet-gcc']
cpp = ['ccache', '$triplet-g++']
ar = '$triplet-ar'
strip = '$triplet-strip'
pkgconfig = 'pkg-config'
exe_wrapper = '$qemu'
[properties]
pkg_config_libdir = ['/usr/lib/$libraries/pkgconfig', '/usr/share/pkgconfig']
[host_machine]
system = 'linux'
cpu_family = '$family'
cpu = '$family'
endian = '$endian'
END
}
# Makes scripts that run the other machine's programs with qemu.
wrap() { # program...
    for program in "$@"; do
        printf '#!/bin/sh\nexec %s "%s" "$@"\n' "$qemu" "$program" >"/made/bin/${program##*/}"
        chmod +x "/made/bin/${program##*/}"
    done
}
check() { # name, command...
    name=$1
    shift
    if "$@" >"/made/$name.log" 2>&1; then
        echo "OK      $name"
    else
        echo "FAILED  $name (/made/$name.log in the root)"
        tail -5 "/made/$name.log" | sed 's/^/        /'
        failed="$failed $name"
    fi
}

if [ -n "$qemu" ]; then
    make_cross /cross.ini
    cross="--cross-file=/cross.ini"
fi
# shellcheck disable=SC2086
[ -e /build/build.ninja ] || CC="ccache gcc" CXX="ccache g++" meson setup /build /ebpo $cross \
    -Dtests=enabled -Dwerror=true -Dassimp=disabled -Dhttp=disabled -Drender=disabled \
    -Dcaptions=disabled -Dqhull=disabled -Dchart_js=none >/build.log 2>&1 || {
    tail /build.log
    exit 1
}
units="dialects ply head container predicates face_gates chunk_checksums source import number slice wide
    large_offsets"
programs="tools/ebpo samples/ebpo-generate tests/vectors/make_vectors tests/vectors/test_vectors \
    tests/lint/flags/fp_hash_default tests/lint/flags/predicates_hash_small tests/unit/test_unit \
    tests/query/test_query tests/lint/flags/simd_hash_base"
# shellcheck disable=SC2086
ninja -C /build -k 0 -j "${EBPO_JOBS:-$(nproc)}" $programs >/build.log 2>&1 || {
    grep -A3 -E ' (fatal )?error: |undefined reference' /build.log | head -60
    exit 1
}

rm -rf /made
mkdir -p /made/bin /made/tmp
export TMPDIR=/made/tmp
for program in $programs; do wrap "/build/$program"; done
cd /made
check vectors bin/test_vectors $EBPO_VECTORS /made/bin/make_vectors
mkdir -p vectors && check vectors-made bin/make_vectors /made/vectors # for same_chunks.py
check vectors-verified sh /ebpo/tests/vectors/verify_vectors.sh bin/ebpo $EBPO_VECTORS/passed
check simd bin/simd_hash_base
check hashes python3 /ebpo/tests/lint/flags/fp_flags.py /ebpo/tests/lint/flags/fp_golden.txt \
    bin/fp_hash_default
[ "$tests" = all ] || for unit in $units; do check "$unit" bin/test_unit "$unit"; done
if [ "$tests" = all ]; then
    suites() { "$1" 2>&1 | sed -n 's/.*SUITE is one of//p'; } # from its usage text
    for unit in $(suites bin/test_unit); do check "$unit" bin/test_unit "$unit"; done
    for query in $(suites bin/test_query); do check "$query" bin/test_query "$query"; done
fi
check golden python3 /ebpo/tests/integration/golden.py bin/ebpo bin/ebpo-generate \
    /ebpo/tests/integration/golden.json

# Converts the same mesh on all machines, and extracts it.
for selection in greedy leaf-planes; do
    bin/ebpo-generate --base torus --faces 30000 --seed 7 torus.ply
    case $selection in
    greedy) set -- ;;
    *) set -- --profile full ;;
    esac
    check "convert-$selection" bin/ebpo convert -q "$@" torus.ply "$selection.ebpo.h5"
    check "verify-$selection" bin/ebpo verify -q "$selection.ebpo.h5"
done
check extract bin/ebpo extract --mesh greedy.ebpo.h5 back.ply
check same-mesh cmp torus.ply back.ply
bin/predicates_hash_small >predicates.txt
# Not the .ebpo.h5: zstd writes other bytes on 32-bit and on big-endian machines.
sha256sum predicates.txt torus.ply back.ply >sums
cat sums
[ -z "$failed" ] || exit 1
