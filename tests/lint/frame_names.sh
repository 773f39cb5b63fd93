#!/usr/bin/env bash
# Transforms are called a_from_b, never a_to_b, a2b or T_ab.
set -uo pipefail
cd "$(dirname "$0")/../.."
frames='(base|gripper|camera|target|mount|camera_mount|target_mount|tool|board|world|cam)'
if grep -rnE --include='*.h' --include='*.cc' \
    "\b${frames}_to_${frames}|\b${frames}2${frames}\b|\b[TRX]_[a-z]+_[a-z]+\b" src solvers targets tools tests |
    grep -vE 'CreateTarget_|CameraModel_|// foreign name'; then
  echo "^ transforms are called <to>_from_<from>"
  exit 1
fi
exit 0
