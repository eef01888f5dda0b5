#!/bin/sh
# conda build runs this script and sets PREFIX, SP_DIR and CPU_COUNT. Conda has no Chart.js, so reports consist of
# data without a page.
set -eu
# shellcheck disable=SC2086
meson setup conda-build $(for part in assimp http render captions qhull; do echo "-D$part=enabled"; done) \
    --prefix="$PREFIX" -Dtests=disabled -Dchart_js=none -Dpython_dir="$SP_DIR"
ninja -C conda-build -j "${CPU_COUNT:-1}" install
