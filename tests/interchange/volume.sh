#!/bin/sh
# Compares the light of `rubor chart --volume` with that of Mitsuba 3 and Cycles in the same stills. Not part of `make test`, as it
# downloads both (packages mitsuba and bpy, 450 MB).
#
#   tests/interchange/volume.sh [FOLDER [PROGRAM..]]   FOLDER (out/volume) gets the stills, pictures and agreement.csv
#
# PROGRAM: mitsuba, cycles; both without.
# STILLS: names of stills (near-60 shadow-edge light-through-ear open-mouth). SIZE: pixels (96x96). PATHS: ours (1024).
# SAMPLES: of each of both, a multiple of 8 (1024).
# VOLUME_PYTHON: a python 3.11 with numpy, mitsuba and bpy; made in FOLDER where it is not set. RUBOR: the command; built
# where it is not set.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
out=${1:-$here/../../out/volume}
[ $# -gt 0 ] && shift
programs=${*:-mitsuba cycles}
mkdir -p "$out"
out=$(cd "$out" && pwd)
cd "$here/../.."

if [ -z "${RUBOR:-}" ]; then
  cargo build --release --locked -p rubor
  RUBOR=$(mkdir -p "${CARGO_TARGET_DIR:-target}" && cd "${CARGO_TARGET_DIR:-target}" && pwd)/release/rubor
fi
if [ -z "${VOLUME_PYTHON:-}" ]; then
  VOLUME_PYTHON=$out/python/bin/python
  [ -x "$VOLUME_PYTHON" ] || python3.11 -m venv "$out/python"
  "$VOLUME_PYTHON" -m pip install --quiet 'numpy<2' mitsuba==3.9.1 bpy==5.0.1
fi

stills=${STILLS:-near-60 shadow-edge light-through-ear open-mouth}
wanted=
folders=
for still in $stills; do
  wanted="$wanted --still $still"
  folders="$folders $out/$still"
done
# Names have no spaces.
# shellcheck disable=SC2086
"$RUBOR" chart --volume --export $wanted --size "${SIZE:-96x96}" --paths "${PATHS:-1024}" -o "$out"
for program in $programs; do
  # shellcheck disable=SC2086
  "$VOLUME_PYTHON" "$here/volume_$program.py" "${SAMPLES:-1024}" $folders
done
"$VOLUME_PYTHON" "$here/volume_scene.py" "$out"
