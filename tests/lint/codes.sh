#!/usr/bin/env bash
# Every code of the doctor and of a finding has a page in docs/manual/codes, or is named on one ("Also on this page: ..."),
# every page has its code in the source, and the index links to every page.
set -uo pipefail
cd "$(dirname "$0")/../.."
pages=docs/manual/codes
index=docs/manual/when_it_does_not_fit.md
status=0
fail() {
  echo "$1"
  status=1
}

# codes_in FILE TABLE: the strings of a table.
codes_in() { sed -n "/$2\[\] = {/,/};/p" "$1" | grep -o '"[a-z_]*"' | tr -d '"'; }

symptoms=$(codes_in tools/doctor/symptom.h kSymptomCodes)
findings=$(codes_in src/heba/evaluation/finding.h kFindingCodes)
[ -n "$symptoms" ] && [ -n "$findings" ] || fail "a table of codes was not found"
codes=$(printf '%s\n' "$symptoms" "$findings" | sort -u)
named=$(sed -n 's/^Also on this page: \(.*\)\.$/\1/p' "$pages"/*.md | tr -d ' ' | tr ',' '\n' | sort)

for code in $codes; do
  [ -f "$pages/$code.md" ] || grep -qx "$code" <<< "$named" || fail "$code has no page in $pages"
done
for code in $named; do
  grep -qx "$code" <<< "$codes" || fail "'Also on this page' names $code, which is no code in the source"
done
for page in "$pages"/*.md; do
  code=$(basename "$page" .md)
  grep -qx "$code" <<< "$codes" || fail "$page is about no code in the source"
  [ "$(head -1 "$page")" = "# $code" ] || fail "$page has another title than # $code"
  grep -q "](codes/$code.md)" "$index" || fail "$index does not link to $page"
done
for link in $(grep -oh '](\(codes/\)\?[a-z_]*\.md)' "$index" "$pages"/*.md | tr -d ']()' | sed 's#^codes/##' | sort -u); do
  [ -f "$pages/$link" ] || [ -f "docs/manual/$link" ] || fail "a page links to $link, which does not exist"
done
exit $status
