#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope frf from the command line: the response it writes, several runs, what it refuses.
subcommand=frf
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

echo '{"structure": "rigid", "motor_inertia_kgm2": 0.005, "sample_rate_hz": 1000, "seed": 3}' >model.json
for seed in 1 2 3; do
    "$SERVOSCOPE" design --rate 1000 --period 500 --lines linear:2:100:2 --limit-torque 1 --inertia 0.005 --method random \
        --seed "$seed" --out "table$seed" --quiet
    "$SERVOSCOPE" simulate --model model.json --table "table$seed.mst" --periods 6 --out "run$seed.csv" --quiet
done

# One run: 1/(J w) at 50 Hz within 5 % (lag and filters of the default model), a standard deviation, 50 lines.
"$SERVOSCOPE" frf run1.csv --out frf.csv >said
grep -q '6 of 7 periods of 500 samples count, 1 left out for settling' said || fail "$(cat said)"
python3 - frf.csv <<'PYTHON' || fail "frf.csv is not the response of the model"
import csv, math, sys
rows = list(csv.DictReader(line for line in open(sys.argv[1]) if not line.startswith("#")))
assert len(rows) == 50 and all(row["valid"] == "1" for row in rows)
row = [row for row in rows if float(row["frequency_hz"]) == 50.0][0]
magnitude = math.hypot(float(row["real"]), float(row["imag"]))
assert abs(magnitude * 0.005 * 2 * math.pi * 50 - 1) < 0.05, magnitude
assert 0 < float(row["std"]) < 0.1 * magnitude
PYTHON
grep -qx '# method: mean' frf.csv || fail "no method key"
grep -qx '# degrees_of_freedom: 10' frf.csv || fail "degrees of freedom: $(grep degrees frf.csv)"

# --json is one object; settling by option and by the decay; the other method.
"$SERVOSCOPE" frf run1.csv --settle 2 --method hann --json --out frf.csv >said
python3 -c '
import json
said = json.load(open("said"))
assert said["method"] == "hann" and said["runs"][0]["settle_periods"] == 2 and said["lines_valid"] == 50, said
' || fail "--json: $(cat said)"
"$SERVOSCOPE" frf run1.csv --settle auto --out frf.csv --quiet || fail "--settle auto"
grep -qx '# settle_from: decay of the transient' frf.csv || fail "$(grep settle frf.csv)"

# The local polynomials leave no period out, say which order they took, and the advice is a sentence.
grep -v '^# settle_periods' run1.csv >keyless.csv
"$SERVOSCOPE" frf keyless.csv --method lpm --out frf.csv >said
grep -q '6 of 6 periods of 500 samples count, 0 left out for settling' said || fail "$(cat said)"
grep -q 'polynomials of order .* lines on each side' said || fail "$(cat said)"
grep -q 'method .* suits this recording: it repeats every 500 samples' said || fail "$(cat said)"
grep -qx '# settle_from: nothing: the method models the transient' frf.csv || fail "$(grep settle frf.csv)"
"$SERVOSCOPE" frf run1.csv --method lpm --order 2 --half-width 8 --json --out frf.csv >said
python3 -c '
import json
said = json.load(open("said"))
assert said["lpm_order"] == "2" and said["lpm_half_width"] == "8" and said["degrees_of_freedom"] == 26, said
assert "suits this recording" in said["advice"] and said["suited_method"] in ("mean", "lpm"), said
' || fail "--json of lpm: $(cat said)"

# h1 warns, indirect goes through the reference; both have a coherence. Without a period they use segments.
"$SERVOSCOPE" frf run1.csv --method h1 --json --out frf.csv >said
python3 -c '
import json
said = json.load(open("said"))
assert "biased" in said["warning"] and 0.5 < said["median_coherence"] <= 1, said
' || fail "--json of h1: $(cat said)"
grep -q '^frequency_hz,.*,valid,coherence$' frf.csv || fail "$(grep frequency_hz frf.csv)"
"$SERVOSCOPE" frf run1.csv --method indirect --reference torque_ref_Nm --out frf.csv --quiet
grep -qx '# reference: torque_ref_Nm' frf.csv || fail "$(grep reference frf.csv)"
python3 -c '
import random
random.seed(1)
print("# sample_rate_hz: 1000\ntorque_Nm,velocity_rad_per_s")
speed = 0.0
for n in range(4000):
    torque = random.gauss(0, 1)
    print(f"{torque},{speed + random.gauss(0, .01)}")
    speed = 0.9 * speed + 0.1 * torque
