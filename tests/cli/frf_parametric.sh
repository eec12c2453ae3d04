#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope frf --method parametric: the model on the screen, in --json, in --model-out and on the page, of one run, of a
# sequence, of several runs; in s and in 1/z; what is noticed and refused. The drive is simulated: resonance 79.58 Hz,
# antiresonance 61.64 Hz, J = 0.001 kg m2.
subcommand=frf
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

cat >m.json <<'JSON'
{"structure": "two_mass", "motor_inertia_kgm2": 0.0006, "load_inertia_kgm2": 0.0004, "belt_stiffness_Nm_per_rad": 60,
 "belt_damping_Nms_per_rad": 0.02, "viscous_friction_Nms_per_rad": 0.005, "sample_rate_hz": 2000,
 "sensors": {"velocity_noise_rad_per_s": 0.01}, "seed": 3}
JSON
limits=(--inertia 0.001 --limit-torque 1 --limit-velocity 30)
for r in 1 2 3; do
    "$SERVOSCOPE" design --rate 2000 --period 2000 --lines linear:2:400:4 --method random --seed "$r" "${limits[@]}" \
        --out "t$r" --quiet
    sed "s/\"seed\": 3/\"seed\": $r/" m.json >"m$r.json" # noise of its own
    "$SERVOSCOPE" simulate --model "m$r.json" --table "t$r.mst" --periods 6 --out "run$r.csv" --quiet
done
"$SERVOSCOPE" design --rate 2000 --period 2000 --lines octaves:4:256:4 "${limits[@]}" --out seq --quiet
"$SERVOSCOPE" simulate --model m.json --table seq.json --periods 4 --out seqrun.json --quiet

cat >check.py <<'PYTHON'
import json, sys
shown = json.load(open(sys.argv[1]))
model = shown["model"]
plant = model["continuous"]
poles = [r for r in model["poles"] if r["pair"]]
zeros = [r for r in plant["zeros"] if r["pair"]]
near = lambda value, truth, std: abs(value - truth) <= 5 * std + 1e-4 * truth
good = (
    len(model["poles"]) == 2 and len(poles) == 1 and near(poles[0]["frequency_hz"], 79.577, poles[0]["frequency_std_hz"])
    and len(zeros) == 1 and near(zeros[0]["frequency_hz"], 61.640, zeros[0]["frequency_std_hz"])
    and near(plant["dc_gain"], 200, plant["dc_gain_std"]) and not any(r["cancels"] for r in model["poles"])
    and model["variable"] == "z^-1" and plant["variable"] == "s" and model["stable"] and "noise_cost_expected" in model
    and {"model_order", "model_poles", "model_zeros", "model_cost", "model_choice"} <= {f["id"] for f in shown["findings"]}
)
sys.exit(0 if good else f"{sys.argv[1]}: {json.dumps(model)[:2000]}")
PYTHON

# One run: all three places know the same.
"$SERVOSCOPE" frf run1.csv --method parametric --out f.csv --model-out model.json --report page.html >screen
grep -qE 'transfer function of order [0-9] over 3 in 1/z' screen || fail "no order on the screen: $(cat screen)"
grep -qE 'poles: 0\.[0-9.]+ \+- [0-9.e-]+ Hz, real; 79\.5[0-9]+ \+- [0-9.e-]+ Hz, damping 0\.08' screen || fail "poles: $(cat screen)"
grep -qE 'zeros without the hold: 61\.6' screen || fail "zeros: $(cat screen)"
grep -qE 'cost [0-9.e+]+, by noise alone [0-9.]+ \+- [0-9.]+ is expected' screen || fail "cost: $(cat screen)"
grep -q 'Transfer function' page.html || fail "no model on the page"
grep -q 'pole pair' page.html || fail "no poles on the page"
grep -qE '^# parametric_zeros: 61\.6' f.csv || fail "no zeros in the file"
"$SERVOSCOPE" frf run1.csv --method parametric --out f.csv --json >one.json
python3 check.py one.json || fail "one run"
python3 - model.json one.json <<'PYTHON' || fail "model.json and --json differ"
import json, sys
whole, shown = (json.load(open(name)) for name in sys.argv[1:])
orders = whole.pop("orders")
why = whole.pop("why")
sys.exit(not (whole == shown["model"] and len(orders) > 10 and why))
PYTHON

# A sequence and several runs have one model, of the response that they give together.
"$SERVOSCOPE" frf seqrun.json --method parametric --out f.csv --report page.html --json >seq-out.json
python3 check.py seq-out.json || fail "sequence"
grep -qx '# sequence: octaves' f.csv || fail "the sequence's keys"
grep -qx '# method: parametric' f.csv || fail "the sequence's method"
"$SERVOSCOPE" frf run1.csv run2.csv run3.csv --method parametric --out f.csv --model-out model.json --report page.html --json >runs.json
python3 check.py runs.json || fail "three runs"
[ -s model.json ] || fail "no model of three runs"

# Held input and a model in s: the model in 1/z without its hold. As band-limited input it is not believed.
"$SERVOSCOPE" frf run1.csv --method parametric --domain continuous --out f.csv --json >s.json
python3 check.py s.json || fail "--domain continuous of held input"
"$SERVOSCOPE" frf run1.csv --method parametric --hold band-limited --out f.csv >screen
grep -q 'warning: .*held between samples' screen || fail "held input as band-limited: $(cat screen)"

refuse 2 "--domain: 'z', expected discrete or continuous" run1.csv --method parametric --domain z --out x.csv
refuse 2 '--model-out is for --method parametric' run1.csv --model-out m --out x.csv

[ "$failures" -eq 0 ]
