#!/bin/sh
# Runs the main steps with a real model: installs dependencies, builds and installs the program;
# converts the closed bunny of Debian's glmark2-data; inspects, verifies and draws the file. Writes to
# samples/out.
set -eu
cd "$(dirname "$0")/.."
sh tools/install-deps.sh --demo
# Installs the plugin where the tools of HDF5 search for it.
meson setup build-quick -Dplugin_dir=system -Dtests=disabled $([ -d build-quick ] && echo --reconfigure)
ninja -C build-quick
sudo=
[ "$(id -u)" = 0 ] || sudo=sudo
$sudo ninja -C build-quick install >/dev/null
$sudo ldconfig
PATH=/usr/local/bin:$PATH # not all systems have this folder in PATH
mkdir -p samples/out
out=samples/out/bunny.ebpo.h5
set -x
ebpo convert /usr/share/glmark2/models/bunny.obj $out
ebpo info $out
ebpo verify $out --against /usr/share/glmark2/models/bunny.obj
ebpo render $out samples/out/bunny.png --levels 0,1,2,3,4,6 --size 1200x840
h5dump -A 0 -d /levels/01/plane_counts $out
set +x
echo "Results: $out, samples/out/bunny.png"
echo "If 'ebpo' or 'man ebpo' is not found: export PATH=/usr/local/bin:\$PATH MANPATH=/usr/local/share/man:"
