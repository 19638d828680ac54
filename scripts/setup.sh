#!/usr/bin/env bash
# Installs what the build, the viewer and the Python scripts need into .venv: nothing outside this folder changes.
# Needs Rust's toolchain, a C compiler, and Python 3.11 or newer with venv and pip.
set -euo pipefail
cd "$(dirname "$0")/.."

for tool in cargo cc python3; do
    command -v "$tool" >/dev/null || { echo "setup: $tool is missing; install Rust (cargo), a C compiler (cc) and Python 3.11 (python3)" >&2; exit 1; }
done
# an environment and the requirements it holds; nothing is done while these are unchanged
environment() {
    local folder=$1 requirements=$2 what=$3 wanted
    wanted=$(sha256sum "$requirements" | cut -d' ' -f1)
    if [ "$(cat "$folder/requirements.sha256" 2>/dev/null || true)" != "$wanted" ]; then
        echo "setup: installing $what into $folder" >&2
        python3 -m venv "$folder"
        "$folder/bin/python" -m pip install --quiet --disable-pip-version-check -r "$requirements"
        if [ -x "$folder/bin/rerun" ]; then "$folder/bin/rerun" analytics disable >/dev/null 2>&1 || true; fi
        echo "$wanted" >"$folder/requirements.sha256"
    fi
}
environment .venv scripts/requirements.txt "cmake, the viewer and the Python packages (about 2 minutes)"
environment .venv/nastran scripts/requirements-nastran.txt "pyNastran"
environment .venv/dask scripts/requirements-dask.txt "Dask"
