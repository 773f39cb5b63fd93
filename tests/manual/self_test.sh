#!/bin/sh
# Checks run_pages.py itself: it accepts a page that is right and refuses every page that is wrong.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
program=$1
source=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
try() { "${PYTHON:-python3}" "$here/run_pages.py" "$program" "$source" "$work/page.md" > "$work/log" 2>&1; }
must_pass() { try || { echo "refused: $1"; cat "$work/log"; exit 1; }; }
must_fail() { if try; then echo "accepted: $1"; cat "$work/log"; exit 1; fi; }
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
page 'No command.\n'
must_fail 'a page without a command'
echo "all pages judged as they must be"
