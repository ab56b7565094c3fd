#!/bin/sh
# view-pictures.sh [RUBOR]: makes the pictures of docs/view.md, on a virtual display. Needs Xvfb (`make xvfb`).
set -eu
cd "$(dirname "$0")/.."
rubor=${1:-target/release/rubor}
folder=$(mktemp -d)
mkfifo "$folder/number"
Xvfb -displayfd 3 -screen 0 1600x1000x24 -nolisten tcp 3>"$folder/number" 2>/dev/null &
display=$!
trap 'kill $display; rm -r "$folder"' EXIT
read -r number <"$folder/number"
cat >"$folder/script.jsonl" <<'END'
{"until": "idle"}
{"seek": 4.5}
{"click": "track expressions.joy"}
{"drag": "shape browOuterUpLeft", "to": 0.5}
{"until": "idle"}
{"wait": 0.3}
{"screenshot": "docs/pictures/view.jpg"}
{"seek": 8.0}
{"click": "button Release"}
{"click": "overlay"}
{"click": "overlay hemoglobin"}
{"until": "idle"}
{"wait": 0.3}
{"screenshot": "docs/pictures/view-overlay.jpg"}
{"close": true}
END
DISPLAY=:$number "$rubor" view --preset review --size 640x640 --script "$folder/script.jsonl"
