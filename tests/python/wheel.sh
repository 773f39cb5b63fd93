#!/usr/bin/env bash
# Installs the module from the source tree into a new virtual environment, without a network, and uses it there. numpy is
# that of the system.
set -euo pipefail
python=$1 build=$2
source=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$python" -m venv --system-site-packages "$work/env"
# The build is that of the interpreter of the environment: the same one.
"$work/env/bin/pip" install -q --no-index --no-build-isolation --config-settings build-dir="$build" "$source"
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
