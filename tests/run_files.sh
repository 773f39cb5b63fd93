#!/bin/sh
# Runs the tests that these source files define: run_files.sh everyday|nightly|all PROGRAM FILE... Suites whose names end
# in Nightly are not run every day.
set -eu
when=$1
program=$2
shift 2
suites=$(sed -nE 's/^(TYPED_)?TEST(_F|_P)?\(([A-Za-z0-9_]+),.*/\3/p' "$@" | sort -u)
filter=
for suite in $suites; do
  case $when-$suite in
    everyday-*Nightly) continue ;;
    nightly-*Nightly | everyday-* | all-*) filter="$filter:$suite.*:$suite/*:*/$suite.*:*/$suite/*" ;;
  esac
done
[ -n "$filter" ] || { echo "no tests in $*" >&2; exit 1; }
exec "$program" --gtest_filter="${filter#:}"