' >random.csv
for method in h1 lpm; do
    "$SERVOSCOPE" frf random.csv --method "$method" --json --out frf.csv >said
    python3 -c '
import json
said = json.load(open("said"))
assert said["runs"][0]["periodic"] is False and said["runs"][0]["rows"] == 4000 and said["lines_valid"] > 100, said
assert said["suited_method"] == "lpm" and said["warning"], said
' || fail "random.csv by $method: $(cat said)"
done
"$SERVOSCOPE" frf random.csv --method h1 --segment 200 --out frf.csv >said
grep -q 'no period; 4000 rows in one piece' said || fail "$(cat said)"
grep -q 'warning: biased if a loop is closed' said || fail "$(cat said)"
[ "$(grep -vc '^#' frf.csv)" -eq 100 ] || fail "--segment 200: $(grep -vc '^#' frf.csv) rows"

# A recording of somebody else: no keys, other names; period and lines are found.
grep -v '^#' run1.csv | sed '1s/torque_Nm/iq/; 1s/velocity_rad_per_s/omega/' >foreign.csv
"$SERVOSCOPE" frf foreign.csv --map 'torque_Nm=iq,velocity_rad_per_s=omega*1' --out frf.csv >said
grep -q 'periods of 500 samples count.*period found by its repetition; lines found by their power' said || fail "$(cat said)"
"$SERVOSCOPE" frf foreign.csv --map 'torque_Nm=iq,velocity_rad_per_s=omega' --period 500 --lines linear:10:20:2 --out frf.csv --quiet
[ "$(grep -vc '^#' frf.csv)" -eq 7 ] || fail "--lines: $(grep -vc '^#' frf.csv) rows"

# Realisations: total and noise standard deviation apart, degrees of freedom of three runs.
"$SERVOSCOPE" frf run1.csv run2.csv run3.csv --out frf.csv --quiet
grep -qx '# realisations: 3' frf.csv || fail "three realisations"
grep -qx '# degrees_of_freedom: 4' frf.csv || fail "degrees of freedom: $(grep degrees frf.csv)"

# A table played twice, other noise: more periods of one realisation, by its key and without; the same recording, refused.
sed 's/"seed": 3/"seed": 4/' model.json >model4.json
"$SERVOSCOPE" simulate --model model4.json --table table1.mst --periods 6 --out again.csv --quiet
sed '/^# table_crc32/d' again.csv >keyless.csv
for again in again keyless; do
    "$SERVOSCOPE" frf run1.csv $again.csv --out frf.csv >said
    grep -qx '# realisations: 1' frf.csv || fail "$again: $(grep realisations frf.csv)"
    grep -qx '# runs: 2' frf.csv || fail "$again: $(grep runs frf.csv)"
    grep -qx '# degrees_of_freedom: 20' frf.csv || fail "$again: $(grep degrees frf.csv)"
    grep -q 'runs 1 and 2 have the same excitation.*2 runs are 1 realisation;' said || fail "$again: $(cat said)"
done
"$SERVOSCOPE" frf run1.csv again.csv run2.csv --out frf.csv >said
grep -qx '# realisations: 2' frf.csv || fail "two of one table: $(grep realisations frf.csv)"
grep -qx '# sample_rate_hz: 1000' frf.csv || fail "several runs: $(grep '^# ' frf.csv)"
grep -qx '# period_samples: 500' frf.csv || fail "several runs: $(grep '^# ' frf.csv)"
rm -f x.csv
refuse 1 'again: their responses differ by 0 of their noise' run1.csv run2.csv run1.csv --out x.csv

# Lost samples: their period does not count, and the summary says so.
awk -F, 'BEGIN{OFS=","} /^#/{print; next} !seen{print $0",valid"; seen=1; next} {n++; print $0",",(n==1600?0:1)}' run1.csv |
    sed 's/,,/,/' >lost.csv
"$SERVOSCOPE" frf lost.csv --out frf.csv >said
grep -q '5 of 7 periods of 500 samples count, 1 left out for settling, 1 for lost samples (the first in row 1600)' said ||
    fail "$(cat said)"

