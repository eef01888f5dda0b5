#!/bin/sh
# Tests an installation in any folder, without access to other folders: test_install.sh
# MESON BUILD_ROOT SOURCE_ROOT PREFIX EBPO_INPUTS. Does not change the build folder.
set -u
meson=$1 build=$2 source=$3 prefix=$4 inputs=$5
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
fail() { echo "FAILED: $1"; cat "$work/out"; exit 1; }
unset LD_LIBRARY_PATH HDF5_PLUGIN_PATH

# Saves the log that `ninja uninstall` reads, which is of the user's own installation. The prefix already contains
# another program.
mkdir -p "$work/all$prefix/bin" && echo other >"$work/all$prefix/bin/other" || exit 1
(cd "$work/all" && find . | sort) >"$work/before"
log=$build/meson-logs/install-log.txt
[ -f "$log" ] && cp -p "$log" "$work/log"
DESTDIR="$work/all" "$meson" install -C "$build" --no-rebuild >"$work/out" 2>&1
installed=$?
# After uninstalling, the previous files and folders remain, and no others.
if [ $installed = 0 ]; then
    cp -a "$work/all" "$work/again"
    (cd "$build" && "$meson" --internal uninstall) >"$work/uninstalled" 2>&1
    (cd "$work/all" && find . | sort | diff "$work/before" -) >"$work/left"
    rm -rf "$work/all" && mv "$work/again" "$work/all"
fi
if [ -f "$work/log" ]; then cp -p "$work/log" "$log"; else rm -f "$log"; fi
[ $installed = 0 ] || fail "meson install"
if [ -s "$work/left" ]; then cp "$work/left" "$work/out"; fail "before and after uninstall"; fi

# No file is outside of the prefix.
find "$work/all" ! -type d ! -path "$work/all$prefix/*" >"$work/out"
[ ! -s "$work/out" ] || fail "files outside of the prefix"

# In another folder, whose name has spaces, the program finds its library and the plugin.
own="$work/a private prefix"
mv "$work/all$prefix" "$own" && own=$(cd "$own" && pwd -P)
ebpo=$own/bin/ebpo
"$ebpo" --version --verbose >"$work/out" 2>&1 || fail "ebpo --version --verbose"
library=$(sed -n 's/^library: \(.*\) ([0-9.]*)$/\1/p' "$work/out")
plugin=$(sed -n 's/^HDF5 plugin: //p' "$work/out")
grep -qx "program: $ebpo" "$work/out" || fail "which program runs"
case $library in "$own"/*/libebpo.so.*) ;; *) fail "which library runs" ;; esac
case $plugin in "$own"/*) ;; *) fail "where the plugin is" ;; esac
[ -f "$plugin/libebpo_h5zstd.so" ] || fail "the plugin is not in the printed folder"

# Each command has a manual page; each shell's completions are in the folder that the shell searches.
commands=$("$ebpo" --help | sed -n 's/^  \([a-z][a-z]*\)  *[a-z].*/\1/p' | grep -vx help)
[ -n "$commands" ] || fail "no commands in --help"
for command in $commands; do
    [ -s "$own/share/man/man1/ebpo-$command.1" ] || { echo "$command" >"$work/out" && fail "a command's page"; }
done
bash -c '. "$1/share/bash-completion/completions/ebpo.bash" && complete -p ebpo' bash "$own" >"$work/out" 2>&1 ||
    fail "completions for bash"
grep -q '^#compdef ebpo' "$own/share/zsh/site-functions/_ebpo" || fail "completions for zsh"
grep -q '^complete -c ebpo' "$own/share/fish/vendor_completions.d/ebpo.fish" || fail "completions for fish"

# Converts a file, and reads it with HDF5's own tools and the plugin.
"$inputs" "$work" >"$work/out" 2>&1 || fail inputs
"$ebpo" convert -q "$work/sphere.ply" "$work/s.ebpo.h5" >"$work/out" 2>&1 || fail convert
"$ebpo" verify -q "$work/s.ebpo.h5" --against "$work/sphere.ply" >"$work/out" 2>&1 || fail verify
if command -v h5dump >/dev/null; then
    HDF5_PLUGIN_PATH=$plugin h5dump -d /mesh/faces "$work/s.ebpo.h5" >"$work/out" 2>&1 || fail h5dump
    grep -q '^ *(0,0): [0-9]' "$work/out" || fail "h5dump shows no numbers"
    # It needs this plugin to read.
    HDF5_PLUGIN_PATH=$work/old h5dump -d /mesh/faces "$work/s.ebpo.h5" >"$work/out" 2>&1
    ! grep -q '^ *(0,0): [0-9]' "$work/out" || fail "h5dump reads without the plugin"
fi

