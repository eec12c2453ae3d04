#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# A sequence end to end: design octaves: and dwell:, measure or simulate their manifest, frf of the manifest of runs; what
# is kept after Ctrl-C, and what is refused.
subcommand=measure
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

echo '{"structure": "rigid", "motor_inertia_kgm2": 0.005, "viscous_friction_Nms_per_rad": 0.02, "sample_rate_hz": 1000,
 "seed": 3}' >model.json
axis=(--limit-torque 1 --inertia 0.005)
grid=(--rate 1000 --period 500)
"$SERVOSCOPE" design "${grid[@]}" --lines octaves:2:100:2 "${axis[@]}" --out belt >said
grep -q '^octaves by schroeder: 50 lines, 2 to 100 Hz, in 6 segments' said || fail "$(cat said)"
"$SERVOSCOPE" design "${grid[@]}" --lines dwell:10:16:2 "${axis[@]}" --settle-time 1.2 --out dwell --quiet
"$SERVOSCOPE" design "${grid[@]}" --lines linear:2:100:2 "${axis[@]}" --method schroeder --out single --quiet

# The second paper's figures, and its signal as it is on the disk: flat, half-open bands, peaks of 1 to sqrt(2) roots of N.
"$SERVOSCOPE" design --rate 500 --period 5000 --lines octaves:0.1:25:0.1 "${axis[@]}" --periods 1 --settle-time 10 \
    --out paper --json >said
python3 - <<'PYTHON' || fail "the paper's sequence is another"
import cmath, csv, json, math
said, manifest = json.load(open("said")), json.load(open("paper.json"))
assert said["test_time_s"] == manifest["test_time_s"] == 2580, said["test_time_s"]
assert said["kind"] == manifest["kind"] == "octaves" and manifest["inputs"] == 1 and manifest["settle_s"] == 10
assert [s["periods"] for s in manifest["segments"]] == [1, 2, 4, 8, 16, 32, 64, 123]
assert [s["lines"] for s in said["segments"]] == [1, 2, 4, 8, 16, 32, 64, 123]
for index, segment in enumerate(manifest["segments"]):
    table, = segment["tables"]
    assert table["file"] == f"paper-{index + 1}.mst" and said["segments"][index]["file"] == table["file"]
    bins = table["excited_bins"]
    assert bins == list(range(2 ** index, min(2 ** (index + 1), 251))), bins
    rows = list(csv.DictReader(line for line in open(f"paper-{index + 1}.csv") if not line.startswith("#")))
    torque = [float(row["torque_Nm"]) for row in rows]
    assert len(torque) == 5000
    power = sum(t * t for t in torque) / 5000
    amplitude = math.sqrt(2 * power / len(bins))
    for b in (bins[0], bins[-1]): # flat: every line has its share
        line = sum(t * cmath.exp(-2j * math.pi * b * n / 5000) for n, t in enumerate(torque)) * 2 / 5000
        assert abs(abs(line) / amplitude - 1) < 1e-6, (b, abs(line), amplitude)
    constant = max(abs(t) for t in torque) / amplitude / math.sqrt(len(bins))
    assert 1 - 1e-6 <= constant <= math.sqrt(2) + 1e-6, constant
    assert max(abs(t) for t in torque) <= 1 + 1e-9
PYTHON

# Measured as one: each segment is a run of N_i times as many periods, and the manifest names them.
"$SERVOSCOPE" measure --drive sim:model.json --table belt.json --periods 3 --out run.csv >said
grep -q '^run.csv: 6 of 6 segments of octaves complete' said || fail "$(cat said)"
grep -q 'bus at 1 Mbit/s' said || fail "$(cat said)"
grep -qx '# periods: 12' run-3.csv || fail "periods of the third segment: $(grep periods: run-3.csv)"
grep -qx '# segment: 3 of 6' run-3.csv || fail "the third run does not say which it is"
python3 - <<'PYTHON' || fail "manifest of the runs: $(cat run.csv)"
import json
runs, tables = json.load(open("run.csv")), json.load(open("belt.json"))
assert runs["complete"] is True and "stopped_by" not in runs
assert [s["run"] for s in runs["segments"]] == [f"run-{i}.csv" for i in range(1, 7)]
assert [s["periods"] for s in runs["segments"]] == [3 * s["periods"] for s in tables["segments"]]
assert [s["table_crc32"] for s in runs["segments"]] == [s["tables"][0]["table_crc32"] for s in tables["segments"]]
PYTHON
"$SERVOSCOPE" simulate --model model.json --table belt.json --periods 3 --out direct.csv --json >said
python3 -c '
import json
said = json.load(open("said"))
assert said["ended"] == "complete" and len(said["segments"]) == 6 and said["segments"][2]["periods"] == 12, said
' || fail "--json: $(cat said)"

