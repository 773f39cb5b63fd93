#!/usr/bin/env bash
# Builds a wheel of the Python module that runs on other distributions, with its libraries in it, and prints its path:
# installs what is missing, builds the module in build/wheel or, with an argument, takes it from that build folder. Needs
# root or sudo for the packages that are missing. The wheel is for the version of Python of this machine; its name says
# how new the C library must be.
set -euo pipefail
cd "$(dirname "$0")/.."

tools/install_packages.sh --wheel
python=$(command -v /usr/bin/python3 || command -v python3)
mkdir -p build/wheels
"$python" - "${1-}" <<'PYTHON'
import sys

sys.path.insert(0, "python")
from pathlib import Path

import build_backend
import portable_wheel

settings = {"build-dir": sys.argv[1]} if sys.argv[1] else {}
folder = Path("build/wheels").resolve()
wheel = folder / build_backend.build_wheel(folder, settings)
print(portable_wheel.make_portable(wheel, folder))
wheel.unlink()
PYTHON
