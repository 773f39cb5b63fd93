#!/usr/bin/env bash
# Formats every C++ file, or with --check says which ones are not formatted. clang-format 14 and no other: versions differ.
set -euo pipefail
cd "$(dirname "$0")/.."

mode=(-i)
if [ "${1:-}" = --check ]; then mode=(--dry-run -Werror); fi
find src solvers targets tools tests python -name '*.cc' -o -name '*.h' | sort | xargs clang-format-14 "${mode[@]}"
