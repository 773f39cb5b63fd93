#!/usr/bin/env bash
# No TODO is left, no absolute path of somebody's machine, and one thing has one name.
set -uo pipefail
cd "$(dirname "$0")/../.."
if grep -rnE --exclude-dir=build --exclude-dir=.git --exclude-dir=data --exclude-dir=results --exclude-dir=runs --exclude=words.sh '\bTODO\b|\bFIXME\b|/(home|root|work)/[a-z]' \
    src solvers targets tools tests configs ./*.md CMakeLists.txt .ci; then
  exit 1
fi
# one_word REGEX WORD: code that names something otherwise.
status=0
one_word() {
  if grep -rnE --include='*.h' --include='*.cc' "$1" src solvers targets tools python; then
    echo "^ the word is: $2"
    status=1
  fi
}
one_word 'Chance(Of|Against)|[a-z]Chance\(|(->|[.]|::)chance\b|double chances?\b' 'p-value (PValueOf, p_value)'
one_word 'OwnPose[^S]|own_pose' 'nuisance pose (NuisancePose, nuisance_poses)'
one_word '(Open|Close)Shape' 'free and hold (FreeShapes, HoldShape)'
exit $status
