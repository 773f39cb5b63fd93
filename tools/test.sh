#!/usr/bin/env bash
# From a fresh Debian 12 machine to passed tests: installs what is missing, builds heba and runs its tests. Needs root or
# sudo for the packages. Arguments go to ctest; without any the tests labelled nightly are left out.
#   HEBA_WARNINGS_AS_ERRORS=ON tools/test.sh    warnings fail the build
#   HEBA_REPORT_SCRIPT=ON tools/test.sh         so do pages without charts (no Node.js, no npm registry)
set -euo pipefail
cd "$(dirname "$0")/.."

tools/install_packages.sh --tests
# A new folder is built once: several sources are compiled as one, and no benchmarks. For work on the code, configure it
# with HEBA_UNITE=OFF.
once=()
[ -e build/release/CMakeCache.txt ] || once=(-DHEBA_UNITE="${HEBA_UNITE:-ON}" -DHEBA_BUILD_BENCHMARKS="${HEBA_BUILD_BENCHMARKS:-OFF}")
cmake --preset release "${once[@]}" -DHEBA_BUILD_TESTS=ON -DHEBA_WARNINGS_AS_ERRORS="${HEBA_WARNINGS_AS_ERRORS:-OFF}" \
  -DHEBA_REPORT_SCRIPT="${HEBA_REPORT_SCRIPT:-AUTO}" >/dev/null
cmake --build --preset release
if [ $# -eq 0 ]; then set -- --label-exclude nightly; fi
ctest --preset release --parallel "$(nproc)" "$@"
