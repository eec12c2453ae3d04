#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope diagnose on recordings that something is wrong with: each is refused with what would mend it, or handled and
# reported, and then still names what the simulation hides.
subcommand=diagnose
. "$(dirname "$0")/../support/cli.sh"

# A rigid drive under a constant load that its model lacks, twice.
cat >given.json <<'JSON'
{"structure": "rigid", "motor_inertia_kgm2": 0.002, "load_inertia_kgm2": 0.003, "viscous_friction_Nms_per_rad": 0.02,
 "coulomb_friction_Nm": 0.05, "sample_rate_hz": 1000}
JSON
sed 's/"sample_rate_hz"/"effects": {"load_bias": {"bias_Nm": 0.1}}, "sample_rate_hz"/' given.json >true.json
for run in 1 2; do
    "$SERVOSCOPE" design --rate 1000 --period 500 --lines linear:2:60:2 --limit-torque 1 --inertia 0.005 --method random \
        --seed $run --out table$run --quiet
    "$SERVOSCOPE" simulate --model true.json --table table$run.mst --periods 6 --out good$run.csv --quiet
done

cat >spoil.py <<'PYTHON'
# usage: spoil.py KIND...: writes KIND1.csv and KIND2.csv, the good runs with that wrong with them.
import random, sys

TURN = 6.283185307179586
torque, reference, place, speed, time = "torque_Nm", "torque_ref_Nm", "position_rad", "velocity_rad_per_s", "time_s"


def read(path):
    with open(path) as stream:
        lines = stream.read().splitlines()
    keys = [line for line in lines if line.startswith("#")]
    names, *rows = [line.split(",") for line in lines if not line.startswith("#")]
    return keys, [dict(zip(names, map(float, row))) for row in rows]


def scale(**factors):
    def spoil(keys, rows):
        for row in rows:
            for name, factor in factors.items():
                row[name] *= factor
    return spoil


def clip(name, share):
    def spoil(keys, rows):
        low, high = min(row[name] for row in rows), max(row[name] for row in rows)
        middle, reach = (low + high) / 2, share * (high - low) / 2
        for row in rows:
            row[name] = min(max(row[name], middle - reach), middle + reach)
    return spoil


def shake(samples):
    def spoil(keys, rows):
        for row in rows:
            row[time] += random.uniform(-samples, samples) / 1000
    return spoil


def gap(keys, rows):
    del rows[3000:3020]


def repeat(keys, rows):
    for i in range(250, len(rows), 500):
        rows[i][time] = rows[i - 1][time]


def jump(keys, rows):
    for i in (1500, 2100, 3100):
        rows[i][place] += 5


def wrap(keys, rows):
    for row in rows:
        row[place] %= TURN


def count(keys, rows):
    for row in rows:
        row[place] = round(row[place] * 65536 / TURN)


def period(keys, rows):
    keys[:] = [key.replace("period_samples: 500", "period_samples: 430") for key in keys]


def milliseconds(keys, rows):
    keys[:] = [key for key in keys if "sample_rate_hz" not in key]
    for row in rows:
        row[time] *= 1000


KINDS = {
    "gap": gap, "repeat": repeat, "shaken": shake(0.09), "torn": shake(0.3), "jump": jump, "wrap": wrap, "count": count,
    "period": period, "ms": milliseconds, "clip_torque": clip(torque, 0.6), "clip_speed": clip(speed, 0.6),
    "clip_place": clip(place, 0.6), "speed_sign": scale(**{speed: -1}), "sign": scale(**{speed: -1, place: -1}),
    "degrees": scale(**{place: 360 / TURN}), "rpm": scale(**{speed: 60 / TURN}),
    "mNm": scale(**{torque: 1000, reference: 1000}), "reference": scale(**{reference: 100}),
    "reference_sign": scale(**{reference: -1}), "mrad": scale(**{place: 1e6, speed: 1e6}),
}
for kind in sys.argv[1:]:
    for run in "12":
        keys, rows = read(f"good{run}.csv")
        KINDS[kind](keys, rows)
        with open(f"{kind}{run}.csv", "w") as out:
            out.write("\n".join(keys) + "\n" + ",".join(rows[0]) + "\n")
            out.writelines(",".join(f"{value:.12g}" for value in row.values()) + "\n" for row in rows)
PYTHON

# refused KIND PART   the runs spoilt so are refused with PART
refused() {
    python3 spoil.py "$1"
    refuse 1 "$2" "${1}1.csv" --validate "${1}2.csv" --model given.json
}

