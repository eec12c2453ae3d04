#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope frf: saved responses beside a new one and beside each other, and what of that is refused.
subcommand=frf
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

drive() { # drive INERTIA: a rigid drive of that inertia
    printf '{"structure": "rigid", "motor_inertia_kgm2": %s, "viscous_friction_Nms_per_rad": 0.01, "sample_rate_hz": 1000,
        "process_noise_Nm": 0.01}' "$1"
}
drive 0.005 >light.json
drive 0.01 >heavy.json
drive 0.005 | sed 's/}/, "seed": 9}/' >again.json
"$SERVOSCOPE" design --rate 1000 --period 1000 --lines linear:2:100:2 --limit-torque 1 --inertia 0.005 --method schroeder --out table --quiet
for name in light heavy again; do
    "$SERVOSCOPE" simulate --model $name.json --table table.mst --periods 8 --out $name.csv --quiet
    "$SERVOSCOPE" frf $name.csv --out $name-frf.csv --quiet
done

# Twice the inertia is 6 dB less, at every line beyond noise; the same drive again is not.
"$SERVOSCOPE" frf light-frf.csv heavy-frf.csv again-frf.csv --report page.html --json >said.json
python3 - said.json <<'PYTHON' || fail "$(cat said.json)"
import json, sys
said = json.load(open(sys.argv[1]))
heavy, again = said["differences"]
assert said["file"] == "light-frf.csv" and heavy["file"] == "heavy-frf.csv" and again["file"] == "again-frf.csv"
for one in (heavy, again):
    assert one["lines_in_common"] == one["lines_compared"] == 50, one
    assert 0.01 < one["chance"] < 0.06, one  # F(2, 28) above 4
assert abs(heavy["median_db"] + 6.02) < 0.2 and heavy["lines_beyond"] == 50, heavy
assert abs(again["median_db"]) < 0.1 and again["lines_beyond"] <= 8, again  # 1.5 expected: more than 8 in 1 of 10 000
PYTHON
grep -q 'difference over 2 std, from light-frf.csv' page.html || fail 'the page has no panel of differences'
grep -q '>heavy-frf.csv<' page.html || fail 'the page does not name what is compared'

# The same beside a response that is estimated now: file, screen and page.
"$SERVOSCOPE" frf light.csv --out new.csv --compare heavy-frf.csv again-frf.csv --report new.html >said
grep -q '^heavy-frf.csv lies 6 dB lower than new.csv (median of 50 lines in common)' said || fail "$(cat said)"
cmp -s new.csv light-frf.csv || fail '--compare changes the response'
grep -q '>again-frf.csv<' new.html || fail 'the page does not show the second saved response'

# Files of one name in two folders are told apart.
mkdir old
cp heavy-frf.csv old/light-frf.csv
"$SERVOSCOPE" frf light-frf.csv old/light-frf.csv >said
grep -q '^old/light-frf.csv lies 6 dB lower than light-frf.csv' said || fail "$(cat said)"

sed 's|^# units: .*|# units: rad/Nm|' heavy-frf.csv >position.csv
refuse 1 'position.csv: a response in rad/Nm, expected rad_per_s/Nm as in light-frf.csv' light-frf.csv position.csv
refuse 1 'position.csv: a response in rad/Nm' light.csv --out x.csv --compare position.csv
refuse 2 'light-frf.csv: a response already, expected another one' light-frf.csv
refuse 2 'light-frf.csv is a response already' light-frf.csv heavy-frf.csv --out x.csv
refuse 1 'there is no column frequency_hz' light-frf.csv heavy.csv
refuse 1 'there is no column frequency_hz' light.csv --out x.csv --compare heavy.csv
refuse 2 '--out is missing' light.csv
refuse 2 'heavy-frf.csv' light.csv --out heavy-frf.csv --compare heavy-frf.csv

[ "$failures" -eq 0 ]
