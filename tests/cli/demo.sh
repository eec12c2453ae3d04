#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope demo from the command line: its files, that it finds what it hid, that the axis kept near its limits, what it
# refuses. The seeds are fixed; fresh ones are for `./run bench demo`.
subcommand=demo
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

# refuse STATUS PART ARGUMENTS...   the program ends with STATUS, says PART in one line on standard error, prints nothing
refuse() {
    local expected=$1 part=$2 status=0
    shift 2
    "$SERVOSCOPE" demo "$@" >out 2>err || status=$?
    [ "$status" -eq "$expected" ] || fail "status $status instead of $expected: $*"
    grep -qF -- "$part" err || fail "no '$part' in '$(cat err)': $*"
    [ "$(wc -l <err)" -eq 1 ] || fail "not one line: $(cat err)"
    [ ! -s out ] || fail "standard output is not empty: $*"
    [ ! -e servoscope-demo ] || fail "left behind servoscope-demo: $*"
}

"$SERVOSCOPE" demo --help >said
grep -q -- '--seed S' said || fail "--help: $(head -n 3 said)"

refuse 2 "--seed: 'some'" --seed some
refuse 2 '--seed' --seed -1
refuse 2 '--seed' --seed 1.5
refuse 2 'unknown option' --drive sim:
refuse 2 'stray' stray
echo text >file
refuse 1 'file is there, but is no folder' --out file
refuse 1 'none/below: cannot be made' --out none/below

# Another seed, another effect: in fixed seeds that cover friction, actuator and structure.
for seed in 1 7 8; do
    out=demo-$seed
    timeout 120 "$SERVOSCOPE" demo --seed "$seed" --out "$out" >said 2>err || fail "seed $seed: $(cat err)"
    [ ! -s err ] || fail "seed $seed says on standard error: $(cat err)"
    grep -q "^open:   $out/report.html\$" said || fail "seed $seed does not end with what to open: $(tail -n 1 said)"
    python3 - "$out" "$seed" <<'PYTHON' || fail "seed $seed (replay: servoscope demo --seed $seed)"
import csv, json, os, sys, xml.dom.minidom
out, seed = sys.argv[1], int(sys.argv[2])
expected = {"report.html", "nominal.json", "drive.json", "hidden.json", "run1.csv", "run2.csv", "frf.csv", "d.json",
            "extended.json"} | {f"excitation{i}.{e}" for i in (1, 2) for e in ("mst", "csv", "h")}
assert set(os.listdir(out)) == expected, sorted(os.listdir(out))
answers = {name: json.load(open(f"{out}/{name}.json")) for name in ("nominal", "drive", "hidden", "d", "extended")}
hidden, found = answers["hidden"], answers["d"]
assert hidden["seed"] == seed and answers["nominal"] != answers["drive"]
assert found["verdict"] == "explained", found["verdict"]
assert [cause["id"] for cause in found["causes"]] == [hidden["id"]], (hidden["id"], found["causes"])
for name, parameter in hidden["parameters"].items():
    estimate = found["causes"][0]["parameters"][name]["value"]
    # A belt's damping is the least certain number; 10 % of it is several of its standard deviations.
    assert abs(estimate - parameter["value"]) <= 0.1 * abs(parameter["value"]), (name, estimate, parameter)
# The extended model is at the noise floor on the run that it has not seen (floor and misfit are both estimates).
assert found["extended"]["validation_nrmse"] < 1.5 * found["noise_floor_nrmse"], found
for run in ("run1.csv", "run2.csv"):
    rows = [row for row in csv.DictReader(line for line in open(f"{out}/{run}") if line[0] != "#")]
    assert len(rows) == 22000, len(rows)
    # Designed for 1 Nm and 3.145 rad/s; friction, control and an elastic belt come on top.
    assert 0.9 < max(abs(float(row["torque_ref_Nm"])) for row in rows) < 1.5
    assert 2.5 < max(abs(float(row["velocity_rad_per_s"])) for row in rows) < 1.25 * 3.145
lines = [row for row in csv.DictReader(line for line in open(f"{out}/frf.csv") if line[0] != "#")]
assert len(lines) == 200 and all(row["valid"] == "1" and float(row["std"]) > 0 for row in lines)
page = xml.dom.minidom.parse(f"{out}/report.html")
assert len(page.getElementsByTagName("figure")) >= 5
text = open(f"{out}/report.html").read()
for heading in ("Excitation", "Measurement", "Frequency response"):
    assert f"</span> {heading}</h2>" in text, heading
assert "What was hidden was found" in text and "nan" not in text.lower().replace("nanometre", "")
PYTHON
done
cmp -s demo-1/hidden.json demo-7/hidden.json && fail "two seeds hide the same"

# An existing folder is used again, the same seed gives the same recording, --json is one object.
cp demo-8/run1.csv first.csv
"$SERVOSCOPE" demo --seed 8 --out demo-8 --json >said 2>err
python3 -c '
import json
said = json.load(open("said"))
assert said["found"] == [said["hidden"]["id"]] and said["open"] == "demo-8/report.html", said
' || fail "--json: $(cat said)"
cmp first.csv demo-8/run1.csv || fail "the same seed gives another run"
[ "$(find . -name '*.tmp*' | wc -l)" -eq 0 ] || fail "temporary files are left: $(find . -name '*.tmp*')"

# The files are those of the other subcommands.
"$SERVOSCOPE" frf demo-1/run1.csv --out again.csv --quiet --report frf.html
cmp <(grep -v '^#' again.csv) <(grep -v '^#' demo-1/frf.csv) || fail "frf gives another response"
"$SERVOSCOPE" design --rate 1000 --period 200 --lines linear:5:100:5 --limit-force-n 10 --mass 1 --out linear --quiet \
    --report design.html
python3 -c '
import xml.dom.minidom
for page, section in (("frf.html", "Frequency response"), ("design.html", "Excitation")):
    assert section in xml.dom.minidom.parse(page).getElementsByTagName("h2")[0].toxml(), page
' || fail "--report of frf or design"
"$SERVOSCOPE" measure --drive sim:demo-1/drive.json --table demo-1/excitation1.mst --periods 10 --out again.csv --quiet
cmp <(grep -v '^#' again.csv) <(grep -v '^#' demo-1/run1.csv) || fail "measure gives another run"

[ "$failures" -eq 0 ]
