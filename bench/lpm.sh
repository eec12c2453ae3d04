#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# What the papers claim of transients, feedback and variances: published figure, ours, required, with as many runs as the
# requirement names (the tests golden/frf_lpm, frf_feedback and frf_variance do the same with fewer).
# usage: ./run bench lpm
set -euo pipefail
: "${SERVOSCOPE_BUILD:?run this as ./run bench lpm}"
programs=(frf_lpm frf_feedback frf_variance)
cmake --build "$SERVOSCOPE_BUILD" --target "${programs[@]/#/test_golden_}" -- --quiet >&2
status=0
for program in "${programs[@]}"; do
    SERVOSCOPE_LONG=1 "$SERVOSCOPE_BUILD/tests/golden/test_$program" || status=1
done
exit "$status"
