#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Files that convert writes, read by scipy, h5py and pyuff, and theirs read by convert (tests/foreign/formats.py, in a virtual
# environment beside the build).
subcommand=convert
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"
source "$SERVOSCOPE_SOURCE/tests/support/foreign.sh"
python_with formats h5py,numpy,pyuff,scipy h5py==3.16.0 numpy==2.4.6 pyuff==2.5.8 scipy==1.17.1

echo '{"structure": "rigid", "motor_inertia_kgm2": 0.005, "sample_rate_hz": 1000, "seed": 3}' >model.json
"$SERVOSCOPE" design --rate 1000 --period 500 --lines quasilog:6:100:1.3 --limit-torque 1 --inertia 0.005 --method newman --out table \
    --quiet
"$SERVOSCOPE" simulate --model model.json --table table.mst --periods 3 --out run.csv --quiet
"$SERVOSCOPE" frf run.csv --out frf.csv --quiet
if ! "$SERVOSCOPE" convert run.csv try.mat --quiet 2>err; then
    grep -q 'built without matio' err || fail "$(cat err)"
    echo "skipped: MATLAB files (built without matio)"
    exit 77
fi
"$venv/bin/python" "$SERVOSCOPE_SOURCE/tests/foreign/formats.py" "$SERVOSCOPE" || fail "see above"
[ "$failures" -eq 0 ]