# Refusals
rm -f x.csv
refuse 2 '--out is missing' run1.csv
refuse 2 'RUN.csv' --out x.csv
refuse 2 "method 'nonsense' is not in this build: expected one of mean, hann, lpm, h1, indirect" run1.csv --method nonsense --out x.csv
refuse 1 'does not repeat itself' random.csv --out x.csv
refuse 2 'has no periods to leave out' random.csv --method lpm --settle 1 --out x.csv
refuse 1 'say --reference COLUMN' random.csv --method indirect --out x.csv
refuse 2 "--order: '11'" run1.csv --method lpm --order 11 --out x.csv
refuse 2 "--order: 'some'" run1.csv --method lpm --order some --out x.csv
refuse 1 'needs 5000 lines between the excited ones' run1.csv --method lpm --half-width 2500 --out x.csv
refuse 2 "--settle: 'some', expected a whole number of periods or auto" run1.csv --settle some --out x.csv
refuse 2 "--settle: '1.5'" run1.csv --settle 1.5 --out x.csv
refuse 1 "no column 'force_ref_N' to take as the reference" run1.csv --method indirect --reference force_ref_N --out x.csv
refuse 2 '--reference is for --method lpm, h1, indirect, not mean' run1.csv --reference torque_ref_Nm --out x.csv
refuse 2 '--order is for --method lpm, not hann' run1.csv --method hann --order 2 --out x.csv
refuse 2 '--half-width is for --method lpm, not indirect' run1.csv --method indirect --half-width 5 --out x.csv
refuse 2 '--segment is for --method lpm, h1, indirect, not parametric' run1.csv --method parametric --segment 100 --out x.csv
refuse 2 'run1.csv repeats every 500 samples and is taken period by period' run1.csv --method h1 --segment 100 --out x.csv
refuse 1 "no column 'force_N'" run1.csv --input force_N --out x.csv
refuse 1 'none.csv' none.csv --out x.csv
refuse 1 '1 of 7 periods count (6 left out for settling' run1.csv --settle 6 --out x.csv
refuse 1 'expected at least 2' run1.csv --period 2000 --out x.csv
refuse 1 '): expected --period 500' run1.csv --period 499 --out x.csv
refuse 1 'torque_Nm repeats every 500 samples' foreign.csv --map 'torque_Nm=iq,velocity_rad_per_s=omega' --period 250 --out x.csv
refuse 1 'input and output are both torque_Nm' run1.csv --output torque_Nm --out x.csv
refuse 1 'time_s has no power on any of 50 lines: the strongest, ' run1.csv --input time_s --out x.csv
refuse 2 'is not on the period' run1.csv --lines linear:1:20:1 --out x.csv
sed '/^# periods/d; 700q' run1.csv >short.csv
refuse 1 'short.csv' short.csv --out x.csv
awk -F, 'BEGIN{OFS=","} !/^#/{n++; if (n == 50) $3 = "nan"} {print}' run1.csv >nan.csv
refuse 1 'torque_Nm' nan.csv --out x.csv
"$SERVOSCOPE" design --rate 1000 --period 500 --lines linear:2:98:2 --limit-torque 1 --inertia 0.005 --method newman --out other --quiet
"$SERVOSCOPE" simulate --model model.json --table other.mst --periods 3 --out other.csv --quiet
refuse 1 'run 2 (other.csv) has 49 lines: expected' run1.csv other.csv --out x.csv

# No output takes the place of an input or of the other output; an axis that stands still has no response.
refuse 2 'would be overwritten' run1.csv --out ./run1.csv
refuse 2 'would be overwritten' run1.csv --out x.csv --report x.csv
refuse 1 'nowhere/r.html: cannot be written' run1.csv --out x.csv --report nowhere/r.html
awk -F, 'BEGIN{OFS=","} /^#/{print; next} !column{for(i=1;i<=NF;i++)if($i=="velocity_rad_per_s")column=i; print; next}
    {$column=0.25; print}' run1.csv >still.csv
refuse 1 'still.csv: velocity_rad_per_s does not change' still.csv --out x.csv

# One list of findings in three places: every sentence of --json stands on the screen and on the page.
awk -F, 'BEGIN{OFS=","} /^#/{print; next} !column{for(i=1;i<=NF;i++)if($i=="velocity_rad_per_s")column=i; print; next}
    {$column += 1.5 * sin(2 * 3.14159265 * 37.3 * $1); print}' run1.csv >wandering.csv