# The package for Python finds the library that it was installed with.
for python in python3 /usr/bin/python3; do
    "$python" -c 'import numpy' 2>/dev/null || continue
    package=$(dirname "$(find "$own" -path '*/ebpo/_declared.py')")
    (cd "$work" && EBPO_LIBRARY= PATH=/usr/bin:/bin PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=${package%/ebpo} "$python" -c '
import ebpo
print(ebpo.library(), ebpo.open("s.ebpo.h5").inside([0, 0, 0]))') >"$work/out" 2>&1 || fail "import ebpo"
    grep -q "^$own/.* True$" "$work/out" || fail "which library the package takes"
    break
done

# The message names an older copy that the loader finds first, and reports a newer program separately.
mkdir "$work/old" && cp "$library" "$work/old/$(basename "$(ls -d "${library%.so.*}".so.?)")" || exit 1
LD_LIBRARY_PATH="$work/old" "$ebpo" --version --verbose >"$work/out" 2>&1 &&
    fail "an older copy is not detected"
grep -q "^library: $work/old/libebpo" "$work/out" || fail "the copy is not named"
grep -q "^ebpo: the running library is not the library .*$library; the loader found $work/old/.* first" "$work/out" ||
    fail "the message about the copy"

# Other programs find the installed library with pkg-config.
grep -qx 'libdir=${prefix}/lib.*' "$own"/lib*/pkgconfig/ebpo.pc 2>"$work/out" ||
    grep -rqx 'libdir=${prefix}/lib.*' "$own"/lib/*/pkgconfig/ebpo.pc 2>>"$work/out" || fail "ebpo.pc"
# They also find it after it was moved. Older build folders lack this option and are not tested.
pc=$(find "$own" -name ebpo.pc)
if command -v pkg-config >/dev/null &&
    "$meson" configure "$build" 2>/dev/null | grep -q 'pkgconfig.relocatable *true'; then
    PKG_CONFIG_PATH=$(dirname "$pc") pkg-config --variable=prefix ebpo >"$work/out" 2>&1 || fail pkg-config
    there=$(cd "$(sed 's/\\//g' "$work/out")" && pwd -P) && [ "$there" = "$own" ] || fail "ebpo.pc after a move"
fi

# pkg-config and CMake report whether the library has the extras; its headers show the same.
extras=no
[ -z "$(find "$own" -name collide.h)" ] || extras=yes
if command -v pkg-config >/dev/null; then
    PKG_CONFIG_PATH=$(dirname "$pc") pkg-config --variable=extras ebpo >"$work/out" 2>&1
    grep -qx $extras "$work/out" || fail "the variable extras of ebpo.pc"
fi

# Other programs find the library with CMake.
if command -v cmake >/dev/null; then
    mkdir "$work/user"
    cat >"$work/user/CMakeLists.txt" <<'CMAKE'
cmake_minimum_required(VERSION 3.10)
project(user C)
find_package(ebpo 0.1 REQUIRED)
add_executable(user user.c)
target_link_libraries(user ebpo::ebpo)
CMAKE
    cat >"$work/user/user.c" <<'C'
#include <ebpo/ebpo.h>
#include <stdio.h>
int main(void)
{
    puts(ebpo_version());
    return 0;
}
C
    (cd "$work/user" && cmake -S . -B made -DCMAKE_PREFIX_PATH="$own" && cmake --build made) \
        >"$work/out" 2>&1 || fail "find_package(ebpo)"
    "$work/user/made/user" >"$work/out" 2>&1 || fail "a program made by CMake"
    sed 's/ebpo 0.1 /ebpo 0.9 /' "$work/user/CMakeLists.txt" >"$work/new" && mv "$work/new" "$work/user/CMakeLists.txt"
    (cd "$work/user" && cmake -S . -B later -DCMAKE_PREFIX_PATH="$own") >"$work/out" 2>&1 &&
        fail "find_package accepts an older version"
    sed 's/ebpo 0.9 REQUIRED/ebpo REQUIRED COMPONENTS extras/' "$work/user/CMakeLists.txt" >"$work/new" &&
        mv "$work/new" "$work/user/CMakeLists.txt"
    found=no
    (cd "$work/user" && cmake -S . -B extras -DCMAKE_PREFIX_PATH="$own") >"$work/out" 2>&1 && found=yes
    [ $found = $extras ] || fail "find_package(ebpo COMPONENTS extras)"
fi

# For another machine, the configuration runs no program of that machine.
cat >"$work/cross.txt" <<'CROSS'
[binaries]
c = 'cc'
ar = 'ar'
pkgconfig = 'pkg-config'
pkg-config = 'pkg-config'
[properties]
needs_exe_wrapper = true
[host_machine]
system = 'linux'
cpu_family = 'x86_64'
cpu = 'x86_64'
endian = 'little'
CROSS
"$meson" setup "$work/cross" "$source" --cross-file "$work/cross.txt" -Dtests=disabled \
    --prefix "$own" >"$work/out" 2>&1 || fail "meson setup for another machine"
"$meson" setup "$work/system" "$source" --cross-file "$work/cross.txt" -Dtests=disabled \
    -Dplugin_dir=system >"$work/out" 2>&1 && fail "setup succeeds although HDF5 cannot run"
grep -q 'plugin_dir=system needs to run a program of the host' "$work/out" ||
    fail "the message when HDF5 cannot run"
echo OK
