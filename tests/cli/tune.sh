#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope tune from the command line: measured, tuned, put into the drive and measured again; what it writes and refuses.
subcommand=tune
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

# A belt drive with a sample of dead time; its loop is measured as the controller sees it.
cat >drive.json <<'JSON'
{"structure": "two_mass", "motor_inertia_kgm2": 0.0031, "load_inertia_kgm2": 0.00206, "belt_stiffness_Nm_per_rad": 600,
 "belt_damping_Nms_per_rad": 0.05, "viscous_friction_Nms_per_rad": 0.01, "dead_time_s": 0.0005, "sample_rate_hz": 2000, "seed": 3}
JSON
sed 's/"structure": "two_mass"/"structure": "rigid"/; s/ "belt_damping_Nms_per_rad": 0.05,//; s/ "belt_stiffness_Nm_per_rad": 600,//' \
    drive.json >rigid.json
"$SERVOSCOPE" design --rate 2000 --period 2000 --lines linear:1:800:1 --limit-torque 2 --inertia 0.00516 --method schroeder \
    --out table --quiet
for drive in rigid drive; do
    "$SERVOSCOPE" simulate --model "$drive.json" --table table.mst --periods 6 --out run.csv --quiet
    "$SERVOSCOPE" frf run.csv --input torque_ref_Nm --output velocity_rad_per_s --out "$drive.csv" --quiet
done

# The gains, back in the drive: with velocity commands alone the response from command to velocity is the closed loop T.
"$SERVOSCOPE" tune rigid.csv --bandwidth 30 --out tune.json --report tune.html >said
grep -q "stable by Nyquist's criterion on 800 lines, 1..800 Hz" said || fail "$(cat said)"
python3 - <<'PYTHON' || fail "the tuned model cannot be written"
import json
model, tuned = json.load(open("rigid.json")), json.load(open("tune.json"))
model["controller"] = {**tuned["model_controller"], "position_gain_per_s": 0, "velocity_feedforward": 1, "torque_feedforward": 0}
json.dump(model, open("tuned.json", "w"))
PYTHON
"$SERVOSCOPE" simulate --model tuned.json --table table.mst --periods 6 --out closed-run.csv --quiet || fail "the tuned loop does not run"
"$SERVOSCOPE" frf closed-run.csv --input velocity_ref_rad_per_s --output velocity_rad_per_s --out closed.csv --quiet
python3 - <<'PYTHON' || fail "the closed loop is not the one that was asked for"
import cmath, csv, json, math
tuned = json.load(open("tune.json"))
rows = [row for row in csv.DictReader(line for line in open("closed.csv") if not line.startswith("#")) if row["valid"] == "1"]
f = [float(row["frequency_hz"]) for row in rows]
T = [complex(float(row["real"]), float(row["imag"])) for row in rows]
cutoff = next(a for a, t, u in zip(f, T, T[1:]) if abs(t) >= math.sqrt(.5) > abs(u))
print("closed loop -3 dB: measured", cutoff, "predicted", tuned["cutoff_hz"]["value"], "reference", tuned["reference"]["cutoff_hz"])
assert abs(cutoff / tuned["cutoff_hz"]["value"] - 1) < .03, "not what was predicted"  # lines are 1 Hz apart
assert abs(cutoff / tuned["reference"]["cutoff_hz"] - 1) < .1, "not what was asked for"
assert abs(max(map(abs, T)) - 1) < .3, "a peak"
# The whole measured T against the reference, in the band that was asked for.
w = 2 * math.pi * 30
M = [(1.8 * w * 2j * math.pi * a + w * w) / (w * w - (2 * math.pi * a) ** 2 + 1.8 * w * 2j * math.pi * a) for a in f]
late = [m * cmath.exp(-2j * math.pi * a * .75e-3) for a, m in zip(f, M)]  # hold and one sample
worst = max(abs(t - m) for a, t, m in zip(f, T, late) if a <= 60)
print("largest |T - M| up to 60 Hz:", worst)
assert worst < .08
PYTHON

# What the page has, and nothing that is not a number.
for part in 'Closed loop' 'reference M' 'Nyquist plot' 'Frequency response' 'max |S|' 'velocity_gain_Nms_per_rad'; do
    grep -q "$part" tune.html || fail "no '$part' in the page"
done
python3 - <<'PYTHON' || fail "the page is not well-formed or holds nan"
import re, xml.dom.minidom
text = open("tune.html", encoding="utf-8").read()
xml.dom.minidom.parseString(text.replace("<!DOCTYPE html>", "", 1))
assert not re.search(r"\b(nan|inf)\b", text[text.index("<main>"):])
PYTHON

