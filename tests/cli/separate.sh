#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope design --separate from the command line: two causes that tie in a diagnosis of the excitation as given are told
# apart by the one that it makes; causes that are equal by physics; what is refused.
subcommand=design
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

common=(--rate 1000 --period 500 --lines odd:2:60:4 --limit-position 2 --limit-velocity 15 --limit-torque 3 --inertia 0.0051)
pair=load_bias,asymmetric_friction

# refuse STATUS PART ARGUMENTS...   the program ends with STATUS, says PART in one line on standard error, leaves nothing
refuse() {
    local expected=$1 part=$2 status=0
    shift 2
    "$SERVOSCOPE" design "${common[@]}" --out x "$@" >out 2>err || status=$?
    [ "$status" -eq "$expected" ] || fail "status $status instead of $expected: $*"
    grep -qF -- "$part" err || fail "no '$part' in '$(cat err)': $*"
    [ "$(wc -l <err)" -eq 1 ] || fail "not one line: $(cat err)"
    [ ! -s out ] || fail "standard output is not empty: $*"
    [ -z "$(find . -name 'x*')" ] || fail "left behind $(find . -name 'x*'): $*"
}

# A drive with little viscous friction and a constant load; asymmetric friction does nearly the same.
cat >nominal.json <<'JSON'
{"structure": "rigid", "motor_inertia_kgm2": 0.0004, "load_inertia_kgm2": 0.0047, "viscous_friction_Nms_per_rad": 0.0008,
 "coulomb_friction_Nm": 0.05, "torque_lag_s": 0.0005, "sample_rate_hz": 1000}
JSON
python3 - <<'PYTHON'
import json
model = json.load(open("nominal.json"))
model["effects"] = {"load_bias": {"bias_Nm": 0.0008}}
json.dump(model, open("m.json", "w"))
model["viscous_friction_Nms_per_rad"] = 0
json.dump(model, open("dry.json", "w"))
model["sample_rate_hz"] = 2000
json.dump(model, open("fast.json", "w"))
PYTHON

# As given: a tie, and the next step is the command.
"$SERVOSCOPE" design "${common[@]}" --out given --quiet
"$SERVOSCOPE" simulate --model m.json --table given.mst --periods 10 --out given.csv --quiet
"$SERVOSCOPE" diagnose given.csv --model nominal.json --json >given.json
python3 - <<'PYTHON' || fail "no tie as given, or no command for it: $(cat given.json)"
import json
ties = json.load(open("given.json"))["ties"]
tie = [tie for tie in ties if set(tie["causes"]) == {"load_bias", "asymmetric_friction"}]
assert tie and "servoscope design --separate " + ",".join(tie[0]["causes"]) in tie[0]["next"], ties
PYTHON

# The excitation that separates them, for a person and for a machine: the same.
"$SERVOSCOPE" design "${common[@]}" --separate $pair --model m.json --out s >said 2>err || fail "status $?: $(cat err)"
[ ! -s err ] || fail "standard error: $(cat err)"
grep -q '^load_bias: bias_Nm 0.0008 (as the model has it)$' said || fail "sizes: $(cat said)"
grep -q '^Simulated again with fresh noise: ' said || fail "no check: $(cat said)"
"$SERVOSCOPE" design "${common[@]}" --separate $pair --model m.json --out s --json >s.json
python3 - <<'PYTHON' || fail "the JSON is not what it should be: $(cat s.json)"
import json, os
said = json.load(open("s.json"), parse_constant=lambda text: 1 / 0)
text = open("said").read()
nats = {row["excitation"]: row["nats"] for row in said["separation"]}
assert nats["as_given"] < 6, nats
assert said["enough"] and nats[said["chosen"]] >= 20 == said["enough_nats"], said
assert len(said["checked_nats"]) == 3 and min(said["checked_nats"]) > 6, said
assert said["causes"][1]["size_from"] == "imitation", said["causes"]
assert 0.01 < said["causes"][1]["parameters"]["asymmetry_ratio"] < 0.03, said["causes"]
times = {row["excitation"]: row["test_time_s"] for row in said["separation"]}
cheaper = [name for name in nats if nats[name] is not None and nats[name] >= 20 and times[name] < times[said["chosen"]]]
assert not cheaper, cheaper
for command in said["commands"]:
    assert command in text, command
    if "--table " in command:
        assert os.path.exists(command.split("--table ")[1].split()[0]), command
PYTHON

# What it says to do, done on the simulated drive: the tie is gone.
sed -n 's/^  servoscope measure --drive URL /measure --drive sim:m.json /p' said >measure
while read -r line; do
    # shellcheck disable=SC2086  # the line is a list of arguments
    "$SERVOSCOPE" $line --quiet || fail "$line"
done <measure
mapfile -t runs < <(find . -name 's*-run.csv' | sort)
"$SERVOSCOPE" diagnose "${runs[@]}" --model nominal.json --json >apart.json
python3 - <<'PYTHON' || fail "not told apart: $(cat apart.json)"
import json
said = json.load(open("apart.json"))
assert "load_bias" in [cause["id"] for cause in said["causes"]], said
assert not [tie for tie in said["ties"] if "asymmetric_friction" in tie["causes"]], said["ties"]
PYTHON

# Without viscous friction the two are one and the same: a result, no error, and nothing to play.
"$SERVOSCOPE" design "${common[@]}" --separate $pair --model dry.json --out x --json >dry.out 2>err || fail "status $?: $(cat err)"
python3 -c 'import json; d = json.load(open("dry.out")); assert d["chosen"] is None and "same in every motion" in d["reason"], d
assert d["checked_nats"] == [] and d["commands"] == [], d' || fail "equal by physics: $(cat dry.out)"
[ -z "$(find . -name 'x*')" ] || fail "left behind $(find . -name 'x*')"

refuse 2 'expected one of asymmetric_friction, backlash' --separate load_bias,gravity --model m.json
refuse 2 'expected two causes' --separate load_bias --model m.json
refuse 2 '--model is missing' --separate $pair
refuse 2 'is for --separate' --model m.json
refuse 2 '--predict is for a single table' --separate $pair --model m.json --predict m.json
refuse 1 'backlash cannot act in this model' --separate backlash,load_bias --model m.json
refuse 1 "expected --rate's 1000 Hz" --separate $pair --model fast.json
refuse 1 'none.json' --separate $pair --model none.json

[ "$failures" -eq 0 ] || exit 1
echo "design --separate: all as expected"
