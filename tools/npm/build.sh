#!/bin/sh
# Builds the npm package "ebpo": the library as WebAssembly, with its JavaScript interface.
#   tools/npm/build.sh FOLDER   writes the package to FOLDER/package, and a copy for the viewer to tools/web/ebpo
# Needs Debian's emscripten, dpkg-dev, meson and nodejs. The libraries that are linked (zstd, zlib, GMP, nettle)
# are built from Debian's source packages, which apt downloads and checks. Equal sources give equal bytes.
set -eu
[ $# = 1 ] || { echo "usage: tools/npm/build.sh FOLDER" >&2; exit 2; }
mkdir -p "$1"
folder=$(cd "$1" && pwd)
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
sources=$folder/sources deps=$folder/deps
jobs=${EBPO_JOBS:-$(nproc)}
# Debian's emcc runs scripts that use Debian's modules for node.
export NODE_PATH=/usr/share/nodejs
# The module contains no path of the build; Meson's paths are relative.
relative=$(realpath --relative-to="$folder/lib" "$root")
# The flags are in one line, as gmp.h contains them.
flags="-O3 -msimd128 -ffunction-sections -fdata-sections -Wno-ignored-optimization-argument"
flags="$flags -ffile-prefix-map=$folder=. -ffile-prefix-map=$root=. -ffile-prefix-map=$relative=."

# What another version of this script has compiled may have other flags.
cmp -s "$here/build.sh" "$folder/compiled_by.sh" || rm -rf "$deps" "$folder/lib" "$folder/lib-small"
cp "$here/build.sh" "$folder/compiled_by.sh"

# Downloads and unpacks the source packages.
fetch_sources() {
    sh "$root/tools/packaging/debian_sources.sh" "$sources/files" libzstd zlib gmp nettle
    for package in "$sources"/files/*.dsc; do
        name=$(basename "$package" | sed 's/_.*//')
        rm -rf "${sources:?}/$name"
        dpkg-source --no-check -x "$package" "$sources/$name" >/dev/null
    done
    rm -f "$sources"/*.orig.tar.*
}

# Makes deps/lib/libNAME.a of C files. Flags are in $options.
compile_library() { # name, files...
    name=$1
    shift
    rm -rf "$deps/obj/$name"
    mkdir -p "$deps/obj/$name" "$deps/lib"
    # shellcheck disable=SC2086
    (cd "$deps/obj/$name" && printf '%s\n' "$@" |
        xargs -P "$jobs" -n 1 sh -c 'emcc '"$flags $options"' -c "$0" -o "$(basename "$0" .c).o"')
    rm -f "$deps/lib/lib$name.a"
    emar rcsD "$deps/lib/lib$name.a" "$deps/obj/$name"/*.o
}

# Writes a file for pkg-config.
describe_library() { # name, version
    mkdir -p "$deps/pkgconfig"
    printf 'Name: %s\nDescription: for WebAssembly\nVersion: %s\nCflags: -I%s\nLibs: -L%s -l%s\n' "$1" "$2" \
        "$deps/include" "$deps/lib" "${1#lib}" >"$deps/pkgconfig/$1.pc"
}

build_zstd() {
    zstd=$sources/libzstd/lib
    # One decoder of each kind: engines compile code when it first runs, and a second decoder takes longer to
    # compile than it saves.
    options="-DZSTD_DISABLE_ASM -DZSTD_LEGACY_SUPPORT=0 -DHUF_FORCE_DECOMPRESS_X1"
    options="$options -DZSTD_FORCE_DECOMPRESS_SEQUENCES_SHORT"
    compile_library zstd "$zstd"/common/[!pt]*.c "$zstd"/decompress/*.c
    options="$options -Os -DZSTD_NO_INLINE"
    compile_library zstd-small "$zstd"/common/[!pt]*.c "$zstd"/decompress/*.c
    cp "$zstd"/*.h "$deps/include"
    describe_library libzstd 1.5.4
}

build_zlib() {
    options=-Os # few files use deflate
    compile_library z "$sources"/zlib/inffast.c "$sources"/zlib/inflate.c "$sources"/zlib/inftrees.c \
        "$sources"/zlib/adler32.c "$sources"/zlib/crc32.c "$sources"/zlib/zutil.c "$sources"/zlib/uncompr.c
    cp "$sources"/zlib/zlib.h "$sources"/zlib/zconf.h "$deps/include"
    describe_library zlib 1.2.13
    sed -i 's/-lzlib/-lz/' "$deps/pkgconfig/zlib.pc"
}

build_nettle() {
    mkdir -p "$deps/include/nettle"
    cp "$sources"/nettle/sha2.h "$sources"/nettle/nettle-types.h "$deps/include/nettle"
    options=
    compile_library nettle "$sources"/nettle/sha256.c "$sources"/nettle/sha256-compress.c \
        "$sources"/nettle/write-be32.c
    describe_library nettle 3.8.1
}

build_gmp() {
    mkdir -p "$deps/gmp" "$sources/gmp/doc"
    printf 'all:\n' >"$sources/gmp/doc/Makefile.in" # which Debian omits with the manual
    # Integers and rationals alone, without the functions for output and random numbers.
    common="assert errno extract-dbl invalid memory mp_bpl mp_clz_tab mp_dv_tab mp_minv_tab mp_get_fns mp_set_fns
        primesieve tal-reent"
    # Half of the code are algorithms that are faster for numbers of more than 9600 bits, which are rare here. A
    # threshold that no number of limbs reaches omits them; the algorithms for smaller numbers take their place.
    thresholds=
    for algorithm in MUL_TOOM44 MUL_TOOM6H MUL_TOOM8H MUL_TOOM32_TO_TOOM43 MUL_TOOM32_TO_TOOM53 MUL_TOOM42_TO_TOOM53 \
        MUL_TOOM42_TO_TOOM63 MUL_FFT SQR_TOOM4 SQR_FFT MU_DIV_QR MU_DIVAPPR_Q MUPI_DIV_QR MU_BDIV_QR MU_BDIV_Q \
        INV_MULMOD_BNM1 GCD_DC; do
        thresholds="$thresholds -D${algorithm}_THRESHOLD=0x100000000"
    done
    (
        cd "$deps/gmp"
        CC=emcc AR=emar RANLIB=emranlib NM=emnm CC_FOR_BUILD=cc CFLAGS="$flags" CPPFLAGS="$thresholds" \
            "$sources/gmp/configure" \
            --host=none --disable-assembly --disable-shared --disable-cxx >configure.log 2>&1
        {
            make gmp.h fac_table.h fib_table.h mp_bases.h trialdivtab.h mpn/fib_table.c mpn/mp_bases.c \
                mpn/jacobitab.h mpn/perfsqr.h sieve_table.h
            for part in mpn mpz mpq; do make -j"$jobs" -C $part; done
            # shellcheck disable=SC2046
            make -j"$jobs" $(printf '%s.lo ' $common)
        } >make.log 2>&1
        rm -f "$deps/lib/libgmp.a"
        emar rcsD "$deps/lib/libgmp.a" ./*.o mpn/*.o mpz/*.o mpq/*.o
    ) || { tail -n 5 "$deps/gmp"/*.log >&2; exit 1; }
    cp "$deps/gmp/gmp.h" "$deps/include"
    describe_library gmp 6.2.1
}

# Makes deps/lib/libebpoSUFFIX.a of folders of lib.
build_library() { # suffix, folders as a regular expression, more flags
    build=$folder/lib$1
    describe_library jansson 2.14 # which meson.build requires; the folders do not use it
    # shellcheck disable=SC2086
    words=$(printf "'%s', " $flags $3 "-I$deps/include")
    cat >"$folder/emscripten.ini" <<EOF
[binaries]
c = 'emcc'
ar = 'emar'
strip = 'emstrip'
pkgconfig = 'pkg-config'
[properties]
needs_exe_wrapper = true
pkg_config_libdir = '$deps/pkgconfig'
[host_machine]
system = 'emscripten'
cpu_family = 'wasm32'
cpu = 'wasm32'
endian = 'little'
[built-in options]
c_args = [${words}'-DEBPO_NO_MESH_READERS']
EOF
    [ -f "$build/build.ninja" ] ||
        meson setup "$build" "$root" --cross-file "$folder/emscripten.ini" --buildtype=plain \
            -Dhdf5=disabled -Dhttp=disabled -Dassimp=disabled -Drender=disabled -Dcaptions=disabled \
            -Dqhull=disabled -Dtests=disabled -Dchart_js=none >"$folder/meson.log"
    ninja -C "$build" build.ninja >/dev/null # lists files that are new since the last build
    objects=$(ninja -C "$build" -t targets all | sed -n 's/: c_COMPILER$//p' | grep -E "/($2)[^/]*\.o\$")
    # shellcheck disable=SC2086
    ninja -C "$build" -j"$jobs" $objects >"$folder/ninja.log" ||
        { tail -n 20 "$folder/ninja.log" >&2; exit 1; }
    rm -f "$deps/lib/libebpo$1.a"
    # shellcheck disable=SC2086
    (cd "$build" && emar rcsD "$deps/lib/libebpo$1.a" $objects)
}

# Links a module of the package, FILE.wasm, of C files in module/ and the libraries with a suffix. A function with
# one caller is inlined only if it is small, because engines compile all of a long function before they run it.
link_module() { # file, suffix, C files...
    output=$folder/package/$1
    libraries="${2:+-Os} -lebpo$2 -lebpo-small -lzstd$2"
    shift 2
    # shellcheck disable=SC2086
    (cd "$here/module" && emcc $flags -std=gnu11 -ffp-contract=off -Wall -Wextra \
        -I"$root/lib/include" -I"$root/lib" -I"$deps/include" "$@" \
        -L"$deps/lib" $libraries -lz -lgmp -lnettle --no-entry -sSTANDALONE_WASM \
        -sIMPORTED_MEMORY -sALLOW_MEMORY_GROWTH -sMAXIMUM_MEMORY=4GB -sINITIAL_MEMORY=8MB \
        -sTOTAL_STACK=2MB -sABORTING_MALLOC=0 -sWASM_BIGINT \
        -sBINARYEN_EXTRA_PASSES=--one-caller-inline-max-function-size=300 \
        -sEXPORTED_FUNCTIONS=_malloc,_free -o "$output")
}

build_package() {
    rm -rf "$folder/package"
    mkdir -p "$folder/package"
    core="object.c model.c queries.c levels.c view_stream.c subtrees.c attributes.c check.c no_encoders.c"
    # shellcheck disable=SC2086
    link_module ebpo.wasm "" $core
    link_module ebpo-view.wasm -small object.c view.c view_faces.c surface.c no_encoders.c
    # shellcheck disable=SC2086
    link_module ebpo-collide.wasm "" $core collide.c
    version=$(sed -n "s/^  version: '\(.*\)',$/\1/p" "$root/meson.build")
    cp "$here"/ebpo/*.js "$here"/ebpo/*.d.ts "$here/ebpo/README.md" "$root/LICENSE" "$folder/package"
    sed "s/@VERSION@/$version/" "$here/ebpo/package.json.in" >"$folder/package/package.json"
    rm -rf "$root/tools/web/ebpo"
    cp -r "$folder/package" "$root/tools/web/ebpo"
}

mkdir -p "$deps/include"
# No "&&" in the braces: left of it, set -e does not end the script.
[ -f "$sources/.done" ] || {
    fetch_sources
    touch "$sources/.done"
}
[ -f "$deps/.complete" ] || {
    build_zstd
    build_zlib
    build_nettle
    build_gmp
    touch "$deps/.complete"
}
folders='core|geometry|hdf5_read|format'
build_library "" "$folders|levels|query_[^mws]|extras_collide" "" # with all kernels
# For the viewers' module, whose size delays the first picture, and for folders in which size matters more than time.
build_library -small "$folders|io|hdf5_write|mesh|construct|query_[mws]|levels_surface|derive_mesh" -Os
build_package
