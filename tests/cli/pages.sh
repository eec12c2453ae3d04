#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Every kind of page in a real browser: no message on its console, no text over another or cut off, nothing from elsewhere, not too big.
set -euo pipefail
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

# The look itself can fail: two texts at one place are found.
# shellcheck disable=SC2016
sed 's|<text |<text x="9" y="9">one</text><text x="9" y="9">other</text>&|' frf.html >broken.html
! "$SERVOSCOPE_SOURCE/scripts/check-page" broken.html >said || {
    echo "FAILED: overlapping texts are not found"
    exit 1
}
grep -q "'one' over 'other'" said
rm broken.html
pages=(./*.html demo/*.html)
[ "${#pages[@]}" -ge 10 ]
"$SERVOSCOPE_SOURCE/scripts/check-page" --pictures "${SERVOSCOPE_PICTURES:-$folder/pictures}" "${pages[@]}"