"$SERVOSCOPE" frf wandering.csv --method h1 --out said.csv --report said.html >said
"$SERVOSCOPE" frf wandering.csv --method h1 --out said.csv --json >said.json
python3 - <<'PYTHON' || fail "a finding is not in all three places"
import html, json, re
found = json.load(open("said.json"))["findings"]
page = re.sub(r"\s+", " ", html.unescape(re.sub(r"<script>.*?</script>|<[^>]*>", " ", open("said.html").read(), flags=re.S)))
screen = open("said").read()
assert {one["id"] for one in found} >= {"periods", "settling", "method", "response", "uncertainty", "coherence", "bias",
                                        "oscillation", "setup"}, found
for one in found:
    assert one["says"] in screen, one
    assert re.sub(r"\s+", " ", one["says"]) in page, one
    assert one["file"] in page, one
oscillation = [one for one in found if one["id"] == "oscillation"][0]
assert oscillation["level"] == "warning" and abs(float(re.search(r"([\d.]+) Hz", oscillation["says"]).group(1)) - 37.3) < 0.1
settled = [one["says"] for one in found if one["id"] == "method"][0]
assert "it is settled" not in settled, settled
PYTHON

# A page is one file that loads nothing; measured lines are not joined, and those of a model are shown beside it.
"$SERVOSCOPE" frf run1.csv --method parametric --delay 0.0002 --out model.csv --report model.html --quiet
python3 - <<'PYTHON' || fail "the pages are not what they should be"
import re
for name in ("said.html", "model.html"):
    page = open(name).read()
    assert len(page) < 500000 and not re.search(r"(src|href)=|@import|url\(", page), name
page = open("model.html").read()
figure = page[page.index("<svg xmlns"):page.index("</figure>")]
lines = re.findall(r'<path class="ln [^"]*" data-n="([^"]*)"', figure)
points = re.findall(r'<path class="pt [^"]*" data-n="([^"]*)"', figure)
assert len(lines) == 2 and lines[0].startswith("model, order"), lines # magnitude and phase, of the model only
assert "measured" in points and not any(name == "measured" for name in lines), points
assert "delay of 0.2 ms has been taken out of the response" in page and "pole" in page
assert "residual over 2 std: measured less model" in figure
PYTHON

# Foreign columns are taken by their units, and what was taken is said; what nobody can tell apart is asked for by name.
sed 's/^time_s,/t_s,/; s/,torque_Nm,/,iq_meas_A,/; s/torque_ref_Nm/iq_ref_A/; s/velocity_rad_per_s/speed_rad_s/; s/position_rad/angle_rad/' \
    run1.csv | sed '/^#/!s/velocity_ref_rad_per_s/speed_set_rad_s/' >units.csv
"$SERVOSCOPE" frf units.csv --out named.csv >said
grep -q 'current_A to velocity_rad_per_s' said || fail "$(cat said)"
grep -q 'columns were named by the units in their names: --map current_A=iq_meas_A,' said || fail "$(cat said)"
grep -q '^# columns_named: current_A=iq_meas_A,' named.csv || fail "$(head -20 named.csv)"
sed '/^#/!s/^t_s,iq_ref_A,iq_meas_A,/t_s,iu_A,iv_A,/' units.csv >phases.csv
refuse 1 'phases.csv: no input column among: t_s, iu_A, iv_A, ' phases.csv --out x.csv
refuse 1 "no column 'nonsense' to take as the output, only: time_s, torque_ref_Nm, " run1.csv --output nonsense --out x.csv

# Files that are none.
mkdir folder
: >empty.csv
gzip -c run1.csv >whole.csv.gz
head -c 9000 whole.csv.gz >cut.csv.gz
{ head -c 4000 whole.csv.gz; head -c 300 /dev/zero; tail -c 4000 whole.csv.gz; } >damaged.csv.gz
refuse 1 'folder: is a folder: a file was expected' folder --out x.csv
refuse 1 'empty.csv: the file is empty' empty.csv --out x.csv
refuse 1 'cut.csv.gz:' cut.csv.gz --out x.csv
refuse 1 'damaged.csv.gz:' damaged.csv.gz --out x.csv
refuse 1 'nothere.csv: cannot be read: No such file' nothere.csv --out x.csv
refuse 1 'folder: is a folder, a file name was expected' run1.csv --out x.csv --report folder
refuse 1 '/dev/full: cannot be written: No space left on device' run1.csv --out x.csv --report /dev/full

[ "$failures" -eq 0 ]
