#!/bin/sh
# One pose of the built-in head by rubor and by docs/three.js, and how far apart they are over the head.
#
#   pose.sh RUBOR OUT POSE     POSE: neutral, or an expression or state of the rig; run from a folder with node_modules
#
# MOST: the largest FLIP over the head that passes.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
rubor=$1 out=$2 pose=$3
track='"expressions"' weights="{\"$pose\": 1}"
case $pose in
  neutral) track='"expressions": {}, "states"' weights='{}' pose_track='{}' ;;
  blush|pallor|exercise|alcohol) track='"states"' pose_track=$weights ;;
  *) pose_track=$weights ;;
esac
sed "s/\"camera\"/$track: $pose_track, \"camera\"/" "$here/white-light.json" > "$out/$pose-sequence.json"
"$rubor" render --sequence "$out/$pose-sequence.json" --scatter none --transmit none --specular one-lobe --tone-map linear \
  --exposure 1 --antialias ssaa:4 --no-video --no-export ${RUBOR_ADAPTER:+--adapter "$RUBOR_ADAPTER"} -o "$out/$pose-rubor" >&2
reference="$out/$pose-rubor/frame.0001.png"
line=$(node "$here/shot.mjs" "$out/still.glb" "$out/shot.json" "$out/$pose-three.png" --weights "$weights" --over "$reference")
node "$here/over_head.mjs" "$pose" "$line" "$("$rubor" compare "$out/$pose-three.png" "$reference" -o "$out/$pose-flip.png" --json)" "${MOST:-0.12}"
