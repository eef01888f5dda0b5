#!/bin/sh
# every_command.sh EBPO VECTORS MODELS: runs each reading command on all conformance files, and on a
# few real models that are converted with several options. For builds with sanitizers, for example with clang:
#
#   CC=clang CXX=clang++ meson setup BUILD -Db_sanitize=undefined -Db_lundef=false \
#       --buildtype=debugoptimized -Dc_args=-fno-sanitize-recover=all
#
# Prints the number of runs, and the runs with an invalid exit code or a message of a sanitizer; then
# its exit code is 1. It takes minutes, so it is not part of the tests.
ebpo=$(realpath "$1") vectors=$(realpath "$2") models=$(realpath "$3")
folder=$(mktemp -d) && cd "$folder" || exit 2
trap 'rm -rf "$folder"' EXIT
runs=0 bad=0

r() {
    runs=$((runs + 1))
    timeout 600 "$ebpo" "$@" </dev/null >/dev/null 2>said
    code=$?
    if [ $code -gt 4 ] || grep -q 'runtime error\|Sanitizer' said; then
        bad=$((bad + 1))
        echo "code $code: ebpo $*"
        grep 'runtime error\|Sanitizer' said
    fi
}

for i in 1 2 3 4 5 6 7 8 9; do
    echo "0.$i -0.$i 0.0$i" >>points
    echo "-5 -0.$i 0.0$i 1 0.$i 0" >>rays
done
echo "-1 -1 -1 1 1 1" >boxes
r convert "$models/bunny.ply" bunny.ebpo.h5
r convert "$models/office_chair.ply" chair.ebpo.h5
r convert --face-coding gates --profile full --subtree-faces 512 "$models/cad_adis16480.ply" cad.ebpo.h5
r convert --repair "$models/blade.ply" blade.ebpo.h5
r convert --codec deflate --weld --orient --fill-holes "$models/motorbike.ply" motorbike.ebpo.h5
r check --crossings "$models/selfint_A.ply"
r verify --against "$models/office_chair.ply" chair.ebpo.h5
r report -o report --no-pictures bunny.ebpo.h5
for file in "$vectors"/failed/*.h5; do
    r info "$file"
    r verify "$file"
done
for file in "$vectors"/passed/*.h5 bunny.ebpo.h5 chair.ebpo.h5 cad.ebpo.h5; do
    for command in info verify levels 'measure --derived' 'view --eye 5,5,5' 'collide --self' \
        'haptic --seconds 0.05' 'map --grid 5,5,5 -o grid.nrrd'; do
        # shellcheck disable=SC2086
        r $command "$file"
    done
    r inside "$file" points
    r distance "$file" points
    r distance --nearest 3 "$file" points
    r ray "$file" rays
    r box "$file" boxes
    r extract --mesh "$file" mesh.ply
    r extract --level 1 "$file" level.ply
    r subset --levels 0-1 "$file" subset.ebpo.h5
    r repack "$file" repacked.ebpo.h5
    r recover -o repaired.ebpo.h5 "$file"
    r export --mesh "$file" mesh.glb
    r export --levels 0-1 "$file" levels.xdmf
    r render --size 64x64 "$file" picture.png
done
echo "$runs runs, $bad bad"
[ $bad = 0 ]
