#!/bin/sh
# Builds the libraries that the wheel's library contains, as static libraries from Debian's source packages:
#
#     CC=COMPILER sh static_libraries.sh PREFIX [HOST [NAME...]]
#
# HOST names the machine that they are for, if it is another one (x86_64-w64-mingw32); NAME names further libraries
# (libpng1.6). Writes PREFIX/lib, PREFIX/include and PREFIX/licences. Packages in $EBPO_SOURCES (a folder with .dsc
# files) are used; without this variable debian_sources.sh downloads them.
# The symbols are hidden, so that other copies of these libraries in the same process are not affected.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
prefix=$1
machine=$(uname -m)-pc-linux-gnu # without it GMP uses instructions that only this processor has
host=${2:-$machine}
shift $(($# > 1 ? 2 : 1))
mkdir -p "$prefix/lib" "$prefix/licences"
prefix=$(cd "$prefix" && pwd)
work=$(mktemp -d "${TMPDIR:-/tmp}/ebpo-libraries-XXXXXX")
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
for program in make m4 dpkg-source; do
    command -v $program >/dev/null || {
        echo "static_libraries.sh: the program $program is missing; on Debian: apt install build-essential m4" >&2
        exit 1
    }
done
exec 3>&1 >"$prefix/log.txt" 2>&1
failed() { # what
    tail -n 20 "$prefix/log.txt" >&3
    echo "static_libraries.sh: $1 failed; its last messages are above (all are in log.txt of EBPO_LIBRARIES)" >&3
    exit 1
}

names="zlib libzstd gmp nettle jansson hdf5 $*"
sources=${EBPO_SOURCES:-$work}
if [ -z "${EBPO_SOURCES:-}" ]; then
    # shellcheck disable=SC2086 # a list of names
    sh "$here/../../packaging/debian_sources.sh" "$work" $names || failed "the download of $names"
fi

export CC CFLAGS="-O2 -fPIC -fvisibility=hidden -ffile-prefix-map=$work=. ${CFLAGS:-}" AR="${AR:-ar}"
export RANLIB="${RANLIB:-ranlib}" PKG_CONFIG_LIBDIR="$prefix/lib/pkgconfig" CPPFLAGS="-I$prefix/include"
export LDFLAGS="-L$prefix/lib" LC_ALL=C
jobs=$(nproc)
common="--prefix=$prefix --libdir=$prefix/lib --disable-shared --enable-static --with-pic --build=$machine
    --host=$host"
hdf5="--disable-hl --disable-fortran --disable-cxx --disable-tests --disable-tools --disable-parallel
    --enable-build-mode=production --disable-embedded-libinfo --without-szlib --with-zlib=$prefix"

# shellcheck disable=SC2086 # lists of options
build() {
    case $1 in
    zlib) ./configure --static --prefix="$prefix" && make -j"$jobs" libz.a && make install ;;
    libzstd)
        make -j"$jobs" -C lib libzstd.a ZSTD_LEGACY_SUPPORT=0 &&
            make -C lib install-static install-includes install-pc PREFIX="$prefix" LIBDIR="$prefix/lib"
        ;;
    gmp) # Debian's source has no manual
        mkdir -p doc && printf 'all install:\n' >doc/Makefile.in &&
            ./configure $common && make -j"$jobs" && make install
        ;;
    nettle) # a patch of Debian makes the file configure.ac newer than what autoconf made from it
        touch aclocal.m4 && touch configure config.h.in stamp-h.in &&
            ./configure $common --disable-public-key --disable-documentation --disable-openssl \
                --enable-fat &&
            make -j"$jobs" libnettle.a nettle.pc && make install-static install-headers install-pkgconfig
        ;;
    jansson) # its configure script is not in the source
        cd src && : >jansson_private_config.h &&
            sed 's/@json_inline@/inline/; s/@json_[a-z_]*@/1/' jansson_config.h.in >jansson_config.h &&
            for file in *.c; do
                $CC $CFLAGS -I. -DINITIAL_HASHTABLE_ORDER=3 -DUSE_URANDOM -DHAVE_ATOMIC_BUILTINS $(printf ' -DHAVE_%s' \
                    STDINT_H UNISTD_H FCNTL_H SYS_TIME_H GETPID GETTIMEOFDAY OPEN CLOSE READ LOCALE_H) -c "$file" ||
                    return 1
            done && "$AR" rcs "$prefix/lib/libjansson.a" ./*.o && cp jansson.h jansson_config.h "$prefix/include" &&
            describe jansson "" "$2"
        ;;
    hdf5) case $host in
        *-mingw32) build_hdf5_for_windows && describe hdf5-serial "-lz" "$2" ;;
        *) build_hdf5 "$2" ;;
        esac ;;
    libpng1.6)
        ./configure $common && make -j"$jobs" libpng16.la && make install-libLTLIBRARIES install-pkgincludeHEADERS \
            install-nodist_pkgincludeHEADERS install-pkgconfigDATA &&
            cp "$prefix"/include/libpng16/* "$prefix/include" &&
            cp "$prefix/lib/pkgconfig/libpng16.pc" "$prefix/lib/pkgconfig/libpng.pc"
        ;;
    esac
}

# shellcheck disable=SC2086 # lists of options
build_hdf5() { # version
    CFLAGS="$CFLAGS -w -Wno-implicit-int" ./configure $common $hdf5 && make -j"$jobs" -C src &&
        make -C src install && describe hdf5 "-lz -lm -ldl" "$1" &&
        mv "$prefix/lib/pkgconfig/hdf5.pc" "$prefix/lib/pkgconfig/hdf5-serial.pc"
}

# HDF5's configure script does not know Windows. CMake runs the programs that examine the machine by wine. Windows has
# no sys/wait.h, and nothing of it is used. CMake needs a
# file of one of the programs even where wine writes it elsewhere: digits of long double, of __float128 (not used).
build_hdf5_for_windows() {
    mkdir -p build-windows/missing/sys && : >build-windows/missing/sys/wait.h &&
        printf '21;0;' >build-windows/pac_Cconftest.out &&
        cmake -S . -B build-windows -DCMAKE_SYSTEM_NAME=Windows -DCMAKE_SYSTEM_PROCESSOR=x86_64 \
            -DCMAKE_C_COMPILER="$CC" -DCMAKE_C_FLAGS="$CFLAGS -w -I$PWD/build-windows/missing" \
            -DCMAKE_CROSSCOMPILING_EMULATOR="$EBPO_WINE" -DCMAKE_BUILD_TYPE=None -DBUILD_SHARED_LIBS=OFF \
            -DBUILD_TESTING=OFF -DHDF5_BUILD_TOOLS=OFF -DHDF5_BUILD_EXAMPLES=OFF -DHDF5_BUILD_HL_LIB=OFF \
            -DHDF5_ENABLE_EMBEDDED_LIBINFO=OFF -DHDF5_ENABLE_SZIP_SUPPORT=OFF -DHDF5_ENABLE_Z_LIB_SUPPORT=ON \
            -DZLIB_LIBRARY="$prefix/lib/libz.a" -DZLIB_INCLUDE_DIR="$prefix/include" &&
        cmake --build build-windows -j "$jobs" --target hdf5-static &&
        cp build-windows/bin/libhdf5*.a "$prefix/lib/libhdf5-serial.a" &&
        cp src/*.h build-windows/src/H5pubconf.h "$prefix/include"
}

# Writes the file NAME.pc of a library that has none.
describe() {
    printf 'Name: %s\nDescription: %s\nVersion: %s\nLibs: -L%s -l%s %s\nCflags: -I%s\n' "$1" "$1" "$3" \
        "$prefix/lib" "$1" "$2" "$prefix/include" >"$prefix/lib/pkgconfig/$1.pc"
}

for name in $names; do
    [ -f "$prefix/licences/$name.txt" ] && continue
    echo "building $name" >&3
    for found in "$sources/$name"_*.dsc; do
        (cd "$work" && dpkg-source --no-check -x "$found" "$name") || failed "unpacking $found"
    done
    version=$(sed -n 's/^Version: \([0-9.]*\).*/\1/p' "$found")
    (cd "$work/$name" && build "$name" "$version") || failed "$name"
    (cd "$work/$name" && for file in debian/copyright COPYING* LICENSE*; do
        [ ! -f "$file" ] || printf '%s:\n\n%s\n\n' "${file##*/}" "$(cat "$file")"
    done) >"$prefix/licences/$name.txt"
done
