#!/usr/bin/env bash
# Takes the README's picture: streams the default example into a viewer without a screen and saves what it shows.
# Needs the tests' set-up and a software Vulkan driver (Debian: apt-get install mesa-vulkan-drivers libvulkan1).
set -euo pipefail
cd "$(dirname "$0")/.."
picture=${1:-examples/02_hub_two_panels/viewer.png}
port=9899
driver=$(ls /usr/share/vulkan/icd.d/lvp_icd*.json 2>/dev/null | head -1 || true)
[ -n "$driver" ] || { echo "screenshot: no software Vulkan driver; apt-get install mesa-vulkan-drivers libvulkan1" >&2; exit 1; }
export VK_DRIVER_FILES=$driver XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-/tmp}

.venv/bin/rerun --headless --bind 127.0.0.1 --port $port --hide-welcome-screen --window-size 1600x900 >/dev/null 2>&1 &
# the command is a wrapper that starts the viewer: end the whole group
trap 'pkill -P $! 2>/dev/null || true; kill $! 2>/dev/null || true' EXIT
for _ in $(seq 50); do (exec 3<>/dev/tcp/127.0.0.1/$port) 2>/dev/null && break; sleep 0.2; done
sleep 8   # notices of the viewer's start fade
target/release/pliant run examples/02_hub_two_panels/scene.toml --duration 2.55 --viewer connect --url "rerun+http://127.0.0.1:$port/proxy" >/dev/null 2>&1
sleep 3
.venv/bin/python - "$picture" $port <<'PY'
import sys
import time
from PIL import Image
from rerun.experimental import ViewerClient
path, port = sys.argv[1], sys.argv[2]
ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy").save_screenshot(path)
for _ in range(50):  # the viewer writes the file after the call returns
    time.sleep(0.2)
    try:
        image = Image.open(path).convert("RGB")
        break
    except OSError:
        continue
else:
    sys.exit("screenshot: the viewer wrote no whole picture")
image.quantize(256).save(path, optimize=True)
PY
echo "wrote $picture"
