#!/usr/bin/env bash
# From a fresh Debian 12 machine to a calibration: installs what is missing, builds heba, renders the sample data set and
# calibrates from its images. Needs root or sudo for the packages.
set -euo pipefail
cd "$(dirname "$0")/.."

tools/install_packages.sh
# A new folder is built once: several sources are compiled as one.
once=()
[ -e build/release/CMakeCache.txt ] || once=(-DHEBA_UNITE=ON)
cmake --preset release "${once[@]}" -DHEBA_BUILD_TESTS=OFF >/dev/null
cmake --build --preset release --target heba
heba=build/release/heba

"$heba" simulate configs/sample_scene.yaml --out sample/data
"$heba" run sample/data/config.yaml --out sample/run
"$heba" detect sample/data/config.yaml --out sample/detections --quiet

echo
echo "The images are in sample/data/images, the result is sample/run/result.json,"
echo "the detections are drawn into the images in sample/detections/overlays."
