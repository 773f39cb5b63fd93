#!/usr/bin/env bash
# Layers include only what lies below them: src <- solvers, targets <- tools; solvers and targets do not know each other.
set -uo pipefail
cd "$(dirname "$0")/../.."
status=0
# forbid FOLDER REGEX WHY
forbid() {
  if grep -rnE --include='*.h' --include='*.cc' --include='*.def' "^#include [<\"]($2)" "$1"; then
    echo "^ $1 must not include that: $3"
    status=1
  fi
}
forbid src 'opencv2|apriltag|cairo|gflags|solvers/|targets/|tools/|tests/' 'the core knows nothing above it'
forbid solvers 'opencv2|apriltag|cairo|gflags|targets/|tools/|tests/' 'solvers know the core only'
forbid targets 'gflags|solvers/|tools/|tests/' 'targets know the core only'
forbid tools 'tests/' 'the application does not know its tests'
# Libraries print nothing and read no flags.
if grep -rnE --include='*.h' --include='*.cc' 'std::(cout|cerr)|[^sn]printf\(|FLAGS_' src solvers targets | grep -v snprintf; then
  echo "^ libraries print nothing and read no flags"
  status=1
fi
exit $status
