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
[ "${#pages[@]}" -ge 7 ]
"$SERVOSCOPE_SOURCE/scripts/check-page" --pictures "${SERVOSCOPE_PICTURES:-$folder/pictures}" "${pages[@]}"