# handled KIND PART [OPTIONS]   the runs spoilt so are diagnosed, PART (a pattern) is said, and the load is found
handled() {
    local kind=$1 part=$2
    shift 2
    python3 spoil.py "$kind"
    "$SERVOSCOPE" diagnose "${kind}1.csv" --validate "${kind}2.csv" --model given.json "$@" >out 2>err ||
        fail "$kind: status $?: $(cat err)"
    grep -q -- "$part" out || fail "$kind: no '$part' in $(cat out)"
    grep -q '^Explained: load bias$' out || fail "$kind: $(head -1 out)"
    grep -q 'A constant load of 0\.\(1\|10\|100\|0999\|1001\) ' out || fail "$kind: $(grep 'constant load' out)"
}

# reported KIND PART   the runs spoilt so are diagnosed, PART is said, and nothing is explained by what is not there
reported() {
    python3 spoil.py "$1"
    "$SERVOSCOPE" diagnose "${1}1.csv" --validate "${1}2.csv" --model given.json >out 2>err || fail "$1: status $?: $(cat err)"
    grep -q -- "$2" out || fail "$1: no '$2' in $(cat out)"
    grep -q '^Not explained' out || fail "$1: $(head -1 out)"
}

refused gap '3012: time_s: 3.02 follows 2.999: 20 samples are missing'
refused repeat 'time_s: 0.249 follows 0.249: time has to increase'
refused torn 'samples have to be equidistant (--rate HZ trusts the rate'
handled torn 'the time stamps wander by 0\.[0-9]* samples' --rate 1000
handled shaken 'the time stamps wander by 0\.0[0-9]* samples'
handled jump 'jumps away for one row and back at 3 rows, first at row 1501'
handled wrap 'begins anew at every turn, [0-9]* times: it was put together'
handled period 'period_samples says 430, but the torque repeats every'
handled speed_sign 'Its sign is wrong'
handled rpm 'rpm instead of rad/s'
reported clip_torque 'torque_Nm stands at its largest value'
reported clip_speed 'velocity_rad_per_s stands at its largest value'
reported clip_place 'position_rad stands at its largest value'
refused sign 'positive torque makes the motion accelerate backward'
refused degrees 'it looks like degrees instead of rad; expected rad (--map position_rad=COLUMN*0.0174533)'
refused count 'it looks like encoder counts; expected rad'
refused ms 'time_s looks like ms'
refused mNm 'the torque looks like mNm instead of Nm (--map torque_Nm=COLUMN*0.001)'
refused reference 'torque_ref_Nm is 100 times torque_Nm'
refused reference_sign 'torque_ref_Nm has the opposite sign of torque_Nm'
refused mrad "times the model's 0.005 kgm2: a wrong unit, or a model of something else"

# What a message asks for with --map mends it.
"$SERVOSCOPE" diagnose degrees1.csv --validate degrees2.csv --model given.json --map 'position_rad=position_rad*0.017453292519943' \
    >out 2>err || fail "degrees mended: $(cat err)"
grep -q '^Explained: load bias$' out || fail "degrees mended: $(head -1 out)"

# A model of another axis, of another structure, of another size; runs of another rate.
echo '{"structure": "rigid", "mass_kg": 3, "sample_rate_hz": 1000}' >linear.json
refuse 1 'linear.json: a model of a linear axis, but good1.csv was recorded in rad and Nm' good1.csv --model linear.json
sed 's/"rigid"/"two_mass", "belt_stiffness_Nm_per_rad": 200, "belt_damping_Nms_per_rad": 0.02/' given.json >soft.json
"$SERVOSCOPE" diagnose good1.csv --validate good2.csv --model soft.json >out || fail "status $? for a soft belt"
grep -q "belt elasticity .*: The belt's stiffness is .*; the model has 200 Nm/rad" out || fail "a soft belt: $(cat out)"
sed 's/0\.002/0.02/; s/0\.003/0.03/' given.json >heavy.json
"$SERVOSCOPE" diagnose good1.csv --validate good2.csv --model heavy.json >out || fail "status $? for a heavy model"
grep -q "makes 0.00[45][0-9]* kgm2, the model's inertia is 0.05 kgm2: a wrong unit, or a model of something else" out ||
    fail "a heavy model: $(cat out)"
sed 's/sample_rate_hz: 1000/sample_rate_hz: 2000/' good2.csv >fast.csv
refuse 1 'fast.csv: sample_rate_hz is 2000, but time_s steps at 1000 Hz' good1.csv --validate fast.csv
awk -F, 'BEGIN {OFS = ","} /^#/ {sub(/sample_rate_hz: 1000/, "sample_rate_hz: 2000"); print; next}
    $1 != "time_s" {$1 = $1 / 2} {print}' good2.csv >fast.csv
refuse 1 'fast.csv: sampled at 2000 Hz, expected 1000 Hz as in good1.csv' good1.csv fast.csv --model given.json
refuse 1 'fast.csv: sampled at 2000 Hz, expected 1000 Hz as in good1.csv' good1.csv --validate fast.csv --model given.json

[ "$failures" -eq 0 ]
