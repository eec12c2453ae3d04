#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Every kind of page in a real browser: what scripts/check-page looks for, and that each of it would be found.
set -euo pipefail
fail() {
    echo "FAILED: $*"
    exit 1
}
export SERVOSCOPE=${SERVOSCOPE_OPTIMISED:-$SERVOSCOPE}
for browser in chromium chromium-browser google-chrome none; do
    ! command -v "$browser" >/dev/null || break
done
[ "$browser" != none ] || {
    echo "skipped: no Chromium"
    exit 77
}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$SERVOSCOPE_SOURCE/scripts/page-commands" "$SERVOSCOPE_SOURCE/docs/guides/commission-an-axis.md" --run >/dev/null 2>&1
"$SERVOSCOPE" frf full.csv judge.csv --out realisations.csv --report realisations.html --quiet
"$SERVOSCOPE" frf full.csv --method parametric --out parametric.csv --report parametric.html --quiet
"$SERVOSCOPE" design --rate 1000 --period 2000 --lines octaves:1:100:1 --limit-torque 1 --inertia 0.005 --out sequence \
    --report sequence.html --quiet
"$SERVOSCOPE" measure --drive sim:axis.json --table sequence.json --periods 1 --out segments.csv --report segments.html --quiet
"$SERVOSCOPE" measure --drive sim:axis.json --table full.mst --periods 9 --mode torque --limit-position 1 --out drifted.csv \
    --report drifted.html --quiet 2>said || grep -q 'travel limit' said
"$SERVOSCOPE" drive --model axis.json --can slcan:127.0.0.1:0 --faults drop:185:9000:3 >said 2>&1 &
drive=$!
until port=$(sed -n 's/^node 5 on slcan, TCP port \([0-9]*\);.*/\1/p' said) && [ -n "$port" ]; do
    kill -0 "$drive"
    sleep 0.05
done
"$SERVOSCOPE" measure --drive "slcan:127.0.0.1:$port?node=5&sync_timeout_ms=1000" --table full.mst --periods 2 --out bus.csv \
    --report bus.html --quiet
kill "$drive"
wait "$drive" || true
"$SERVOSCOPE" demo --seed 3 --out demo --quiet

# What a stranger has: a response by hand, names with characters of HTML, a recording of ten minutes, a saved response to compare with.
printf 'frequency_hz,real,imag\n1,1,0\n2,0.5,-0.1\n5,-0.1,-0.3\n' >bare.csv
"$SERVOSCOPE" frf bare.csv --report bare.html --quiet
odd='a<b>&"c'"'"'d <script>document.title=1<_script>'
cp judge.csv "$odd.csv"
"$SERVOSCOPE" frf "$odd.csv" --out other.csv --compare frf.csv --report odd.html --quiet
"$SERVOSCOPE" frf frf.csv other.csv realisations.csv bare.csv --report saved.html --quiet 2>said && fail 'units are not looked at'
grep -q 'bare.csv: a response in , expected rad_per_s/Nm as in frf.csv' said || fail "$(cat said)"
"$SERVOSCOPE" frf frf.csv other.csv realisations.csv --report saved.html --quiet
"$SERVOSCOPE" design --rate 1000 --period 2000 --lines dwell:1:20:1 --limit-torque 1 --inertia 0.005 --out dwell --report dwell.html --quiet
"$SERVOSCOPE" measure --drive sim:axis.json --table small.mst --periods 300 --out long.csv --report long.html --quiet
"$SERVOSCOPE" frf long.csv --out long-frf.csv --report long-frf.html --quiet

# The look itself can fail: each of these is found, in the words given.
mkdir broken
: >expected
broken() { # broken NAME EXPECTED SED-EXPRESSION
    sed "$3" frf.html >"broken/$1.html"
    ! cmp -s frf.html "broken/$1.html" || fail "nothing was broken for '$2'"
    echo "broken/$1.html: .*$2" >>expected
}
broken overlap "'one' over 'other'" '0,/<text /s|<text |<text x="9" y="9">one</text><text x="9" y="9">other</text>&|'
broken cut 'is cut off' 's|<text class="la" x="[0-9.]*"|<text class="la" x="-40"|'
broken unit "the axis 'phase' has no unit" 's|>phase in degrees<|>phase<|'
broken x_unit "the axis 'frequency' has no unit" 's|>frequency in Hz</text>|>frequency</text>|'
broken dark 'hardly stands out of the paper in dark' 's|--text:#e3e7ec|--text:#30363c|'
broken series "series 'measured'.*hardly stands out of the paper$" 's|--c1:#0067a8|--c1:#e0f0ff|'
broken console 'CONSOLE' "s|^'use strict';|console.error('broken');|"
broken link 'loads or links' 's|</main>|<img alt="" src="http://127.0.0.1:9/x.png"/></main>|'
broken wide 'px wide in a window of 400' 's|</main>|<p style="width:500px">wide</p></main>|'
broken script 'reads otherwise without its script' "s|^'use strict';|document.querySelector('main').append('made by a script');|"
broken cursor 'cursor shows no values' "s|box.style.display='block'|box.style.display='none'|"
broken unlinked 'is not linked' "s|g.getAttribute('data-link')===link|g===f|"
awk '{ print } END { while (n++ < 9000) print "<!-- made heavier than any page of ours may be, far beyond -->" }' frf.html >broken/heavy.html
echo 'broken/heavy.html: .*expected at most 500000' >>expected
! "$SERVOSCOPE_SOURCE/scripts/check-page" broken/*.html >said || fail 'broken pages pass'
while IFS= read -r words; do
    grep -q "$words" said || fail "not found: $words, in: $(cat said)"
done <expected

pages=(./*.html demo/*.html)
[ "${#pages[@]}" -ge 17 ]
"$SERVOSCOPE_SOURCE/scripts/check-page" --pictures "${SERVOSCOPE_PICTURES:-$folder/pictures}" "${pages[@]}"