# --json is what --out writes; --quiet says nothing.
"$SERVOSCOPE" tune rigid.csv --bandwidth 30 --json >said
cmp said tune.json || fail "--json and --out differ"
"$SERVOSCOPE" tune rigid.csv --bandwidth 30 --quiet >said
[ ! -s said ] || fail "--quiet says something"

# The belt drive: its resonance is found, every structure gives a stable loop, none a negative gain; the biquad misses M by less.
for name in p pi pid lead pi+notch pi+biquad; do
    "$SERVOSCOPE" tune drive.csv --bandwidth 30 --controller "$name" --json >"said-$name" || fail "$name"
done
python3 - <<'PYTHON' || fail "structures"
import json
said = {name: json.load(open("said-" + name)) for name in "p pi pid lead pi+notch pi+biquad".split()}
for name, one in said.items():
    assert one["stability"]["stable"] and one["margins"]["max_sensitivity"]["value"] < 2, name
    assert all(gain["value"] >= 0 and gain["std"] >= 0 for gain in one["gains"].values()), name
found = said["pi"]["resonance"]  # sqrt(600 (1/.0031 + 1/.00206)) and sqrt(600/.00206), over 2 pi
assert abs(found["frequency_hz"] - 110.8) < .5 and abs(found["antiresonance_hz"] - 85.9) < .5, found
assert .02 < found["damping"] < .04, found
cost = {name: one["fit"]["cost_db"] for name, one in said.items()}
print(cost)
assert cost["pi+biquad"] < cost["pi+notch"] - 3 < cost["pi"] - 3 <= cost["p"] - 3, cost
PYTHON
"$SERVOSCOPE" tune drive.csv --bandwidth 30 --controller pi+notch --notch 110:0.03:0.5 --json >said
python3 -c 'import json; f = json.load(open("said"))["filter"]; assert f["zero_hz"] == f["pole_hz"] == 110 and f["pole_damping"] == .5, f' ||
    fail "--notch: $(cat said)"

# More delay than the bandwidth bears: refused with figures and something to try, which then does.
refuse 1 'would be unstable: 2 poles outside the unit circle with Kp' rigid.csv --bandwidth 60 --delay 0 --loop-delay 0.02 --out x.csv
refuse 1 'try: --bandwidth' rigid.csv --bandwidth 60 --delay 0 --loop-delay 0.02 --out x.csv --report x.html
[ ! -e x.html ] || fail "a page of an unstable loop"
lower=$(sed 's/.*try: --bandwidth \([0-9.]*\) .*/\1/' err)
"$SERVOSCOPE" tune rigid.csv --bandwidth "$lower" --delay 0 --loop-delay 0.02 --quiet || fail "--bandwidth $lower, as was said, is not stable"

# Lines that cannot tell.
awk -F, '/^#/ || /^f/ || $1 <= 20' rigid.csv >low.csv
refuse 1 'lines above the crossover are missing' low.csv --bandwidth 30 --out x.csv
awk -F, '/^#/ || /^f/ || $1 >= 100' rigid.csv >high.csv
refuse 1 'lines below the crossover are missing' high.csv --bandwidth 30 --out x.csv
awk -F, 'BEGIN{OFS=","} /^#/ || /^f/{print; next} {$2 = -$2; $3 = -$3; print}' rigid.csv >backwards.csv
refuse 1 'does the velocity count the other way round?' backwards.csv --bandwidth 30 --out x.csv
awk -F, 'BEGIN{OFS=","} /^#/ || /^f/{print; next} {$4 = sqrt($2 * $2 + $3 * $3); print}' rigid.csv >noisy.csv
refuse 1 'noise decides' noisy.csv --bandwidth 30 --out x.csv

# A resonance and its antiresonance between two stretches of lines make the loop unstable unseen: refused, and what to measure is named.
# Where the same lines are there, whatever is given out is stable; where |L| is far below 0 dB the gap is no matter.
cat >lag.json <<'JSON'
{"structure": "two_mass", "motor_inertia_kgm2": 0.002, "load_inertia_kgm2": 0.00306, "belt_stiffness_Nm_per_rad": 60,
 "belt_damping_Nms_per_rad": 0.002, "viscous_friction_Nms_per_rad": 0.01, "torque_lag_s": 0.002, "dead_time_s": 0.005, "sample_rate_hz": 1000}
