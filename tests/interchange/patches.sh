#!/bin/sh
# Mean light of named patches in rubor over that in Cycles, on the scenes of patches.json: linear radiance, no tone map. Not part of
# `make test`, as it downloads Blender (package bpy, 350 MB).
#
#   tests/interchange/patches.sh [FOLDER]   FOLDER (out/patches) gets pictures of both and patches.csv
#
# SCENES: the list of scenes (patches.json). SIZE: pixels on a side (192). SAMPLES: of Cycles (256).
# VOLUME_PYTHON: a python 3.11 with numpy and bpy; made in FOLDER where it is not set. What Cycles drew once is kept.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
out=${1:-$here/../../out/patches}
mkdir -p "$out"
out=$(cd "$out" && pwd)
cd "$here/../.."
if [ -z "${VOLUME_PYTHON:-}" ]; then
  VOLUME_PYTHON=$out/python/bin/python
  [ -x "$VOLUME_PYTHON" ] || python3.11 -m venv "$out/python"
  "$VOLUME_PYTHON" -m pip install --quiet 'numpy<2' bpy==5.0.1
fi
cargo run ${PROFILE---release} --locked -p rubor-tests --example interchange_patches -- \
  "${SCENES:-$here/patches.json}" "$out" "${SIZE:-192}"
"$VOLUME_PYTHON" "$here/patches_cycles.py" "${SAMPLES:-256}" "$out"
