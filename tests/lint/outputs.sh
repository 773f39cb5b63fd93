#!/usr/bin/env bash
# A function returns what it changes: a pointer parameter may be null, is a handle of a C library or of the program, or is a
# buffer that an inner loop fills. The rooms whose functions fill no buffers have no other pointers to what is not const.
set -euo pipefail
cd "$(dirname "$0")/../.."
find python/bindings solvers/calibration solvers/cell solvers/initial solvers/study src/heba/config src/heba/evaluation src/heba/io \
  src/heba/simulation targets/render targets/tags targets/types tools -name '*.cc' -o -name '*.h' | grep -v '^tools/bench/' | sort |
  xargs python3 -c '
import re, sys

# Handles and observers, which may be null; derivatives of an effect, which a caller may not want; arguments of main;
# arrays of pixels and numbers.
ALLOWED = re.compile(r"^(cairo_t|cairo_surface_t|char\*?|void|TIFF|Console|RunObserver|Matrix6X|double)$")
FUNCTION = re.compile(r"\b(\w+)\(([^(){};]*(?:\([^()]*\)[^(){};]*)*)\)\s*(?:const\s*)?(?:noexcept\s*)?(?:override\s*)?\{")
OUTPUT = re.compile(r"^(?:\w+::)*\w+(?:<.*>)?\s*\*\s*(?:const\s+)?\w+$")
status = 0
for path in sys.argv[1:]:
  text = re.sub(r"//[^\n]*", lambda comment: " " * len(comment[0]), open(path).read())
  text = re.sub(r"\"(\\.|[^\"\\\n])*\"", "\"\"", text)
  for function in FUNCTION.finditer(text):
    if function[1] in ("if", "for", "while", "switch", "catch"):
      continue
    depth, parameters = 0, [""]
    for c in function[2]:
      depth += c in "<(" and 1 or c in ">)" and -1 or 0
      parameters = parameters + [""] if c == "," and depth == 0 else parameters[:-1] + [parameters[-1] + c]
    for parameter in (" ".join(one.split()) for one in parameters):
      kind = re.sub(r"\s*\*\s*(const\s+)?\w+$", "", parameter)
      if OUTPUT.match(parameter) and "const" not in kind.split() and not ALLOWED.match(kind):
        line = text.count("\n", 0, function.start()) + 1
        print(f"{path}:{line}: {function[1]}({parameter}) changes what it was given; return it")
        status = 1
sys.exit(status)
'