# The response is that of one multisine of all lines, and has its lines in order.
"$SERVOSCOPE" frf run.csv --out frf.csv >said
grep -q '^run.csv: octaves, 6 of 6 segments, 3 to 57 periods of 500 samples count' said || fail "$(cat said)"
"$SERVOSCOPE" frf direct.csv --out direct-frf.csv --json >said
python3 -c '
import json
said = json.load(open("said"))
assert said["lines"] == 50 and said["periods"] == 3 and said["runs"][0]["segments"] == 6, said
' || fail "--json: $(cat said)"
"$SERVOSCOPE" simulate --model model.json --table single.mst --periods 60 --seed 4 --out single.csv --quiet
"$SERVOSCOPE" frf single.csv --out single-frf.csv --quiet
python3 - <<'PYTHON' || fail "the sequence has another response than the single multisine"
import csv
def read(name):
    return list(csv.DictReader(line for line in open(name) if not line.startswith("#")))
for name in ("frf.csv", "direct-frf.csv"):
    close = 0
    for one, other in zip(read(name), read("single-frf.csv"), strict=True):
        assert one["frequency_hz"] == other["frequency_hz"] and one["valid"] == "1"
        difference = complex(float(one["real"]), float(one["imag"])) - complex(float(other["real"]), float(other["imag"]))
        close += abs(difference) < 3 * (float(one["std"]) ** 2 + float(other["std"]) ** 2) ** 0.5
    assert close >= 45, (name, close) # of 50; few degrees of freedom in the first bands
PYTHON
grep -qx '# degrees_of_freedom: 4' frf.csv || fail "degrees of freedom: $(grep degrees frf.csv)"
grep -qx '# segment_periods: \[3, 6, 12, 24, 48, 57\]' frf.csv || fail "$(grep segment_periods frf.csv)"

# Two sequences of the same tables are more periods of one realisation; a dwell settles for its manifest's 1.2 s, which is three periods, or as told.
"$SERVOSCOPE" frf run.csv direct.csv --out both.csv --quiet
grep -qx '# realisations: 1' both.csv || fail "two sequences of the same tables: $(grep realisations both.csv)"
grep -qx '# runs: 2' both.csv || fail "two sequences of the same tables: $(grep runs both.csv)"
"$SERVOSCOPE" simulate --model model.json --table dwell.json --periods 4 --out dwell-run.csv --quiet
grep -qx '# settle_periods: 3' dwell-run-1.csv || fail "$(grep settle dwell-run-1.csv)"
"$SERVOSCOPE" simulate --model model.json --table dwell.json --periods 4 --settle 2 --out dwell-run.csv --quiet
grep -qx '# settle_periods: 2' dwell-run-4.csv || fail "$(grep settle dwell-run-4.csv)"
"$SERVOSCOPE" frf dwell-run.csv --out dwell-frf.csv --quiet
[ "$(grep -v '^#' dwell-frf.csv | cut -d, -f1 | tr '\n' ' ')" = 'frequency_hz 10 12 14 16 ' ] || fail "$(cat dwell-frf.csv)"

# Ctrl-C: what was measured is kept, the manifest says what is missing, and frf takes what is there.
"$SERVOSCOPE" measure --drive sim:model.json --table belt.json --periods 400 --out cut.csv >said 2>err &
job=$!
until [ -e cut-1.csv ] || ! kill -0 "$job" 2>/dev/null; do sleep 0.02; done
kill -INT "$job"
status=0
wait "$job" || status=$?
[ "$status" -eq 1 ] || fail "status $status after Ctrl-C: $(cat err)"
grep -q 'of 6: stopped early: interrupted by the user' err || fail "$(cat err)"
python3 - <<'PYTHON' || fail "manifest after Ctrl-C: $(cat cut.csv)"
import json
runs = json.load(open("cut.csv"))
assert runs["complete"] is False and "interrupted by the user" in runs["stopped_by"]
assert runs["segments"][0]["periods"] == 400 and runs["segments"][5]["run"] is None
assert runs["segments"][5]["periods"] == 0 and runs["segments"][5]["periods_planned"] == 400 * 19
PYTHON
"$SERVOSCOPE" frf cut.csv --out cut-frf.csv >said || fail "a sequence that was cut short cannot be read"
grep -q 'segments .*6 are missing' said || fail "$(cat said)"
grep -q '^# segments_missing: .*6$' cut-frf.csv || fail "the response does not say what is missing"

