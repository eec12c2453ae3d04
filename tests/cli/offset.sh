#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Stroke, bias velocity and predicted deviation from the command line, to the response: what is refused before anything
# moves, what the tables say, where the axis goes, and what the measurement finds of the prediction.
subcommand=offset
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

cat >model.json <<'JSON'
{"structure": "rigid", "motor_inertia_kgm2": 0.00516, "coulomb_friction_Nm": 0.15, "sample_rate_hz": 1000, "seed": 3,
 "process_noise_Nm": 0.01}
JSON
design=("$SERVOSCOPE" design --rate 1000 --period 1000 --lines odd:1:99:1 --limit-velocity 6 --limit-torque 0.6
    --inertia 0.00516 --method schroeder)
refused() { # refused STATUS WORDS COMMAND...: the status, and the words on stderr; nothing is written
    local expected=$1 words=$2 status=0
    shift 2
    "$@" >said 2>err || status=$?
    [ "$status" -eq "$expected" ] || fail "status $status of: $* ($(cat err))"
    grep -qF -- "$words" err || fail "'$words' is not in: $(cat err)"
    [ -z "$(find . -name 'no.*')" ] || fail "something was written by: $*"
}

# What would leave a limit, before anything is designed.
refused 1 'expected a bias velocity below 6 rad/s' "${design[@]}" --bias-velocity 7 --out no
refused 1 'expected a bias velocity below' "${design[@]}" --bias-velocity 4 --limit-position 10 --periods 10 --out no
refused 1 'expected a stroke below 1 rad' "${design[@]}" --stroke 1:4 --limit-position 1 --out no
refused 2 'expected none in torque mode' "${design[@]}" --bias-velocity 4 --mode torque --out no
refused 2 'a whole number of at least 2' "${design[@]}" --stroke 1:1 --out no

# A bias velocity: the speed is in the table, the travel in its key, and the run goes on by it in each period.
"${design[@]}" --bias-velocity 4 --predict model.json --periods 8 --out bias --json >bias.json
grep -qx '# travel_per_period_rad: 4' bias.csv || fail "no travel in bias.csv"
"$SERVOSCOPE" simulate --model model.json --table bias.mst --periods 8 --out bias-run.csv --quiet
"$SERVOSCOPE" frf bias-run.csv --out bias-frf.csv --quiet
"$SERVOSCOPE" measure --drive sim:model.json --table bias.mst --periods 8 --out bus-run.csv --quiet
refused 1 'torque mode cannot hold' \
    "$SERVOSCOPE" simulate --model model.json --table bias.mst --mode torque --periods 2 --out no.csv
refused 1 'which has room for 4 periods, settling ones included' "$SERVOSCOPE" simulate --model model.json \
    --table bias.mst --periods 8 --limit-position 20 --out no.csv

# The same without it, and with a stroke.
"${design[@]}" --out still --quiet
"$SERVOSCOPE" simulate --model model.json --table still.mst --periods 8 --out still-run.csv --quiet
"$SERVOSCOPE" frf still-run.csv --out still-frf.csv --quiet
"${design[@]}" --stroke 0.5:4 --limit-position 1 --out stroke --json >stroke.json
"$SERVOSCOPE" simulate --model model.json --table stroke.mst --periods 2 --limit-position 1.1 \
    --out stroke-run.csv --quiet

python3 - <<'PYTHON' || fail "the figures above"
import cmath, csv, json, math, statistics

def read(name):
    rows = list(csv.DictReader(line for line in open(name) if not line.startswith("#")))
    return {key: [float(row[key]) for row in rows if row[key] != ""] for key in rows[0]}

def error(frf):
    """Median over the lines of |G / truth - 1|, truth: torque held between samples on the inertia."""
    out = []
    for f, re, im in zip(frf["frequency_hz"], frf["real"], frf["imag"]):
        truth = 1e-3 / 0.00516 / (cmath.exp(2j * math.pi * f * 1e-3) - 1)
        out.append(abs(complex(re, im) / truth - 1))
    return statistics.median(out)

period = 1000
for name in "bias-run.csv", "bus-run.csv":
    run = read(name)
    velocity, position = run["velocity_rad_per_s"][period:], run["position_rad"][period:]
    assert len(velocity) == 8 * period
    assert abs(statistics.fmean(velocity) - 4) < 2e-3, statistics.fmean(velocity)
    assert min(velocity) > 0, min(velocity)
    assert all(abs(b - a - 4) < 5e-3 for a, b in zip(position, position[period:]))
    references = run["position_ref_rad"]
    assert all(abs(b - a - 4) < 1e-5 for a, b in zip(references, references[period:]))

biased, still = read("bias-frf.csv"), read("still-frf.csv")
print(f"response off by {error(still):.2g} (median) at rest on average, {error(biased):.2g} at 4 rad/s")
assert error(biased) < 0.2 * error(still)

predicted = json.load(open("bias.json"))["predicted_std"]
ratios = [p / m for p, m in zip(predicted, biased["std"], strict=True)]
print(f"predicted over found deviation {statistics.median(ratios):.3f} (median of {len(ratios)} lines)")
# One run of 8 periods: a line's deviation is known to 20 %, the median of 50 lines to 4 %.
assert 0.85 < statistics.median(ratios) < 1.18, statistics.median(ratios)

stroke = json.load(open("stroke.json"))
assert stroke["peak"]["position_rad"] > 0.5 and stroke["peak_continuous"]["position_rad"] <= 1, stroke["peak"]
table, run = read("stroke.csv"), read("stroke-run.csv")
assert len(table["n"]) == 4 * period and len(run["time_s"]) == 3 * 4 * period
c = sum(q * cmath.exp(-2j * math.pi * n / 4000) for n, q in enumerate(table["position_rad"])) / 2000
assert abs(abs(c) - 0.5) < 1e-9, abs(c)
assert max(map(abs, run["position_rad"])) < 1
PYTHON

[ "$failures" -eq 0 ]
