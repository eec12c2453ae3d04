#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Every option of every subcommand: once right, and wrong in every way; nothing is left behind by a wrong one.
subcommand=design
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

cat >model.json <<'JSON'
{"structure": "rigid", "motor_inertia_kgm2": 0.005, "viscous_friction_Nms_per_rad": 0.01, "sample_rate_hz": 1000, "seed": 3,
 "process_noise_Nm": 0.002}
JSON
"$SERVOSCOPE" design --rate 1000 --period 500 --lines linear:2:100:2 --limit-torque 1 --inertia 0.005 --method newman --out table --quiet
"$SERVOSCOPE" simulate --model model.json --table table.mst --periods 4 --out run.csv --quiet
"$SERVOSCOPE" simulate --model model.json --table table.mst --periods 4 --seed 7 --out run2.csv --quiet
"$SERVOSCOPE" frf run.csv --out frf.csv --quiet
python3 "$SERVOSCOPE_SOURCE/tests/support/option_table.py" "$SERVOSCOPE" || fail "see above"
[ "$failures" -eq 0 ]
