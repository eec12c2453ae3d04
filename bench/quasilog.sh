#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The fourth paper's study (lines spaced by a ratio make every resonance as sure as any other): paper, here, required. Then how
# long a parametric fit takes beside scipy's least_squares on the same data.
# usage: ./run bench quasilog [RUNS [SEED]]   (draws a system, 1000 and seed 1)
#        ./run bench quasilog --speed         (only how long a fit takes; ./run bench estimate has it too)
set -euo pipefail
cd "$(dirname "$0")/.."
cmake --build "$SERVOSCOPE_BUILD" --target quasilog -- --quiet >&2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

status=0
[ "${1:-}" = --speed ] || "$SERVOSCOPE_BUILD/bench/quasilog" "$@" || status=$?

venv=$SERVOSCOPE_BUILD/venv-scipy
if ! "$venv/bin/python" -c 'import numpy, scipy' 2>/dev/null; then
    if ! { python3 -m venv "$venv" && "$venv/bin/pip" --quiet install numpy scipy; } >&2; then
        printf '\nspeed: numpy and scipy could not be installed; the comparison is left out\n'
        exit "$status"
    fi
fi
printf '\n%-34s %12s %12s %8s %14s %14s\n' 'time of one fit, start included' 'here [ms]' 'scipy [ms]' ratio 'cost here' 'cost scipy'
for order in 2 4; do
    "$SERVOSCOPE_BUILD/bench/quasilog" --data "$folder/data" "$order" >"$folder/ours"
    "$venv/bin/python" bench/quasilog_scipy.py "$folder/data" "$folder/ours" "$order"
done
exit "$status"
