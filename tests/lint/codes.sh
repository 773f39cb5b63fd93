#!/usr/bin/env bash
# Every code of the doctor and of a finding has a section on one of the pages in docs/manual/codes, or is named in one
# ("Also here: ..."), every section is about a code of the source, and the index links to every section.
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
named=$(sed -n 's/^Also here: \(.*\)\.$/\1/p' "$pages"/*.md | tr -d ' `' | tr ',' '\n' | sort)
sections=$(sed -n 's/^## \([a-z_]*\)$/\1/p' "$pages"/*.md | sort)

for code in $codes; do
  grep -qx "$code" <<< "$sections" || grep -qx "$code" <<< "$named" || fail "$code has no section in $pages"
done
for code in $named; do
  grep -qx "$code" <<< "$codes" || fail "'Also here' names $code, which is no code in the source"
done
for code in $(uniq -d <<< "$sections"); do fail "$code has two sections in $pages"; done
for page in "$pages"/*.md; do
  for code in $(sed -n 's/^## \([a-z_]*\)$/\1/p' "$page"); do
    grep -qx "$code" <<< "$codes" || fail "$page has a section $code, which is no code in the source"
    grep -q "](codes/$(basename "$page")#$code)" "$index" || grep -qx "$code" <<< "$named" ||
      fail "$index does not link to the section $code of $page"
  done
done
# Links to other pages, and to their sections.
for page in "$index" "$pages"/*.md; do
  folder=$(dirname "$page")
  for link in $(grep -oh '](\(codes/\)\?[a-z_]*\.md\(#[a-z_]*\)\?)' "$page" | tr -d ']()' | sort -u); do
    file=$folder/${link%%#*}
    [ -f "$file" ] || { fail "$page links to $link, which does not exist"; continue; }
    [ "$link" = "${link#*#}" ] || ! [[ "$file" == *codes/* ]] || grep -qx "## ${link#*#}" "$file" ||
      fail "$page links to $link, and the page has no such section"
  done
done
exit $status
