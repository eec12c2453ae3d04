#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope simulate from the command line: the run it writes, Ctrl-C, what it refuses and what is left on the disk then.
subcommand=simulate
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

"$SERVOSCOPE" design --rate 1000 --period 500 --lines linear:2:100:2 --limit-torque 1 --inertia 0.005 --method newman \
    --out table --quiet
echo '{"structure": "rigid", "motor_inertia_kgm2": 0.005, "sample_rate_hz": 1000, "seed": 3}' >model.json
all=(--model model.json --table table.mst --periods 3)

# The rows and keys of a run; the same seed gives the same bytes, another seed does not.
"$SERVOSCOPE" simulate "${all[@]}" --out a.csv >said
grep -q '^a.csv: 1 settling and 3 counted periods of 500 samples at 1000 Hz, 2000 of 2000 rows, 0 lost' said || fail "$(cat said)"
[ "$(grep -vc '^#' a.csv)" -eq 2001 ] || fail "rows of a.csv: $(grep -vc '^#' a.csv)"
for key in 'sample_rate_hz: 1000' 'period_samples: 500' 'periods: 3' 'settle_periods: 1' 'mode: cascade'; do
    grep -qx "# $key" a.csv || fail "no key '$key'"
done
"$SERVOSCOPE" simulate "${all[@]}" --out b.csv --quiet >said
[ ! -s said ] || fail "--quiet says something"
cmp a.csv b.csv || fail "the same seed gives another run"
"$SERVOSCOPE" simulate "${all[@]}" --seed 4 --out b.csv --quiet
if cmp -s a.csv b.csv; then fail "another seed gives the same run"; fi
"$SERVOSCOPE" simulate "${all[@]}" --settle 0 --out c.csv --json >said
python3 -c '
import json
said = json.load(open("said"))
assert said["rows"] == 1500 and said["periods"] == 3 and said["settle_periods"] == 0, said
assert said["ended"] == "complete" and said["samples_lost"] == 0, said
' || fail "--json: $(cat said)"

# Without a fade in the first row is the table's start, with the axis at rest there.
"$SERVOSCOPE" simulate "${all[@]}" --settle 0 --fade 0 --out start.csv --quiet
python3 -c '
import csv
def read(name):
    lines = open(name).read().splitlines()
    keys = dict(line[2:].split(": ", 1) for line in lines if line.startswith("# "))
    return keys, list(csv.DictReader(line for line in lines if not line.startswith("#")))
keys, table = read("table.csv")
start, row = table[int(keys["start_index"])], read("start.csv")[1][0]
asked, stands = float(row["position_ref_rad"]), float(row["position_rad"])
assert abs(asked - float(start["position_rad"])) < 1e-8, (asked, start)
assert abs(asked) > 1e-3 and abs(stands - asked) < 1e-4, (asked, stands)
' || fail "the first row without a fade in: $(grep -v '#' start.csv | head -2)"

# A limit: status 1, but what was measured is kept and says why it ends.
status=0
"$SERVOSCOPE" simulate "${all[@]}" --limit-velocity 0.5 --out limited.csv >said 2>err || status=$?
[ "$status" -eq 1 ] || fail "status $status at a limit"
grep -q '^servoscope simulate: stopped early: speed limit: velocity ' err || fail "$(cat err)"
if [ -e limited.csv ]; then
    grep -q '^# stopped_by: speed limit' limited.csv || fail "no stopped_by in the file"
fi

# Ctrl-C: a long run is cut short, kept, marked, readable. Cut while it still fades in, there is nothing to keep: then later.
for delay in 0.1 0.4 1.6 6.4; do
    "$SERVOSCOPE" simulate --model model.json --table table.mst --periods 5000 --settle 0 --out cut.csv >said 2>err &
    job=$!
    until grep -q '^SigCgt:.*[2367abef]$' "/proc/$job/status"; do sleep 0.02; done # it catches SIGINT: it measures
    sleep "$delay"
    kill -INT "$job"
    status=0
    wait "$job" || status=$?
    [ "$status" -eq 1 ] || fail "status $status after Ctrl-C: $(cat err)"
    grep -q 'interrupted by the user' err || fail "$(cat err)"
    [ ! -e cut.csv ] || break
done
grep -qx '# interrupted: true' cut.csv || fail "an interrupted run is not marked"
[ "$(grep -vc '^#' cut.csv)" -lt 2500000 ] || fail "an interrupted run is complete"
"$SERVOSCOPE" frf cut.csv --settle 0 --out cut-frf.csv --quiet || fail "an interrupted run cannot be read"

# Refusals
refuse 2 '--model is missing' --table table.mst --periods 3 --out x.csv
refuse 2 'expected 0 to 16777216' --model model.json --table table.mst --periods 3 --fade -1 --out x.csv
refuse 2 '--periods' --model model.json --table table.mst --periods 0 --out x.csv
refuse 2 "--mode: 'velocity', expected cascade or torque" "${all[@]}" --mode velocity --out x.csv
refuse 1 'none.mst' --model model.json --table none.mst --periods 3 --out x.csv
refuse 1 'none.json' --model none.json --table table.mst --periods 3 --out x.csv
refuse 1 'nowhere/x.csv: cannot be written' "${all[@]}" --out nowhere/x.csv
refuse 1 'expected at most the limit of 0.5 Nm' "${all[@]}" --limit-torque 0.5 --out x.csv
head -c 300 table.mst >short.mst
refuse 1 'short.mst' --model model.json --table short.mst --periods 3 --out x.csv
sed 's/1000/2000/' model.json >fast.json
refuse 1 "the model's sample_rate_hz is 2000, the table's rate 1000 Hz" --model fast.json --table table.mst --periods 3 --out x.csv
echo '{"structure": "rigid", "mass_kg": 5, "sample_rate_hz": 1000}' >linear.json
refuse 1 'expected one kind' --model linear.json --table table.mst --periods 3 --out x.csv
for input in model.json ./table.mst; do
    sum=$(cksum <"$input")
    refuse 2 "$input: would be overwritten" "${all[@]}" --out "$input"
    [ "$(cksum <"$input")" = "$sum" ] || fail "$input was overwritten"
done

[ "$failures" -eq 0 ]
