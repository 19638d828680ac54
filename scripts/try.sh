#!/usr/bin/env bash
# Sets up whatever is missing, builds pliant and runs the default example: a report, a results file and a recording.
# Arguments go to `pliant run`, for example: scripts/try.sh --viewer spawn
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/setup.sh
echo "building pliant (the first build takes about 10 minutes, most of it the viewer's and HDF5's code)" >&2
cargo build --release --locked
mkdir -p out
if [ $# -eq 0 ]; then
    set -- --rrd out/hub_two_panels.rrd --out out/hub_two_panels.h5
fi
target/release/pliant run "$@"
if [ -f out/hub_two_panels.rrd ]; then
    echo "open the picture with: .venv/bin/rerun out/hub_two_panels.rrd"
fi
