#!/bin/sh
# verify_vectors.sh EBPO FOLDER: every passed vector keeps all promises that a file makes.
failed=0 count=0
for vector in "$2"/*.ebpo.h5; do
    "$1" verify --quiet "$vector" || { echo "$vector: does not verify"; failed=1; }
    count=$((count + 1))
done
[ "$count" -ge 32 ] || { echo "only $count vectors in $2"; exit 1; }
exit $failed
