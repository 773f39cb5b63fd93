#!/usr/bin/env bash
# Installs the module from the source tree into new virtual environments, without a network, and uses it there: with the
# numpy of the system, and in an empty environment without any.
set -euo pipefail
python=$1 build=$2
source=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# install NAME [OPTION]...: makes an environment and installs the wheel. The build is that of its interpreter.
install() {
  local name=$1
  shift
  "$python" -m venv "$@" "$work/$name"
  "$work/$name/bin/pip" install -q --no-index --no-build-isolation --config-settings build-dir="$build" "$source"
}

install env --system-site-packages
cd "$work"
env -u PYTHONPATH "$work/env/bin/python" -c '
import heba, sys
assert heba.__file__.startswith(sys.prefix), heba.__file__
assert "best" in heba.methods()
try:
    heba.calibrate_hand_eye([], [], [], [])
except heba.Error as error:
    print("installed heba", heba.__version__, "-", error)
else:
    raise SystemExit("no poses give a result")
'
"$work/env/bin/pip" uninstall -q -y heba

cd - > /dev/null
install empty
cd "$work"
cat > scene.yaml << 'scene'
setup: eye_to_hand
target: {type: chessboard, rows: 6, columns: 7, square: 30 mm}
camera: {model: brown5, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240, distortion: [-0.08, 0.05, 0, 0, 0]}
hand_eye: {translation: [1050 mm, 50 mm, 400 mm], rpy: [-88 deg, 3 deg, 91 deg]}
board: {translation: [50 mm, -30 mm, 60 mm], rpy: [178 deg, 3 deg, 20 deg]}
motion: {captures: 12, distance: 500 mm, depth: 0.2, tilt: 25 deg, spin: 60 deg, spread: 0.3}
seed: 3
scene
if [ -x "$build/heba" ]; then
  "$build/heba" simulate scene.yaml --out cell --quiet
fi
env -u PYTHONPATH HEBA_CACHE= "$work/empty/bin/python" -c '
import importlib.util, os, sys
assert importlib.util.find_spec("numpy") is None
import heba
assert heba.__file__.startswith(sys.prefix), heba.__file__
assert "best" in heba.methods()
try:
    heba.calibrate_hand_eye([], [], [], [])
except ImportError as error:
    print("without numpy:", error)
else:
    raise SystemExit("heba.calibrate_hand_eye works without numpy")
if os.path.exists("cell"):
    result = heba.run("cell/config.yaml", out="run")
    assert "bundle" in result.table()
    print("without numpy: a run with the verdict", result.verdict["grade"])
'

# A portable wheel brings all of its libraries but those of every machine.
if ! command -v patchelf > /dev/null; then
  echo "skipped: patchelf is missing, which makes a portable wheel"
  exit 0
fi
"$work/empty/bin/pip" uninstall -q -y heba
"$python" "$source/python/build_backend.py" "$build/python/heba" "$work" > /dev/null
wheel=$("$python" "$source/python/portable_wheel.py" "$work"/heba-*-linux_*.whl "$work")
"$work/empty/bin/pip" install -q --no-index "$wheel"
site=$(echo "$work"/empty/lib/python3*/site-packages)
others=$(ldd "$site"/heba/_heba*.so | grep '=>' | grep -v heba.libs | awk '{print $1}' |
  grep -vE '^(libc|libm|libdl|librt|libpthread|libutil|libresolv|libgcc_s|libstdc\+\+)\.so' || true)
if [ -n "$others" ]; then
  echo "the portable wheel needs libraries that it does not bring: $others"
  exit 1
fi
env -u PYTHONPATH HEBA_CACHE= "$work/empty/bin/python" -c '
import os, heba
if os.path.exists("cell"):
    print("portable wheel: a run with the verdict", heba.run("cell/config.yaml", out="portable").verdict["grade"])
'
echo "portable wheel: $(basename "$wheel")"
