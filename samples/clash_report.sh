#!/bin/sh
# clash_report.sh FOLDER [PARTS]: makes a plant of many parts and a tool that flies through, and
# reports their clashes as an HTML page, a strip of pictures, a table and an HDF5 file. Needs ebpo in
# PATH, built with libpng.
#
#     sh samples/clash_report.sh /tmp/clashes 300
set -eu
folder=$1 parts=${2:-1000}
samples=$(dirname "$0")

python3 "$samples/many_parts.py" "$folder" "$parts"
cd "$folder"
for out in clashes.html clashes.h5; do
    ebpo scene report --quiet --from 0 --to 10 --step 0.5 --count --locations --depth 0.01 \
        --output $out plant.scene.json
done
ebpo scene report --quiet --from 0 --to 10 --step 1.25 --output clashes.png plant.scene.json
ebpo scene report --quiet --from 0 --to 10 --step 0.5 --locations --depth 0.01 --csv \
    plant.scene.json >clashes.csv
ls clashes.*