# The travel limit holds from where the axis stood at first. A load of 0.04 Nm against 0.1 Nms/rad moves it by 1 rad in the
# 2.5 s of a segment: one alone stays within 2 rad, four after each other do not.
echo '{"structure": "rigid", "motor_inertia_kgm2": 0.005, "viscous_friction_Nms_per_rad": 0.1, "sample_rate_hz": 1000,
 "effects": {"load_bias": {"bias_Nm": 0.04}}}' >drifting.json
drifting=(--drive sim:drifting.json --periods 2 --settle 3 --mode torque --limit-position 2)
"$SERVOSCOPE" measure "${drifting[@]}" --table dwell-4.mst --out alone.csv --quiet || fail "one segment alone drifts too far"
status=0
"$SERVOSCOPE" measure "${drifting[@]}" --table dwell.json --out limited.csv >said 2>err || status=$?
[ "$status" -eq 1 ] || fail "status $status at a limit"
grep -q '^servoscope measure: segment [23] of 4: stopped early: travel limit' err || fail "$(cat err)"
grep -q '"stopped_by": "segment [23] of 4: stopped early: travel limit' limited.csv || fail "$(cat limited.csv)"

# Refusals: nothing is written, nothing is overwritten.
all=(--drive sim:model.json --periods 2)
"$SERVOSCOPE" design --rate 1000 --period 1000 --lines octaves:2:100:2 --inputs 2 "${axis[@]}" --out two --quiet
refuse 1 'plays 2 inputs at once, and this drive has one axis' "${all[@]}" --table two.json --out x.csv
refuse 1 'x-1.csv to x-6.csv' "${all[@]}" --table two.json --out x.csv
refuse 1 'holds: "runs": a manifest that holds "tables" was expected' "${all[@]}" --table run.csv --out x.csv
refuse 2 'belt-1.mst: would be overwritten' "${all[@]}" --table belt.json --out belt.mst
refuse 2 'belt.json: would be overwritten' "${all[@]}" --table belt.json --out belt.json
refuse 2 "--out: '/dev/null' is no ordinary file" "${all[@]}" --table belt.json --out /dev/null
refuse 1 'expected at most the limit of 0.5 Nm' "${all[@]}" --table belt.json --limit-torque 0.5 --out x.csv
mkdir other
cp belt* other
cp other/belt-2.mst other/belt-3.mst
refuse 1 'other/belt-3.mst: table_crc32 is 0x' "${all[@]}" --table other/belt.json --out x.csv
rm other/belt-2.mst
refuse 1 'other/belt-2.mst' "${all[@]}" --table other/belt.json --out x.csv
head -c 900 belt.json >other/belt.json
refuse 1 'other/belt.json:' "${all[@]}" --table other/belt.json --out x.csv
subcommand=frf
refuse 1 'belt.json:2: holds: "tables": a manifest that holds "runs" was expected' belt.json --out x.csv
refuse 2 'each run of the sequence run.csv says its lines itself' run.csv --lines linear:2:10:2 --out x.csv
cp run-2.csv direct-3.csv
refuse 1 'segment 3: direct-3.csv: table_crc32 is 0x' direct.csv --out x.csv
"$SERVOSCOPE" simulate --model model.json --table dwell.json --periods 1 --out once.csv >said
grep -q 'give --periods 2 or more' said || fail "one counted period is not warned of: $(cat said)"
refuse 1 'segment 1: once-1.csv: ' once.csv --out x.csv
subcommand=design
refuse 2 'expected a period of 1000 samples' "${grid[@]}" --lines octaves:2:100:2 --inputs 2 "${axis[@]}" --out x
refuse 1 'nowhere/x.json: cannot be written' "${grid[@]}" --lines octaves:2:100:2 "${axis[@]}" --out nowhere/x

# What can be seen beforehand is refused before anything of an older set is touched.
status=0
rm -f belt-4.csv && mkdir belt-4.csv
"$SERVOSCOPE" design "${grid[@]}" --lines octaves:2:100:2 "${axis[@]}" --out belt >said 2>err || status=$?
[ "$status" -eq 1 ] || fail "a folder was overwritten"
[ -e belt.json ] && [ -e belt-1.mst ] || fail "a refused design took an older one away"
rmdir belt-4.csv

# A design that fails on the way leaves no manifest of an older one, which would name a mixture.
status=0
(
    trap '' XFSZ # a write beyond the limit is an error then, like that of a full disk
    ulimit -f 8
    exec "$SERVOSCOPE" design "${grid[@]}" --lines octaves:2:100:2 "${axis[@]}" --out belt >/dev/null 2>&1
) || status=$?
[ "$status" -ne 0 ] || fail "a design that did not fit was called done"
[ ! -e belt.json ] || fail "a manifest of a mixture was left behind"

[ "$failures" -eq 0 ]
