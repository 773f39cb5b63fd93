#!/usr/bin/env bash
# Installs the build tree $1 into a folder of its own, builds the consumer projects against the package and runs them.
set -euo pipefail
build=$1
source=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake --install "$build" --prefix "$work/prefix" >/dev/null
# All headers are named heba/..., and each includes installed headers only.
if find "$work/prefix/include" -type f | grep -v "^$work/prefix/include/heba/"; then
  echo "^ headers outside of include/heba"
  exit 1
fi
for name in closed_form calibration all_components; do
  # The images of one consumer are drawn by itself.
  cmake -G Ninja -S "$source/$name" -B "$work/$name" -DCMAKE_PREFIX_PATH="$work/prefix" -DCMAKE_CXX_FLAGS=-O1 >/dev/null
  cmake --build "$work/$name" >/dev/null
done
"$work/closed_form/consumer"
mkdir "$work/images"
"$work/all_components/consumer" "$work/images"
"$work/calibration/consumer" <"$source/calibration/captures.txt" | tee "$work/calibrated.txt"
# The captures were simulated with the camera at 0.05 -0.02 0.1 m in the gripper and a noise of 0.1 px.
awk 'NR == 1 { if (($1 - 0.05)^2 + ($2 + 0.02)^2 + ($3 - 0.1)^2 > 0.002^2) exit 1 }' "$work/calibrated.txt"
# Two cameras that see the same are calibrated by the same calls.
awk '{ printf "%s", $0; for (i = 8; i <= NF; ++i) printf " %s", $i; print "" }' "$source/calibration/captures.txt" |
  "$work/calibration/consumer" 2 | tee "$work/calibrated.txt"
awk 'NR % 2 == 1 { if (($1 - 0.05)^2 + ($2 + 0.02)^2 + ($3 - 0.1)^2 > 0.002^2) exit 1 } END { if (NR != 4) exit 1 }' "$work/calibrated.txt"
"$work/prefix/bin/heba" --version