JSON
seq 0.5 0.5 17.5 >lines.txt
seq 50.5 0.5 100 >>lines.txt
"$SERVOSCOPE" design --rate 1000 --period 2000 --lines list:lines.txt --limit-torque 2 --inertia 0.005 --method schroeder --out hole --quiet
"$SERVOSCOPE" simulate --model lag.json --table hole.mst --mode torque --periods 20 --settle 3 --out run.csv --quiet
"$SERVOSCOPE" frf run.csv --input torque_ref_Nm --output velocity_rad_per_s --out hole.csv --quiet
refuse 1 'between the lines at 17.5 and 50.5 Hz' hole.csv --bandwidth 5 --out x.csv
grep -q 'a resonance may hide there that raises it by 30 dB' err || fail "$(cat err)"
grep -q 'expected lines between 17.5 and 50.5 Hz' err || fail "$(cat err)"
refuse 1 'between the lines at 17.5 and 50.5 Hz' hole.csv --bandwidth 2 --controller p --out x.csv
awk -F, 'BEGIN{OFS=","} /^#/ || /^f/{print; next} $1 > 40 && $1 < 130{$8 = 0} {print}' rigid.csv >missing.csv
refuse 1 '(89 lines at 41..129 Hz not valid)' missing.csv --bandwidth 30 --out x.csv
awk -F, 'BEGIN{OFS=","} /^#/ || /^f/{print; next} $1 > 300 && $1 < 700{$8 = 0} {print}' rigid.csv >missing.csv
"$SERVOSCOPE" tune missing.csv --bandwidth 5 >said || fail "a gap far below 0 dB"
grep -q 'mind: left out as not valid: 399 lines at 301..699 Hz' said || fail "$(cat said)"
grep -q 'mind: there is no line between 300 and 700 Hz' said || fail "$(cat said)"
grep -q 'gain margin: no limit on these lines' said || fail "$(cat said)"

# A controller at half the rate sees the drive behind its own, longer hold: its gains on the drive measured at 2000 Hz are those on the same
# drive measured at 1000 Hz. The dead time is a whole number of samples of neither.
sed 's/"dead_time_s": 0.0005/"dead_time_s": 0.0012/' rigid.json >fast.json
sed 's/"sample_rate_hz": 2000/"sample_rate_hz": 1000/' fast.json >slow.json
"$SERVOSCOPE" design --rate 2000 --period 2000 --lines linear:1:999:1 --limit-torque 2 --inertia 0.00516 --method schroeder --out fast --quiet
"$SERVOSCOPE" design --rate 1000 --period 1000 --lines linear:1:499:1 --limit-torque 2 --inertia 0.00516 --method schroeder --out slow --quiet
for rate in fast slow; do
    "$SERVOSCOPE" simulate --model "$rate.json" --table "$rate.mst" --periods 20 --out run.csv --quiet
    "$SERVOSCOPE" frf run.csv --input torque_ref_Nm --output velocity_rad_per_s --out "$rate.csv" --quiet
done
"$SERVOSCOPE" tune fast.csv --bandwidth 20 --rate 1000 --json >said-fast
"$SERVOSCOPE" tune fast.csv --bandwidth 20 --json >said-own
"$SERVOSCOPE" tune slow.csv --bandwidth 20 --json >said-slow
python3 - <<'PYTHON' || fail "--rate"
import json
fast, slow, own = (json.load(open("said-" + name)) for name in ("fast", "slow", "own"))
assert fast["sample_rate_hz"] == slow["sample_rate_hz"] == 1000 and fast["response_rate_hz"] == own["response_rate_hz"] == 2000
numbers = lambda said: [gain["value"] for gain in said["gains"].values()] + [said["margins"]["phase_deg"]["value"], said["margins"]["gain_db"]["value"]]
print("half the rate:", numbers(fast), "measured at it:", numbers(slow), "own rate:", numbers(own))
assert all(abs(a / b - 1) < .01 for a, b in zip(numbers(fast), numbers(slow)))  # noise of two measurements
assert any(abs(a / b - 1) > .03 for a, b in zip(numbers(own), numbers(slow)))  # which the hold is more than
assert any("carried over" in warning for warning in fast["warnings"]) and not any("carried over" in warning for warning in own["warnings"])
PYTHON

