#!/usr/bin/env bash
# Builds the Debian package and prints its path: installs what is missing, builds in build/package and packs. Needs root or
# sudo for the packages that are missing. The package installs on the same release of Debian.
set -euo pipefail
cd "$(dirname "$0")/.."

tools/install_packages.sh
cmake -S . -B build/package -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_INSTALL_PREFIX=/usr -DHEBA_BUILD_TESTS=OFF -DHEBA_UNITE=ON >/dev/null
cmake --build build/package
cd build/package
cpack -G DEB >/dev/null
ls "$PWD"/heba_*.deb
