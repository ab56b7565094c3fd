#!/bin/sh
# Compares exports with other programs: validator, three.js, Babylon.js, glTF Transform, Blender, OpenUSD; uses the review page
# in a browser, and reads its files with OpenEXR and OpenTimelineIO. Not part of `make test`, as it downloads them.
#
#   tests/interchange/run.sh [FOLDER [STEP..]]   FOLDER (out/interchange) gets exports, references and pictures
#
# Steps: web (npm, a Chromium), blender (package bpy), usd (package usd-core), review (npm, a Chromium; packages OpenEXR,
# opentimelineio, otio-cmx3600-adapter). Without steps all that can be had here run, and
# what is missing is said. A step that is named fails where something is missing.
#
# CHROMIUM: the browser. BPY_PYTHON, USD_PYTHON, REVIEW_PYTHON: pythons with the packages; made in FOLDER where they are not set.
# HEADS: files of other programs (.glb) that import and three.js should show alike.
# RUBOR, RUBOR_EXAMPLES: the command and the folder of its examples; built where RUBOR is not set.
# RUBOR_ADAPTER: the adapter that draws the pictures of rubor.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
out=${1:-$here/../../out/interchange}
[ $# -gt 0 ] && shift
asked=$*
mkdir -p "$out/node"
out=$(cd "$out" && pwd)
cd "$here/../.."
status=0

# wanted STEP: whether to do it. missing STEP WHAT: a failure where the step was asked for by name.
wanted() { case " ${asked:-$1} " in *" $1 "*) return 0 ;; esac; return 1; }
missing() {
  if [ -n "$asked" ]; then echo "FAILED: $2" >&2; status=1; else echo "SKIPPED: $2"; fi
}

# Whoever asks for a browser hears at once that there is none.
chromium=${CHROMIUM:-$(command -v chromium || command -v chromium-browser || command -v google-chrome || true)}
no_web=
command -v npm >/dev/null || no_web="validator, three.js and Babylon.js need npm"
[ -x "$chromium" ] || no_web="three.js and Babylon.js need a Chromium, found none at \"$chromium\" (Debian: apt-get install chromium; or set CHROMIUM)"
if [ -n "$asked" ] && [ -n "$no_web" ] && { wanted web || wanted review; }; then
  missing web "$no_web"
  exit $status
fi

if [ -z "${RUBOR:-}" ]; then cargo build --release --locked -p rubor -p rubor-tests --bins --examples; fi
target=$(mkdir -p "${CARGO_TARGET_DIR:-target}" && cd "${CARGO_TARGET_DIR:-target}" && pwd)
rubor=${RUBOR:-$target/release/rubor}
examples=${RUBOR_EXAMPLES:-$target/release/examples}

exports() {
  for name in mixed combined; do
    "$rubor" export --rig "$here/$name.rig.json" --sequence "$here/$name.json" -o "$out/$name.glb"
    "$rubor" export --rig "$here/$name.rig.json" --sequence "$here/$name.json" --linear -o "$out/$name-linear.glb"
  done
  demo=rig/src/demo_sequence.json
  "$rubor" export --sequence $demo --linear -o "$out/demo-linear.glb"
  "$rubor" export --sequence $demo -o "$out/demo.glb"
  "$rubor" export --sequence $demo --compress -o "$out/compressed.glb"
  "$rubor" export --sequence $demo --textures webp --top-shapes 8 -o "$out/top.glb"
  "$rubor" export --sequence $demo --bake joy --textures png --small -o "$out/baked.glb"
  "$rubor" export --still -o "$out/still.glb"
  "$rubor" export --sequence $demo -o "$out/demo.usda"
  "$rubor" export --rig "$here/combined.rig.json" --sequence "$here/combined.json" -o "$out/combined.usda"
  for name in mixed combined demo top mixed-linear combined-linear demo-linear; do
    "$examples/interchange_reference" "$out/$name.glb" "$out/$name"
  done
  for name in combined demo; do "$examples/interchange_reference" "$out/$name.glb" "$out/$name-frames" frames; done
}
if wanted web || wanted blender || wanted usd; then exports; fi

