#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope diagnose on recordings as others make them: a slow turn under a current, a voltage that counts the other way
# round, clocks that differ.
subcommand=diagnose
. "$(dirname "$0")/../support/cli.sh"

python3 - <<'PYTHON'
import math, random
random.seed(11)

def write(path, names, rows):
    with open(path, "w") as out:
        out.write(",".join(names) + "\n")
        out.writelines(",".join(f"{x:.9g}" for x in row) + "\n" for row in rows)

# Two turns at constant speed: nothing accelerates, the current goes against ripple and friction.
for name, speed in (("slow1.csv", 1.0), ("slow2.csv", 1.3)):
    rows, n = [], int(4 * math.pi / speed * 200)
    for i in range(n):
        place = speed * i / 200
        current = 0.2 + 0.5 * math.cos(6 * place + 1.0) + random.gauss(0, 0.02)
        rows.append((i / 200, current, place + random.gauss(0, 1e-5)))
    write(name, ("t_s", "i_A", "angle_rad"), rows)

# A mass of 2 in units of what 1 V makes, pushed backward by positive voltage.
def pushed(path, rate, seed):
    random.seed(seed)
    period, phases = 500, [random.uniform(0, 2 * math.pi) for _ in range(40)]
    v = x = 0.0
    rows = []
    for i in range(6 * period):
        u = sum(math.cos(2 * math.pi * k * i / period + p) for k, p in zip(range(1, 81, 2), phases)) / 6
        rows.append((i / rate, u + random.gauss(0, 1e-3), x + random.gauss(0, 1e-8)))
        for _ in range(10):
            v += -u / 2.0 / rate / 10
            x += v / rate / 10
    write(path, ("t_s", "u_V", "place_m"), rows)

pushed("push1.csv", 1000.0, 1)
pushed("push2.csv", 1000.2, 2)
pushed("push3.csv", 1100.0, 3)
PYTHON

slow=current_A=i_A,position_rad=angle_rad
"$SERVOSCOPE" diagnose slow1.csv --validate slow2.csv --map $slow --json-out slow.json --report slow.html >said ||
    fail "status $? for a slow turn"
grep -q 'does not accelerate the axis' said || fail "not said that nothing accelerates: $(cat said)"
grep -q 'of the measured current' said || fail "no current: $(cat said)"
python3 - <<'PYTHON' || fail "the ripple of a slow turn: $(cat said)"
import json
said = json.load(open("slow.json"))
ripple = next(cause for cause in said["causes"] if cause["id"] == "cogging")["parameters"]
assert abs(ripple["amplitude_Nm"]["value"] - 0.5) < 0.02, ripple
assert abs(ripple["periods_per_rev"]["value"] - 6) < 0.05, ripple
blind = {item["id"] for item in said["untestable"]}
assert {"inertia", "second_mode", "periodic_disturbance"} <= blind, blind
assert any("reference" in step for step in said["next"]) or said["verdict"] != "unexplained", said["next"]
PYTHON

# Names that say their units need no map, and a note says what was taken; names that say none are listed.
"$SERVOSCOPE" diagnose slow1.csv --validate slow2.csv --rate 200 --json-out guessed.json >said || fail "status $? without --map"
grep -q 'columns were named by the units in their names: --map current_A=i_A,position_rad=angle_rad' said ||
    fail "not said how columns were named: $(cat said)"
sed '1s/.*/sample,iq,enc/' slow1.csv >nameless.csv
refuse 1 'the file has sample, iq, enc: --map current_A=COLUMN says which it is' nameless.csv --rate 200

push=voltage_V=u_V,position_m=place_m
"$SERVOSCOPE" diagnose push1.csv --validate push2.csv --map $push --json-out push.json >said || fail "status $? for a voltage"
grep -q 'Positive voltage accelerates backward .* its sign was turned' said || fail "no word of the sign: $(cat said)"
grep -q 'push2.csv: sampled at 1000.2 Hz, the first run at 1000 Hz: taken as the same' said || fail "rates: $(cat said)"
python3 - <<'PYTHON' || fail "a mass under a voltage of the wrong sign: $(cat said)"
import json
said = json.load(open("push.json"))
assert said["refitted"]["validation_nrmse"] < 0.05, said["refitted"]
PYTHON
refuse 1 'push3.csv: sampled at 1100 Hz, expected 1000 Hz' push1.csv --validate push3.csv --map $push

[ "$failures" -eq 0 ]
