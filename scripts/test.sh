#!/usr/bin/env bash
# Everything that must hold: format, lints, documentation, Rust tests and Python tests. Sets up whatever is missing.
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/setup.sh
export OMP_NUM_THREADS=1
step() { echo "== $*" >&2; "$@"; }

step cargo fmt --check
step cargo clippy --release --locked --all-targets -- -D warnings
RUSTDOCFLAGS="-D warnings" step cargo doc --release --locked --no-deps --lib --quiet
step cargo test --release --locked
# instructions of the hot paths against the stored ones
step .venv/bin/python scripts/count_instructions.py
# the core alone, without modal files and viewer
step cargo check --release --locked --no-default-features --lib --bins
step .venv/bin/python -m pytest -q tests/python
# a minute of damaged input for the readers
step scripts/fuzz.sh
