#!/usr/bin/env sh
# Coverage-guided fuzzing of one target: sh run.sh TARGET [options of libFuzzer, such as -max_total_time=600].
# Needs g++ for libFuzzer. The flags are those of `cargo fuzz --sanitizer none`, which stable Rust knows.
set -eu
cd "$(dirname "$0")"
target=$1
shift
host=$(rustc -vV | sed -n 's/host: //p')
export RUSTFLAGS="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
-Cllvm-args=-sanitizer-coverage-trace-compares -Cllvm-args=-simplifycfg-branch-fold-threshold=0 --cfg fuzzing"
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-target}/fuzz"
# With a target triple, build scripts and macros are not instrumented.
cargo build --release --target "$host" --features libfuzzer --bin "$target"
mkdir -p "corpus/$target" "artifacts/$target"
cargo run --release --quiet --bin rubor-fuzz -- "$target" --write-seeds "corpus/$target"
dictionary=""
[ -f "dictionaries/$target.dict" ] && dictionary="-dict=dictionaries/$target.dict"
exec "$CARGO_TARGET_DIR/$host/release/$target" "corpus/$target" -artifact_prefix="artifacts/$target/" \
    -rss_limit_mb=2048 -timeout=10 -max_len=65536 $dictionary "$@"
