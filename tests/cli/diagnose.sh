#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope diagnose from the command line: a cause that the truth plant hides, the forms of the options, what is refused.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
truth_case=$(dirname "$SERVOSCOPE")/tests/truth/truth_case
cd "$folder"
failures=0

fail() {
    echo "FAILED: $*" >&2
    failures=$((failures + 1))
}

# refuse STATUS PART ARGUMENTS...   the program ends with STATUS, says PART in one line on standard error, writes nothing
refuse() {
    local expected=$1 part=$2 status=0
    shift 2
    "$SERVOSCOPE" diagnose "$@" --json-out x.json --report x.html --extended xm.json >out 2>err || status=$?
    [ "$status" -eq "$expected" ] || fail "status $status instead of $expected: $*"
    grep -qF -- "$part" err || fail "no '$part' in '$(cat err)': $*"
    [ "$(wc -l <err)" -eq 1 ] || fail "not one line: $(cat err)"
    [ ! -s out ] || fail "standard output is not empty: $*"
    [ -z "$(find . -name 'x*')" ] || fail "left behind $(find . -name 'x*'): $*"
}

# A drive with cogging whose model has none; the first seed of this kind.
"$truth_case" --seed 1 --kind cogging --out case
cp case/run1.csv a.csv
cp case/run2.csv b.csv
cp case/nominal.json nominal.json

"$SERVOSCOPE" diagnose a.csv --validate b.csv --model nominal.json --json-out d.json --report r.html --extended m.json \
    >said 2>err || fail "status $? for a good case: $(cat err)"
[ ! -s err ] || fail "standard error: $(cat err)"
grep -q '^Explained: cogging$' said || fail "no verdict: $(cat said)"
grep -q 'evidence .* nats' said || fail "no evidence: $(cat said)"
grep -q '^Written: d.json, m.json, r.html$' said || fail "files: $(cat said)"
python3 - <<'PYTHON' || fail "d.json, m.json or r.html is not what it should be"
import json, xml.etree.ElementTree as tree
said = json.load(open("d.json"), parse_constant=lambda text: 1 / 0)
truth = json.load(open("case/truth.json"))
assert said["verdict"] == "explained", said["verdict"]
assert [cause["id"] for cause in said["causes"]] == ["cogging"], said["causes"]
for name in ("candidates", "ties", "untestable"):
    assert isinstance(said[name], list), name
assert said["extended"]["validation_nrmse"] < 0.5 * said["refitted"]["validation_nrmse"], said
assert 0 < said["noise_floor_nrmse"] < said["nominal"]["validation_nrmse"], said
assert "unexplained" not in said
# What the cause is worth on unseen data, and where the models are wrong, on all six axes.
cause = said["causes"][0]
assert cause["validation_evidence"] > 0.2 * cause["evidence"], cause
assert cause["validation_nrmse_without"] > 2 * said["extended"]["validation_nrmse"], cause
misfit = said["misfit"]
assert misfit["nominal_noise_share"] < 0.5 < misfit["extended_noise_share"], misfit
assert misfit["nominal_where"] and not misfit["extended_where"], misfit
for axis in ("frequency_hz", "velocity_rad_per_s", "position_rad", "direction", "time_s", "level_Nm"):
    parts = misfit[axis]
    assert len(parts["from"]) == len(parts["to"]) == len(parts["nominal"]["rms"]) == len(parts["extended"]["rms"]) >= 2, axis
    assert abs(sum(parts["nominal"]["share"]) - 1) < 1e-6, axis
    assert max(parts["nominal"]["rms"]) > 1.5 > 0.9 * min(parts["extended"]["rms"]), axis
assert said["judged_on"] == "b.csv", said["judged_on"]
# The extended model has the estimates as its parameters, and it is the given model otherwise.
model, nominal = json.load(open("m.json")), json.load(open("nominal.json"))
found = said["causes"][0]["parameters"]["amplitude_Nm"]
assert abs(model["effects"]["cogging"]["amplitude_Nm"] - found["value"]) < 1e-9, model
assert "cogging" not in nominal.get("effects", {})
page = tree.parse("r.html").getroot()
text = " ".join(page.itertext())
assert "Explained: cogging" in text and said["gain"] in text
PYTHON

# What was written can be simulated.
"$SERVOSCOPE" design --rate 1000 --period 500 --lines linear:2:100:2 --limit-torque 1 --inertia 0.005 --method random --seed 1 \
    --out table --quiet
"$SERVOSCOPE" simulate --model m.json --table table.mst --periods 2 --out again.csv --quiet || fail "the extended model does not run"

