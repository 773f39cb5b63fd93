#!/bin/sh
# Runs the tests that these source files define: run_files.sh PROGRAM FILE...
set -eu
program=$1
shift
suites=$(sed -nE 's/^(TYPED_)?TEST(_F|_P)?\(([A-Za-z0-9_]+),.*/\3/p' "$@" | sort -u)
[ -n "$suites" ] || { echo "no tests in $*" >&2; exit 1; }
filter=
for suite in $suites; do filter="$filter:$suite.*:$suite/*:*/$suite.*:*/$suite/*"; done
exec "$program" --gtest_filter="${filter#:}"
