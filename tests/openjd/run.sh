#!/usr/bin/env sh
# The template of `rubor job` under openjd (PyPI: openjd-cli): valid, and its chunks give the bytes of one run.
# sh tests/openjd/run.sh [RUBOR]; the program is target/release/rubor by default. Results go to OUT (out/openjd).
set -eu
cd "$(dirname "$0")/../.."
rubor=$(realpath "${1:-target/release/rubor}")
out=$(realpath -m "${OUT:-out/openjd}")
python=${PYTHON:-python3}
rm -rf "$out"
mkdir -p "$out"
"$python" -m venv "$out/venv"
"$out/venv/bin/pip" install --quiet openjd-cli
openjd="$out/venv/bin/openjd"
cat >"$out/s.json" <<'JSON'
{ "fps": 10, "duration": 0.7, "expressions": { "joy": [{ "t": 0, "v": 0 }, { "t": 0.7, "v": 1 }] },
  "head": { "yawDegrees": [{ "t": 0, "v": -10 }, { "t": 0.7, "v": 10 }] }, "environment": { "name": "studio" } }
JSON
"$rubor" job --sequence "$out/s.json" --size 64x48 --antialias smaa-t2x --shadow-size 128 --chunk 3 -o "$out/shot.yaml"
"$openjd" check "$out/shot.yaml"
"$openjd" summary "$out/shot.yaml"
"$openjd" run "$out/shot.yaml" --job-param "Rubor=$rubor" --job-param "OutputDir=$out/farm" >"$out/openjd.txt" 2>&1 ||
    { tail -40 "$out/openjd.txt"; exit 1; }
# Once more: every chunk has its frames already.
"$openjd" run "$out/shot.yaml" --job-param "Rubor=$rubor" --job-param "OutputDir=$out/farm" >"$out/again.txt" 2>&1 ||
    { tail -40 "$out/again.txt"; exit 1; }
"$rubor" render --job "$out/shot.json" -o "$out/one" --adapter 0
count=0
for file in "$out"/one/*; do
    name=$(basename "$file")
    # These have times, the name of the folder, or hashes of such.
    case $name in stats.json | video.mp4 | review.html | sequence.otio | manifest.json) continue ;; esac
    cmp "$file" "$out/farm/$name"
    count=$((count + 1))
done
echo "openjd: 3 chunks of 7 frames, run twice; $count files with the bytes of one run"
