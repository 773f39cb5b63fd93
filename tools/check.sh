#!/usr/bin/env bash
# Builds and runs the tests of one room of tests/, without those labelled nightly: tools/check.sh ROOM [CTEST-FLAG...]
#   tools/check.sh solvers
#   tools/check.sh tools --tests-regex captures
set -euo pipefail
cd "$(dirname "$0")/.."
room=${1-}
if [ ! -d "tests/$room" ] || ! grep -qs heba_add_ "tests/$room/CMakeLists.txt"; then
  echo "tools/check.sh: name one of the rooms $(cd tests && grep -ls 'heba_add_.*test' ./*/CMakeLists.txt | cut -d/ -f2 | paste -sd ' ')" >&2
  exit 2
fi
shift
cmake --preset release -DHEBA_BUILD_TESTS=ON >/dev/null
cmake --build --preset release --target "${room}_tests"
ctest --preset release --label-regex "^$room$" --label-exclude nightly --parallel "$(nproc)" "$@"