# Dry friction that builds up over less than can be told from a switch is in the extended model, and no cause.
cat >rigid.json <<'JSON'
{"structure": "rigid", "motor_inertia_kgm2": 0.005, "viscous_friction_Nms_per_rad": 0.01, "coulomb_friction_Nm": 0.05}
JSON
sed 's/}$/, "sensors": {"velocity_noise_rad_per_s": 0.002, "torque_noise_Nm": 0.0005},\
    "effects": {"presliding": {"presliding_distance_rad": 2e-5}}}/' rigid.json >bristle.json
for run in 1 2; do
    "$SERVOSCOPE" simulate --model bristle.json --seed "$run" --table table.mst --mode torque --periods 8 --out "bristle$run.csv" --quiet
done
"$SERVOSCOPE" diagnose bristle1.csv --validate bristle2.csv --model rigid.json --json-out d2.json --extended m2.json >said
python3 - <<'PYTHON' || fail "a short bristle: $(cat said)"
import json
said, model = json.load(open("d2.json")), json.load(open("m2.json"))
assert said["verdict"] == "no_discrepancy" and not said["causes"] and not said["candidates"], said
assert any("builds up over 2" in note and "no cause" in note for note in said["notes"]), said["notes"]
assert abs(model["effects"]["presliding"]["presliding_distance_rad"] / 2e-5 - 1) < 0.1, model
assert said["extended"]["whitened_rms"] < 1.02 < said["refitted"]["whitened_rms"], said
assert "with the detail noted" in said["headline"] and "with the detail noted" in said["gain"], said
PYTHON

# --json is one object, the one of --json-out; --quiet is quiet; both forms of --validate; compressed runs; foreign names.
"$SERVOSCOPE" diagnose a.csv --validate b.csv --model nominal.json --json --json-out again.json >said 2>err
[ ! -s err ] || fail "standard error with --json: $(cat err)"
cmp -s said again.json || fail "--json and --json-out differ"
cmp -s said d.json || fail "the same data gave another diagnosis"
[ -z "$("$SERVOSCOPE" diagnose a.csv --validate b.csv --model nominal.json --quiet 2>&1)" ] || fail "--quiet is not quiet"
gzip -c b.csv >b.csv.gz
"$SERVOSCOPE" diagnose a.csv --validate b.csv b.csv.gz --model nominal.json --json >one
"$SERVOSCOPE" diagnose --model nominal.json --validate=b.csv --validate b.csv.gz --json -- a.csv >other
cmp -s one other || fail "--validate a b and --validate a --validate b differ"
for run in a b; do
    sed '0,/torque_Nm/s/torque_Nm/iq/' "$run.csv" | sed 's/\(^\|,\)torque_Nm\(,\|$\)/\1iq\2/' >"foreign_$run.csv"
done
grep -q 'iq' foreign_a.csv || fail "the foreign run is not foreign"
"$SERVOSCOPE" diagnose foreign_a.csv --validate foreign_b.csv --model nominal.json --map 'torque_Nm=iq' --json >said 2>err ||
    fail "--map: $(cat err)"
cmp -s <(python3 -c 'import json; print(json.load(open("said"))["causes"])') \
    <(python3 -c 'import json; print(json.load(open("d.json"))["causes"])') || fail "--map does not hold for every run"

# One run: a part is held back, and the next step says so.
"$SERVOSCOPE" diagnose a.csv --model nominal.json >said || fail "one run"
grep -q 'Record a second run' said || fail "one run: $(cat said)"

# What has no name is said with where it lies, how much it is and what would show it.
"$truth_case" --seed 951 --kind position_friction --size clear --protocol stroke --out unknown
"$SERVOSCOPE" diagnose unknown/run1.csv --validate unknown/run2.csv --model unknown/nominal.json --json-out u.json --report u.html \
    >said || fail "status $? for an unknown cause"
grep -q '^Where it is wrong' said || fail "not where: $(cat said)"
python3 - <<'PYTHON' || fail "an unknown cause: $(cat said)"
import json
said, printed = json.load(open("u.json")), open("said").read()
assert said["verdict"] == "unexplained", said["verdict"]
where = said["unexplained"]["where"]
assert where.startswith("at ") and " % of it)" in where and "friction that changes with position" in where, where
assert where in printed and where.replace("'", "&#39;") in open("u.html").read(), where
assert any(step.startswith("To see what has no name: measure one slow stroke") for step in said["next"]), said["next"]
assert said["misfit"]["extended_where"], said["misfit"]
PYTHON

# A verdict of any kind ends with status 0.
"$truth_case" --seed 1 --kind clean --out clean
"$SERVOSCOPE" diagnose clean/run1.csv --validate clean/run2.csv --model clean/nominal.json >said || fail "status $? for no discrepancy"
grep -q '^No discrepancy' said || fail "$(cat said)"

