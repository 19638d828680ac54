#!/usr/bin/env bash
# Installs what the build, the viewer and the Python scripts need into .venv: nothing outside this folder changes.
# Needs Rust's toolchain, a C compiler, and Python 3.11 or newer with venv and pip.
set -euo pipefail
cd "$(dirname "$0")/.."

for tool in cargo cc python3; do
    command -v "$tool" >/dev/null || { echo "setup: $tool is missing; install Rust (cargo), a C compiler (cc) and Python 3.11 (python3)" >&2; exit 1; }
done
wanted=$(sha256sum scripts/requirements.txt | cut -d' ' -f1)
if [ "$(cat .venv/requirements.sha256 2>/dev/null || true)" != "$wanted" ]; then
    echo "setup: installing cmake, the viewer and the Python packages into .venv (about 2 minutes)" >&2
    python3 -m venv .venv
    .venv/bin/python -m pip install --quiet --disable-pip-version-check -r scripts/requirements.txt
    .venv/bin/rerun analytics disable >/dev/null 2>&1 || true
    echo "$wanted" >.venv/requirements.sha256
fi
