#!/bin/sh
# Compares exports with other programs: validator, three.js, Babylon.js, Blender, OpenUSD. Not part of `make test`, as it
# downloads them. What is missing is said and left out.
#
#   tests/interchange/run.sh [FOLDER]     FOLDER (out/interchange) gets exports, references and pictures
#
# BPY_PYTHON and USD_PYTHON: pythons with the packages bpy and usd-core; made in FOLDER where they are not set.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
out=${1:-$here/../../out/interchange}
mkdir -p "$out/node"
out=$(cd "$out" && pwd)
cd "$here/../.."
cargo build --release --locked -p rubor -p rubor-tests --bins --examples
rubor=${CARGO_TARGET_DIR:-target}/release/rubor
reference=${CARGO_TARGET_DIR:-target}/release/examples/interchange_reference
status=0

for name in mixed combined; do
  "$rubor" export --rig "$here/$name.rig.json" --sequence "$here/$name.json" -o "$out/$name.glb"
  "$rubor" export --rig "$here/$name.rig.json" --sequence "$here/$name.json" --linear -o "$out/$name-linear.glb"
done
"$rubor" export --sequence rig/src/demo_sequence.json --linear -o "$out/demo-linear.glb"
"$rubor" export --sequence rig/src/demo_sequence.json -o "$out/demo.glb"
"$rubor" export --sequence rig/src/demo_sequence.json --textures webp --top-shapes 8 -o "$out/top.glb"
"$rubor" export --sequence rig/src/demo_sequence.json --bake joy --textures png --small -o "$out/baked.glb"
"$rubor" export --still -o "$out/still.glb"
"$rubor" export --sequence rig/src/demo_sequence.json -o "$out/demo.usda"
"$rubor" export --rig "$here/combined.rig.json" --sequence "$here/combined.json" -o "$out/combined.usda"
for name in mixed combined demo top mixed-linear combined-linear demo-linear; do "$reference" "$out/$name.glb" "$out/$name"; done
for name in combined demo; do "$reference" "$out/$name.glb" "$out/$name-frames" frames; done

if command -v npm >/dev/null; then
  cp "$here/package.json" "$out/node/"
  [ -d "$out/node/node_modules" ] || (cd "$out/node" && npm install --silent)
  (cd "$out/node" && node "$here/validate.mjs" "$out"/*.glb) || status=1
  for name in mixed combined demo top; do
    (cd "$out/node" && node "$here/browser.mjs" "$out/$name.glb" "$out/$name") || status=1
  done
else
  echo "SKIPPED: validator, three.js and Babylon.js need npm"
fi

python_with() { # package, variable's value
  if [ -n "$2" ]; then echo "$2"; return; fi
  [ -x "$out/$1/bin/python" ] || { python3 -m venv "$out/$1" && "$out/$1/bin/pip" install -q "$1" numpy; } >&2 || return 0
  echo "$out/$1/bin/python"
}
bpy=$(python_with bpy "${BPY_PYTHON:-}")
# Blender's importer drops the slopes of cubic keys, so it gets straight lines.
if [ -n "$bpy" ] && "$bpy" -c "import bpy" 2>/dev/null; then
  for name in mixed-linear combined-linear demo-linear; do
    "$bpy" "$here/blender_compare.py" "$out/$name.glb" "$out/$name" --picture || status=1
  done
else
  echo "SKIPPED: Blender (package bpy) cannot be had here"
fi
usd=$(python_with usd-core "${USD_PYTHON:-}")
if [ -n "$usd" ] && "$usd" -c "import pxr" 2>/dev/null; then
  for name in combined demo; do "$usd" "$here/usd_compare.py" "$out/$name.usda" "$out/$name-frames" || status=1; done
else
  echo "SKIPPED: OpenUSD (package usd-core) cannot be had here"
fi
exit $status
