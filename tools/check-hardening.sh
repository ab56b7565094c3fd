#!/usr/bin/env sh
# The measurements of docs/hardening.md, time-boxed to 20 minutes on two cores after the build.
# Each step prints the numbers that the page has; a fault makes the exit code 1.
set -u
cd "$(dirname "$0")/.."
cargo=${CARGO:-cargo}
faults=0
step() {
    name=$1
    shift
    echo
    echo "== $name"
    start=$(date +%s)
    "$@" || { echo "FAULT: $name"; faults=$((faults + 1)); }
    echo "== $name: $(($(date +%s) - start)) s"
}
env_step() {
    name=$1
    variables=$2
    shift 2
    step "$name" env $variables "$@"
}
echo "device: $("${CARGO_TARGET_DIR:-target}"/release/rubor adapters 2>/dev/null | head -1)"
echo "date: $(date -u +%Y-%m-%d), $(nproc) cores"
# Of the whole workspace, so that every step uses the crates of one build.
test="$cargo test --release --locked --workspace"
# Up to 5 minutes, 4, 1, 2, 3, 2.
env_step "hostile files" "RUBOR_HOSTILE=all" $test --test hostile -- --nocapture
env_step "kill -9" "RUBOR_KILLS=${KILLS:-34}" $test --test folders -- --nocapture --ignored
step "folders" $test --test folders --test frames
step "openjd" sh tests/openjd/run.sh "${CARGO_TARGET_DIR:-target}/release/rubor"
env_step "random frames" "RUBOR_PROPERTIES=10000 RUBOR_PROPERTY_SECONDS=${PROPERTY_SECONDS:-180}" \
    $test --test random_frames -- --nocapture
step "fuzzing" sh -c "cd tests/fuzz && CARGO_TARGET_DIR=\${CARGO_TARGET_DIR:-target} $cargo run --release --quiet -- all --seconds ${FUZZ_SECONDS:-8}"
step "memory per frame" $test --test memory
if $cargo deny --version >/dev/null 2>&1; then step "cargo deny" $cargo deny --log-level error check; else echo "SKIPPED: cargo-deny is not installed"; fi
echo
echo "$faults faults"
test "$faults" -eq 0
