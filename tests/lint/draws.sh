#!/usr/bin/env bash
# Compilers evaluate the arguments of a call in different orders: a call with two random draws would make another scene of
# the same seed with another compiler. Members of a braced list are evaluated from left to right.
set -euo pipefail
cd "$(dirname "$0")/../.."
find src solvers targets tools tests python -name '*.cc' -o -name '*.h' | sort | xargs python3 -c '
import re, sys

# A generator that is handed on by itself is drawn from after the other arguments.
DRAW = re.compile(r"\b\w*rng(\.|->)\w+\(|\b(normal|uniform)\(\*?(random|engine|rng)\)|[(, ][&*]?rng\)")
# These compare two draws of two generators, which is no matter of order.
COMPARISON = re.compile(r"(TEST|TEST_F|EXPECT_\w+|ASSERT_\w+)$")
status = 0
for path in sys.argv[1:]:
  text = re.sub(r"//[^\n]*", lambda comment: " " * len(comment[0]), open(path).read())
  open_groups = []
  for at, c in enumerate(text):
    if c in "([{":
      open_groups.append([c, at])
    elif c in "," and open_groups:
      open_groups[-1].append(at)
    elif c in ")]}" and open_groups:
      kind, *ends = open_groups.pop()
      arguments = [text[a + 1:b] for a, b in zip(ends, ends[1:] + [at])]
      if kind == "(" and sum(bool(DRAW.search(a)) for a in arguments) > 1:
        name = re.search(r"\w*$", text[:ends[0]])[0]
        if not COMPARISON.match(name):
          line = text.count("\n", 0, at) + 1
          print(f"{path}:{line}: {name}({text[ends[0] + 1:at]}) draws twice in one call; use braces or two statements")
          status = 1
sys.exit(status)
'
