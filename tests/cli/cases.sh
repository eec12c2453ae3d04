#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# scripts/cases: a page of a real recording holds what it promises and no path of this machine; what is missing is said.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cases=$SERVOSCOPE_SOURCE/scripts/cases
failures=0

fail() {
    echo "FAILED: $*" >&2
    failures=$((failures + 1))
}

SERVOSCOPE_DATA='' "$cases" --out "$folder" 2>"$folder/err" && fail "no data is accepted"
grep -q 'expected the folder with the recordings' "$folder/err" || fail "no data: $(cat "$folder/err")"
"$cases" --out "$folder" "$folder" nothing 2>"$folder/err" && fail "an unknown page is accepted"
grep -q '^cases: nothing: expected one of emps' "$folder/err" || fail "an unknown page: $(cat "$folder/err")"
"$cases" --program "$SERVOSCOPE" --out "$folder" "$folder" cogging 2>"$folder/err" && fail "missing recordings are accepted"
grep -q 'cogging_measure_final_a_4.csv: no such file' "$folder/err" || fail "missing recordings: $(cat "$folder/err")"
[ "$failures" -eq 0 ] || exit 1

[ -d "${SERVOSCOPE_DATA:-}/cogging" ] || {
    echo "skipped: no data (SERVOSCOPE_DATA)"
    exit 77
}
"$cases" --program "$SERVOSCOPE" --out "$folder" "$SERVOSCOPE_DATA" cogging 2>/dev/null || fail "status $?"
page=$folder/cogging.md
for heading in 'What was given' 'What it gets wrong' 'Causes' 'Before and after' 'What stays unexplained' \
    'What could not be tested' 'What to measure next' 'The recording and its description' 'Commands'; do
    grep -q "^##* $heading$" "$page" || fail "no '$heading'"
done
grep -qF "$SERVOSCOPE_DATA" "$page" && fail "the page has a path of this machine"
# Every figure is there and is XML.
while read -r name; do
    python3 -c 'import sys, xml.etree.ElementTree as tree; tree.parse(sys.argv[1])' "$folder/$name" || fail "figure $name"
done < <(sed -n 's/^!\[.*](\(.*\.svg\))$/\1/p' "$page")
[ "$(grep -c '^!\[' "$page")" -ge 8 ] || fail "figures: $(grep '^!\[' "$page")"
[ "$(cat "$folder"/cogging* | wc -c)" -lt 250000 ] || fail "the page is $(cat "$folder"/cogging* | wc -c) bytes"

[ "$failures" -eq 0 ]