# What the response's file says against itself comes before the gains; one that is biased is not tuned on.
sed '1i # parametric_warning: more dynamics than the model has' rigid.csv >warned.csv
"$SERVOSCOPE" tune warned.csv --bandwidth 30 >said
sed -n 2p said | grep -q 'mind: .*parametric_warning.*more dynamics than the model has' || fail "$(cat said)"
"$SERVOSCOPE" simulate --model rigid.json --table table.mst --periods 6 --out run.csv --quiet
"$SERVOSCOPE" frf run.csv --method h1 --input torque_ref_Nm --output velocity_rad_per_s --out biased.csv --quiet
refuse 1 'its key warning says of the response: biased' biased.csv --bandwidth 30 --out x.csv
awk -F, 'BEGIN{OFS=","} /^#/ || /^f/{print; next} {$1 = $1 * 6.283185307179586; print}' rigid.csv >radians.csv
refuse 1 'is frequency_hz in rad/s?' radians.csv --bandwidth 30 --out x.csv

# Lines that are not valid do not count.
awk -F, 'BEGIN{OFS=","} /^#/ || /^f/{print; next} NR % 9 == 0{$2 = 1e6; $8 = 0} {print}' rigid.csv >gaps.csv
"$SERVOSCOPE" tune gaps.csv --bandwidth 30 --json >said
python3 -c '
import json
one, whole = json.load(open("said")), json.load(open("tune.json"))
assert one["stability"]["lines"] + one["stability"]["lines_skipped"] == 800 and one["stability"]["lines_skipped"] > 80, one["stability"]
for name, gain in whole["gains"].items():
    assert abs(one["gains"][name]["value"] / gain["value"] - 1) < .05, name
' || fail "lines that are not valid"

# A response to position: pi has no lead; pid is a position controller and says so.
"$SERVOSCOPE" simulate --model rigid.json --table table.mst --periods 6 --out run.csv --quiet
"$SERVOSCOPE" frf run.csv --input torque_ref_Nm --output position_rad --out position.csv --quiet
refuse 1 'has no phase lead to hold it' position.csv --bandwidth 20 --out x.csv
"$SERVOSCOPE" tune position.csv --bandwidth 20 --controller pid --json >said
python3 -c '
import json
said = json.load(open("said"))
assert said["feedback"] == "position" and said["model_controller"] is None, said
assert set(said["gains"]) == {"proportional_Nm_per_rad", "integral_Nm_per_rad_s", "derivative_Nms_per_rad"}, said["gains"]
' || fail "position: $(cat said)"

# Wrong usage, and outputs that would take the place of an input.
refuse 2 '--bandwidth is missing' rigid.csv --out x.csv
refuse 2 "--bandwidth: '0'" rigid.csv --bandwidth 0 --out x.csv
refuse 2 'at most 500 Hz' rigid.csv --bandwidth 501 --out x.csv
refuse 2 "--controller: 'pd', expected one of p, pi, pid, lead, pi+notch, pi+biquad" rigid.csv --bandwidth 30 --controller pd --out x.csv
refuse 2 "--weighting: 'linear', expected log or flat" rigid.csv --bandwidth 30 --weighting linear --out x.csv
refuse 2 "--notch is for --controller pi+notch, not pi" rigid.csv --bandwidth 30 --notch 100:0.1 --out x.csv
refuse 2 "--notch: '100', expected HZ:DAMPING" rigid.csv --bandwidth 30 --controller pi+notch --notch 100 --out x.csv
refuse 2 "expected frequencies below 1000 Hz" rigid.csv --bandwidth 30 --controller pi+notch --notch 1000:0.1 --out x.csv
refuse 1 'there is no resonance for the filter' rigid.csv --bandwidth 30 --controller pi+notch --out x.csv
grep -v '^# sample_rate_hz' rigid.csv >rateless.csv
refuse 2 'expected --rate HZ' rateless.csv --bandwidth 30 --out x.csv
"$SERVOSCOPE" tune rateless.csv --bandwidth 30 --rate 2000 --quiet || fail "--rate"
sed 's/^# input: .*/# input: temperature_K/' rigid.csv >strange.csv
refuse 1 "from 'temperature_K' to 'velocity_rad_per_s'" strange.csv --bandwidth 30 --out x.csv
refuse 2 'would be overwritten' rigid.csv --bandwidth 30 --out ./rigid.csv
refuse 1 'nowhere/r.html: cannot be written' rigid.csv --bandwidth 30 --out x.csv --report nowhere/r.html
refuse 1 'none.csv' none.csv --bandwidth 30 --out x.csv

[ "$failures" -eq 0 ]
