#!/usr/bin/env bash
# No TODO is left, and no absolute path of somebody's machine.
set -uo pipefail
cd "$(dirname "$0")/../.."
if grep -rnE --exclude-dir=build --exclude-dir=.git --exclude-dir=data --exclude-dir=results --exclude-dir=runs --exclude=words.sh '\bTODO\b|\bFIXME\b|/(home|root|work)/[a-z]' \
    src solvers targets tools tests configs ./*.md CMakeLists.txt .ci; then
  exit 1
fi
exit 0