web() {
  cp "$here/package.json" "$out/node/"
  (cd "$out/node" && npm install --silent --no-fund --no-audit) || return 1
  cd "$out/node"
  node "$here/validate.mjs" "$out"/mixed*.glb "$out"/combined*.glb "$out"/demo*.glb "$out/top.glb" "$out/baked.glb" "$out/still.glb" || failed=1
  for name in mixed combined demo top; do node "$here/browser.mjs" "$out/$name.glb" "$out/$name" || failed=1; done
  # A coded file has the vertices of the plain one in another order of bytes, within 4 and 8 micrometres.
  node "$here/browser.mjs" "$out/compressed.glb" "$out/demo" 1e-4 three || failed=1
  # Blood and wrinkles: docs/three.js beside rubor, one white lamp, no shadows, no scattering.
  "$examples/interchange_shot" "$out/still.glb" "$here/white-light.json" "$out/shot.json" || return 1
  for pose in neutral joy anger surprise blush pallor; do
    "$here/pose.sh" "$rubor" "$out" "$pose" || failed=1
  done
  node "$here/viewer.mjs" "$out/compressed.glb" "$out" || failed=1
  # Heads of other programs, if any are given, beside plain three.js.
  for head in ${HEADS:-}; do
    "$here/look.sh" "$rubor" "$examples/interchange_shot" "$out" "look-$(basename "${head%.*}")" "$head" --scale 1 || failed=1
  done
  # Programs that do not know the extension.
  npx --no-install gltf-transform copy "$out/demo.glb" "$out/copied.glb" || failed=1
  "$rubor" check "$out/copied.glb" || failed=1
  cd "$here/../.."
  [ -z "${failed:-}" ]
}
if wanted web; then
  if [ -n "$no_web" ]; then
    missing web "$no_web"
  else
    export CHROMIUM="$chromium"
    web || status=1
  fi
fi

python_with() { # package, variable's value, more packages
  package=$1 own=$2
  shift 2
  if [ -n "$own" ]; then echo "$own"; return; fi
  [ -x "$out/$package/bin/python" ] || { python3 -m venv "$out/$package" && "$out/$package/bin/pip" install -q "$package" numpy "$@"; } >&2 || return 0
  echo "$out/$package/bin/python"
}
# Blender's importer drops the slopes of cubic keys, so it gets straight lines.
if wanted blender; then
  bpy=$(python_with bpy "${BPY_PYTHON:-}")
  if [ -n "$bpy" ] && "$bpy" -c "import bpy" 2>/dev/null; then
    for name in mixed-linear combined-linear demo-linear; do
      "$bpy" "$here/blender_compare.py" "$out/$name.glb" "$out/$name" --picture || status=1
    done
  else
    missing blender "Blender (package bpy) cannot be had here"
  fi
fi
if wanted usd; then
  usd=$(python_with usd-core "${USD_PYTHON:-}")
  if [ -n "$usd" ] && "$usd" -c "import pxr" 2>/dev/null; then
    for name in combined demo; do "$usd" "$here/usd_compare.py" "$out/$name.usda" "$out/$name-frames" || status=1; done
  else
    missing usd "OpenUSD (package usd-core) cannot be had here"
  fi
fi
# The page of a run, of two runs, and what the frames hold.
review() {
  mkdir -p "$out/node"
  cp "$here/package.json" "$out/node/"
  (cd "$out/node" && npm install --silent --no-fund --no-audit) || return 1
  draw="$rubor render --sequence $here/review.json --preset draft --no-export --resume ${RUBOR_ADAPTER:+--adapter $RUBOR_ADAPTER}"
  $draw --size 160x160 --inset hemoglobin --format exr --burn-in -o "$out/review-a" || return 1
  $draw --size 160x160 --inset hemoglobin --no-video --exposure 2.4 --scatter none -o "$out/review-b" || return 1
  $draw --size 96x64 --no-video --frames 1-10 -o "$out/review-c" || return 1
  "$rubor" compare "$out/review-a" "$out/review-b" --page "$out/review-page" >/dev/null || return 1
  (cd "$out/node" && node "$here/review.mjs" "$out/review-a" "$out/review-page" "$out/review-c" "$out/review-pictures") || failed=1
  python=$(python_with OpenEXR "${REVIEW_PYTHON:-}" opentimelineio otio-cmx3600-adapter)
  if [ -n "$python" ] && "$python" -c "import OpenEXR, opentimelineio" 2>/dev/null; then
    "$python" "$here/review_files.py" "$out/review-a" "$out/review-pictures/notes.json" "$out/review-pictures/notes.edl" || failed=1
  else
    missing review "OpenEXR and OpenTimelineIO (packages OpenEXR, opentimelineio) cannot be had here"
  fi
  [ -z "${failed:-}" ]
}
if wanted review; then
  if [ -n "$no_web" ]; then
    missing review "the review page needs a browser: $no_web"
  else
    export CHROMIUM="$chromium"
    failed=
    review || status=1
  fi
fi
exit $status
