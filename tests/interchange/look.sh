#!/bin/sh
# One head of another program by rubor and by plain three.js, and how far apart they are over the figure: what import keeps of
# the look of its author.
#
#   look.sh RUBOR SHOT OUT NAME HEAD.glb [FLAG..]     SHOT: the example interchange_shot; flags go to `rubor import`; run from a
#                                                     folder with node_modules
#
# three.js reads HEAD.glb itself, so import has to keep its place: with `--scale 1`, where the file is in metres.
# MOST: the largest FLIP over the figure that passes.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
rubor=$1 shot=$2 out=$3 name=$4 head=$5
shift 5
"$rubor" import "$head" "$@" -o "$out/$name.glb" >&2
"$shot" "$out/$name.glb" "$here/white-light.json" "$out/$name-shot.json"
"$rubor" render --head "$out/$name.glb" --sequence "$here/white-light.json" --scatter none --transmit none --specular one-lobe \
  --tone-map linear --exposure 1 --antialias ssaa:4 --no-video --no-export ${RUBOR_ADAPTER:+--adapter "$RUBOR_ADAPTER"} -o "$out/$name-rubor" >&2
reference="$out/$name-rubor/frame.0001.png"
line=$(node "$here/shot.mjs" "$head" "$out/$name-shot.json" "$out/$name-three.png" --plain --over "$reference")
node "$here/over_head.mjs" "$name" "$line" "$("$rubor" compare "$out/$name-three.png" "$reference" -o "$out/$name-flip.png" --json)" "${MOST:-0.05}"
