#!/usr/bin/env sh
# Lines of the readers that blind fuzzing sees, as the table of docs/hardening.md: sh coverage.sh [options of rubor-fuzz].
# Needs llvm-profdata and llvm-cov of LLVM 19 or later (LLVM=-19 where their names end in the version). Uncovered lines of a
# file: llvm-cov show -instr-profile=... (both paths are printed).
set -eu
cd "$(dirname "$0")"
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/target}/coverage"
work=$(mktemp -d)
trap 'rm -f "$work"/*.profraw' EXIT
# Build scripts are instrumented too and leave profiles.
export LLVM_PROFILE_FILE="$work/build-%p-%m.profraw"
RUSTFLAGS="-C instrument-coverage" cargo build --release
rm -f "$work"/*.profraw
binary="$CARGO_TARGET_DIR/release/rubor-fuzz"
[ $# -gt 0 ] || set -- --seconds 20
LLVM_PROFILE_FILE="$work/run-%p-%m.profraw" "$binary" all "$@"
"llvm-profdata${LLVM:-}" merge -sparse "$work"/run-*.profraw -o "$work/fuzz.profdata"
echo "$binary $work/fuzz.profdata" >&2
"llvm-cov${LLVM:-}" export -summary-only -instr-profile="$work/fuzz.profdata" "$binary" > "$work/summary.json"
exec python3 - "$work/summary.json" <<'PYTHON'
import json, re, sys

# Every file that parses what comes from outside; writers, models and what needs several files stand elsewhere.
ROWS = [
    ("glTF, VRM, the extension", r"assets-pipeline/src/(import/gltf/|facial_appearance\.rs)"),
    ("OBJ, MTL", r"assets-pipeline/src/import/(obj|obj_file|mtl)\.rs"),
    ("targets of MakeHuman", r"assets-pipeline/src/import/makehuman/targets\.rs"),
    ("USD, packages", r"assets-pipeline/src/(import/usd[a-z_]*|usdz|check/usd)\.rs"),
    ("captures, retargeting", r"assets-pipeline/src/import/capture/"),
    ("Maya", r"maya-bridge/src/(ascii/|read/|appearance\.rs)"),
    ("JSON, rigs bound to heads, time lines", r"rig/src/(json|expression|bind|timeline)\.rs"),
]
files = json.load(open(sys.argv[1]))["data"][0]["files"]
lines = {f["filename"]: f["summary"]["lines"] for f in files}
total = [0, 0]
print("\n| readers | lines | seen |\n| --- | --- | --- |")
for name, pattern in ROWS:
    of_row = {f: l for f, l in lines.items() if re.search(pattern, f)}
    count, seen = (sum(l[k] for l in of_row.values()) for k in ("count", "covered"))
    total = [total[0] + count, total[1] + seen]
    print(f"| {name} | {count} | {100 * seen / max(count, 1):.0f} % |")
    for f, l in sorted(of_row.items()):
        print(f"    {l['covered']:5} of {l['count']:5}  {re.search(pattern + '.*', f).group()}", file=sys.stderr)
print(f"| all | {total[0]} | {100 * total[1] / max(total[0], 1):.1f} % |")
PYTHON
