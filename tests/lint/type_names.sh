#!/usr/bin/env bash
# Two types of one name in one namespace are undefined behaviour, which no compiler and no linker reports: the program's
# structs and classes have a name each, but for those that no other file sees (in a namespace without a name).
set -uo pipefail
cd "$(dirname "$0")/../.."
doubles=$(find src solvers targets tools -name '*.h' -o -name '*.cc' | sort | xargs awk '
  FNR == 1 { depth = 0; hidden = -1 }
  {
    line = $0
    sub(/\/\/.*/, "", line)
    if (hidden < 0 && line ~ /^namespace *\{/) hidden = depth
    if (hidden < 0 && match(line, /^(struct|class) +[A-Za-z0-9_]+[^;:(]*(:[^;]*)?\{/)) {
      split(line, words, " ")
      name = words[2]
      if (name in file && file[name] != FILENAME) print name ": " file[name] " and " FILENAME
      file[name] = FILENAME
    }
    depth += gsub(/\{/, "{", line) - gsub(/\}/, "}", line)
    if (hidden >= 0 && depth <= hidden) hidden = -1
  }')
# A class that a header only names is defined in its source file, as `class Outer::Inner`.
if [ -n "$doubles" ]; then
  echo "$doubles"
  echo "^ two types of one name"
  exit 1
fi
# Several cameras are what types and functions are written for: a pair is named, a rig is not.
if find src solvers targets tools -name '*rig*' | grep -vE 'rigid|right' ||
    grep -rnoP --include='*.h' --include='*.cc' '(?<!")\b[A-Za-z]*Rig[A-Z(]?[A-Za-z]*\b' src solvers targets tools | grep -vE 'Rigid|Right|Rigs'; then
  echo "^ no file, type or function is called rig"
  exit 1
fi
exit 0