# Wrong usage.
refuse 2 "RUN.csv is missing" --model nominal.json
refuse 2 "unknown option '--speed'" a.csv --speed 3
refuse 2 "--rate: '0', expected a positive number" a.csv --rate 0
refuse 2 "--validate: needs a value" a.csv --validate --model nominal.json
refuse 2 "--map" a.csv --map torque_Nm

# Data that is refused, with file and reason, before anything is written.
refuse 1 "missing.csv" missing.csv --validate b.csv
refuse 1 "missing.csv" a.csv --validate missing.csv
refuse 1 "missing.json" a.csv --validate b.csv --model missing.json
: >empty.csv
refuse 1 "empty.csv" empty.csv --validate b.csv
refuse 1 "empty.csv" a.csv --validate b.csv empty.csv
awk -F, 'BEGIN{OFS=","} /^#/||!seen{if(!/^#/)seen=1; print; next} {n++; if(n==50)$3="nan"; print}' a.csv >nan.csv
refuse 1 "nan.csv:" nan.csv --validate b.csv
sed '/^[^#]/{s/torque_Nm/unknown/g}' a.csv >column.csv
refuse 1 "column.csv: no torque" column.csv --validate b.csv
refuse 1 "column.csv: no torque" a.csv --validate column.csv
gzip -c a.csv >whole.csv.gz
head -c 20000 whole.csv.gz >short.csv.gz
refuse 1 "short.csv.gz" short.csv.gz --validate b.csv
refuse 1 "short.csv.gz" a.csv --validate short.csv.gz
echo '{"structure": "rigid", "motor_inertia_kgm2": ' >broken.json
refuse 1 "broken.json:" a.csv --validate b.csv --model broken.json
echo '{"structure": "rigid", "motor_inertia_kgm2": -1}' >negative.json
refuse 1 "negative.json" a.csv --validate b.csv --model negative.json
echo '{"structure": "rigid", "mass_kg": 2}' >linear.json
refuse 1 "linear.json: a model of a linear axis" a.csv --validate b.csv --model linear.json
awk -F, 'BEGIN{OFS=","; n=0} /^#/{sub(/sample_rate_hz: .*/, "sample_rate_hz: 500"); print; next}
    n==0{for(i=1;i<=NF;i++)if($i=="time_s")t=i} n>0&&t{$t=(n-1)/500} {n++; print}' b.csv >slow.csv
refuse 1 "slow.csv: sampled at 500 Hz, expected 1000 Hz as in a.csv" a.csv --validate slow.csv
head -40 a.csv >brief.csv
refuse 1 "brief.csv" brief.csv --validate b.csv

# Results that cannot be written, or would take the place of data.
status=0
"$SERVOSCOPE" diagnose a.csv --validate b.csv --report missing/r.html >out 2>err || status=$?
[ "$status" -eq 1 ] && grep -qF 'missing/r.html: cannot be written' err || fail "a folder that is not there: $status $(cat err)"
sum=$(cksum <b.csv)
for name in b.csv ./b.csv; do
    status=0
    "$SERVOSCOPE" diagnose a.csv --validate b.csv --json-out "$name" >out 2>err || status=$?
    [ "$status" -eq 2 ] && grep -qF 'would be overwritten' err || fail "overwriting a run: $status $(cat err)"
done
[ "$(cksum <b.csv)" = "$sum" ] || fail "a run was overwritten"
status=0
"$SERVOSCOPE" diagnose a.csv --validate b.csv --model nominal.json --json-out /dev/full >out 2>err || status=$?
[ "$status" -eq 1 ] && grep -qF '/dev/full' err || fail "a full disk: $status $(cat err)"

# Ctrl-C: the best so far, and a status that says that it is not all.
stopped=no
for delay in 0.3 0.6 1.2 2.4; do # a signal that comes before the search begins is not for it
    [ "$stopped" = no ] || continue
    "$SERVOSCOPE" diagnose a.csv --validate b.csv --model nominal.json --json-out stopped.json >out 2>err &
    child=$!
    sleep "$delay"
    kill -INT "$child" 2>/dev/null || true
    status=0
    wait "$child" || status=$?
    if [ "$status" -eq 1 ] && grep -qF 'interrupted' err; then stopped=yes; fi
done
[ "$stopped" = yes ] || fail "Ctrl-C: $status $(cat err)"
python3 -c 'import json; json.load(open("stopped.json"))' || fail "Ctrl-C: no diagnosis"

[ "$failures" -eq 0 ] || { echo "$failures failures" >&2; exit 1; }
echo "diagnose: all as it should be"
