#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The second paper's study on two masses with cubic springs, one multisine, octaves one after the other, sine dwell: first what is
# claimed with paper, reference, ours and required (golden/sequential with as many runs as the reference had), then every
# table, and a page with the paper's figures. Takes some two minutes. Exit status 1 if a figure is outside what is required.
# usage: ./run bench sequential [PAGE.html [SEED]]   (default build/bench/sequential.html, seed 1)
set -euo pipefail
: "${SERVOSCOPE_BUILD:?run this as ./run bench sequential}"
cmake --build "$SERVOSCOPE_BUILD" --target test_golden_sequential sequential -- --quiet >&2
status=0
SERVOSCOPE_LONG=1 "$SERVOSCOPE_BUILD/tests/golden/test_sequential" || status=1
echo
"$SERVOSCOPE_BUILD/bench/sequential" "${1:-$SERVOSCOPE_BUILD/sequential.html}" "${@:2}" || status=1
exit "$status"
