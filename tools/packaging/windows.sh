#!/bin/sh
# Builds the library and the command for Windows (x86-64), on Linux: windows.sh FOLDER
# Writes FOLDER/ebpo-VERSION-windows-x86_64.zip: ebpo.exe, libebpo-0.dll, headers, import library, licences,
# and the viewer if it was built (docs/guide/viewer.md).
# Needs Debian's mingw-w64, wine64, cmake, meson and dpkg-dev. The libraries that are linked are built from Debian's
# source packages (tools/python/backend/static_libraries.sh), once for each FOLDER. The command has no URLs, captions
# or Assimp. Equal inputs give equal bytes.
set -eu
[ $# = 1 ] || { echo "usage: windows.sh FOLDER" >&2 && exit 2; }
host=x86_64-w64-mingw32
mkdir -p "$1"
folder=$(cd "$1" && pwd)
root=$(cd "$(dirname "$0")/../.." && pwd)
for wine in "$(command -v wine64 || true)" /usr/lib/wine/wine64 ""; do [ ! -x "$wine" ] || break; done
for tool in $host-gcc-posix $host-ar cmake meson ${wine:-wine64}; do
    command -v "$tool" >/dev/null ||
        { echo "windows.sh: $tool is missing: apt install mingw-w64 wine64 cmake meson dpkg-dev" >&2 && exit 1; }
done

export WINEPREFIX="${WINEPREFIX:-$folder/wine}" WINEDEBUG="${WINEDEBUG:--all}"
CC=$host-gcc-posix AR=$host-ar RANLIB=$host-ranlib EBPO_WINE=$wine \
    sh "$root/tools/python/backend/static_libraries.sh" "$folder/libraries" $host libpng1.6
cat >"$folder/windows.ini" <<END
[binaries]
c = '$host-gcc-posix'
cpp = '$host-g++-posix'
ar = '$host-gcc-ar'
strip = '$host-strip'
windres = '$host-windres'
pkgconfig = 'pkg-config'
exe_wrapper = '$wine'
[properties]
pkg_config_libdir = '$folder/libraries/lib/pkgconfig'
[host_machine]
system = 'windows'
cpu_family = 'x86_64'
cpu = 'x86_64'
endian = 'little'
END
[ -f "$folder/build/build.ninja" ] ||
    meson setup "$folder/build" "$root" --cross-file "$folder/windows.ini" --buildtype=release --prefix=/ebpo \
        --prefer-static -Dtests=disabled -Dhttp=disabled -Dassimp=disabled -Dqhull=disabled -Dcaptions=disabled \
        -Dchart_js=none -Dpython_dir=none -Dplugin_dir=none -Dc_args="-ffile-prefix-map=$root/=" >"$folder/meson.log"
ninja -C "$folder/build" ${EBPO_JOBS:+-j"$EBPO_JOBS"} >"$folder/ninja.log" ||
    { tail -n 40 "$folder/ninja.log" >&2 && exit 1; }
rm -rf "$folder/installed"
DESTDIR=$folder/installed meson install -C "$folder/build" --no-rebuild --strip --quiet
version=$(sed -n "s/^  version: '\(.*\)',$/\1/p" "$root/meson.build")
python3 - "$folder" "ebpo-$version-windows-x86_64" "$root" <<'END'
import pathlib
import sys
import zipfile

folder, name, root = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3])
installed = next((folder / "installed").rglob("ebpo.exe")).parents[1]
entries = {f"{path.relative_to(installed)}": path for path in installed.rglob("*")
           if path.suffix in (".exe", ".dll", ".h") or path.name.endswith(".dll.a") or
           (path.parent.name == "viewer" and path.suffix != ".gz")}
if any("/viewer/" in place for place in entries):
    entries["licences/three.txt"] = root / "tools/web/node_modules/three/LICENSE"
entries["licences/ebpo.txt"] = root / "LICENSE"
for package in ("mingw-w64-common", "gcc-mingw-w64-base"):  # parts of their libraries are in the programs
    entries[f"licences/{package}.txt"] = pathlib.Path(f"/usr/share/doc/{package}/copyright")
entries.update({f"licences/{path.name}": path for path in (folder / "libraries/licences").iterdir()})
with zipfile.ZipFile(folder / f"{name}.zip", "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
    for place, path in sorted(entries.items()):
        info = zipfile.ZipInfo(f"{name}/{place}", (1980, 1, 1, 0, 0, 0))
        info.compress_type = zipfile.ZIP_DEFLATED
        archive.writestr(info, path.read_bytes())
print(folder / f"{name}.zip")
END
