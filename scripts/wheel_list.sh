#!/bin/sh
# Write FOLDER/anysim.txt: constraints by which an installer takes our packages from the wheels in the folder.
#   usage: scripts/wheel_list.sh FOLDER
set -eu

folder=$(cd "${1:?usage: scripts/wheel_list.sh FOLDER}" && pwd)
for wheel in "$folder"/anysim*.whl; do
    name=$(basename "$wheel" | cut -d - -f 1 | tr _ -)
    printf '%s @ file://%s\n' "$name" "$wheel"
done >"$folder/anysim.txt"
