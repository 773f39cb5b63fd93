#!/bin/sh
# Checks run_pages.py itself: it accepts a page that is right and refuses every page that is wrong.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
program=$1
source=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
flags=
# shellcheck disable=SC2086  # The flags are words.
try() { "${PYTHON:-python3}" "$here/run_pages.py" "$program" "$source" $flags "$work/page.md" "$work/last.md" > "$work/log" 2>&1; }
must_pass() { try || { echo "refused: $1"; cat "$work/log"; exit 1; }; }
must_fail() { if try; then echo "accepted: $1"; cat "$work/log"; exit 1; fi; }
printf '```sh\ntrue\n```\n' > "$work/last.md"
page() { printf '%b' "$1" > "$work/page.md"; }

page '```sh\necho 1.000 mm, 7 captures\necho a; echo b\n```\n\n```text\n1.001 mm, 7 captures\n...\nb\n```\n'
must_pass 'a number within its tolerance, and lines that are left out'
page '<!-- file: a.txt -->\n```yaml\nkey: 1\n```\n<!-- status: 3 -->\n```sh\ncat a.txt; exit 3\n```\n```text\nkey: 1\n```\n'
must_pass 'a file and a status'
page '```python\nx = 2\n```\nThen\n```python\nprint(x)\n```\n```text\n2\n```\n'
must_pass 'code that shares its names'
page '```sh\necho 1.000 mm\n```\n```text\n1.100 mm\n```\n'
must_fail 'a number that differs'
page '```sh\necho 7 captures\n```\n```text\n8 captures\n```\n'
must_fail 'a count that differs'
page '```sh\necho good\n```\n```text\nbad\n```\n'
must_fail 'a word that differs'
page '```sh\necho a; echo b\n```\n```text\na\n```\n'
must_fail 'a line that the page lacks'
page '```sh\necho a\n```\n```text\na\nb\n```\n'
must_fail 'a line that the output lacks'
page '```sh\nfalse\n```\n'
must_fail 'a command that fails'
page '```python\nraise ValueError\n```\n'
must_fail 'code that raises'
page '```python\nimport sys\nsys.exit(0)\n```\n'
must_fail 'code that ends the program'
grep -q '^last.md: 1 commands' "$work/log" || { echo "the pages after code that ends the program are left out"; exit 1; }
page '```sh\necho a\n```\nThe output:\n```text\na\n```\n'
must_fail 'a text that is compared with nothing'
page '```sh\necho a\n```\nA table:\n<!-- not compared: it is an example of a file -->\n```text\nb\n```\n'
must_pass 'a text that is not compared'
try_number() { page "\`\`\`sh\necho $2\n\`\`\`\n\`\`\`text\n$1\n\`\`\`\n"; }
for numbers in '0.3 0.1' '0.1 -0.1' '1e5 -1e5' '1e5 2e5' '2.0e-5 3.0e-5' '0.02 0.04'; do
  try_number $numbers
  must_fail "a number that differs: $numbers"
done
for numbers in '0.3 0.2' '0.0 -0.1' '1.5 1.7' '2.0e-5 2.1e-5' '1e5 1.1e5' '123.45 126.00'; do
  try_number $numbers
  must_pass "a number within its tolerance: $numbers"
done
page 'No command.\n'
must_fail 'a page without a command beside one with a command'
flags=--without-commands=page.md
must_pass 'a page that needs no command'
page '```sh\ntrue\n```\n'
must_fail 'a page with a command that is said to have none'
echo "all pages judged as they must be"
