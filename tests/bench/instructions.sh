#!/usr/bin/env bash
# Guards the speed of solver and detector by the number of instructions that fixed work takes, which no busy machine changes:
#   instructions.sh COUNT_INSTRUCTIONS EXPECTED.csv             fails if a workload takes 10 % more than expected
#   instructions.sh COUNT_INSTRUCTIONS EXPECTED.csv --write     measures, and writes the file
# With the baseline instruction set, so that machines of all kinds count nearly alike (libm still chooses its own). Exits 77 where there is no valgrind.
set -euo pipefail

program=$1
expected=$2
mode=${3-}
if ! command -v valgrind >/dev/null; then
  echo "skipped: valgrind is not installed"
  exit 77
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# String instructions count once an item, and whether memcpy uses them depends on the processor.
export GLIBC_TUNABLES=glibc.cpu.x86_rep_movsb_threshold=100000000:glibc.cpu.x86_rep_stosb_threshold=100000000
export HEBA_SIMD=baseline
count() {
  valgrind --tool=callgrind --callgrind-out-file="$work/out" "$program" "$1" 2>"$work/log" ||
    { cat "$work/log" >&2; exit 1; }
  awk '/Collected/ {print $4}' "$work/log"
}

if [ "$mode" = --write ]; then
  {
    echo "workload,instructions"
    for name in $("$program"); do
      instructions=$(count "$name")
      echo "$name,$instructions"
    done
  } >"$work/table"
  mv "$work/table" "$expected"
  exit 0
fi

failed=0
while IFS=, read -r name instructions; do
  if [ "$name" = workload ]; then continue; fi
  now=$(count "$name")
  percent=$((100 * now / instructions))
  note=""
  if [ "$percent" -gt 110 ]; then
    note="  more than expected"
    failed=1
  elif [ "$percent" -lt 90 ]; then
    note="  less: record it with --write"
  fi
  printf '%-24s %14s instructions, %3s %% of expected%s\n' "$name" "$now" "$percent" "$note"
done <"$expected"
exit $failed
