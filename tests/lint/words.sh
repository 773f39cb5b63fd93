#!/usr/bin/env bash
# No TODO is left, no absolute path of somebody's machine, one thing has one name, and libraries word no failures.
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

# Failures of algorithms are codes (heba/base/failure_code.h), which tools/text words: a library's caller has no config.
# The core and the targets may set a text: theirs is about files and images.
if grep -rnE --include='*.h' --include='*.cc' 'Failure( [a-z_]+)?[({] *(std::|[a-z"])' solvers tools/run; then
  echo "^ a failure of a library has a code: Failure{FailureCode(...), figures, names}"
  status=1
fi
keys=$(sed -nE 's/^HEBA_KEY\(config, "([a-z_]+\.[a-z_]+)[^"]*".*/\1/p' tools/config/keys.def | sort -u | paste -sd'|' | sed 's/[.]/[.]/g')
if [ -z "$keys" ] || find solvers tools/run -name '*.cc' -o -name '*.h' | xargs grep -noE '"([^"\\]|\\.)*"' |
    grep -E ":\"(.*[^a-z_.])?($keys)([^a-z_].*)?\"\$"; then
  echo "^ libraries name no key of a config"
  status=1
fi
exit $status
