#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope measure from the command line, through CAN frames on the bus inside the program: the run it writes, limits,
# Ctrl-C, what it refuses and what is left on the disk then.
subcommand=measure
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

"$SERVOSCOPE" design --rate 1000 --period 500 --lines linear:2:100:2 --limit-torque 1 --inertia 0.005 --method newman \
    --out table --quiet
echo '{"structure": "rigid", "motor_inertia_kgm2": 0.005, "sample_rate_hz": 1000, "seed": 3}' >model.json
all=(--drive sim:model.json --table table.mst --periods 3)

# The rows and keys of a run, and what the bus carried; twice the same bytes.
"$SERVOSCOPE" measure "${all[@]}" --out a.csv >said
grep -q '^a.csv: 1 settling and 3 counted periods of 500 samples at 1000 Hz, 2000 of 2000 rows, 0 lost' said || fail "$(cat said)"
grep -q 'bus at 1 Mbit/s, load [4-6][0-9] %' said || fail "$(cat said)"
[ "$(grep -vc '^#' a.csv)" -eq 2001 ] || fail "rows of a.csv: $(grep -vc '^#' a.csv)"
for key in 'periods: 3' 'settle_periods: 1' 'mode: cascade' 'drive: sim:model.json' 'samples_lost: 0'; do
    grep -qx "# $key" a.csv || fail "no key '$key'"
done
"$SERVOSCOPE" measure "${all[@]}" --out b.csv --quiet >said
[ ! -s said ] || fail "--quiet says something"
cmp a.csv b.csv || fail "the same drive gives another run"
"$SERVOSCOPE" measure "${all[@]}" --out b.csv --json >said
python3 -c '
import json
said = json.load(open("said"))
assert said["ended"] == "complete" and said["rows"] == 2000 and said["samples_lost"] == 0, said
assert 0.3 < said["bus"]["load"] < 0.7 and said["bus"]["bitrate"] == 1000000, said
' || fail "--json: $(cat said)"

# The response seen through the bus is that of the same model without it, within three standard deviations on nine lines
# in ten: the bus quantises torque and velocity, it must not bend anything.
"$SERVOSCOPE" simulate --model model.json --table table.mst --periods 3 --out direct.csv --quiet
"$SERVOSCOPE" frf a.csv --out a-frf.csv --quiet
"$SERVOSCOPE" frf direct.csv --out direct-frf.csv --quiet
python3 - <<'PYTHON' || fail "the bus changes the response"
import csv
def read(name):
    return [row for row in csv.DictReader(line for line in open(name) if not line.startswith("#"))]
close = 0
for bus, direct in zip(read("a-frf.csv"), read("direct-frf.csv"), strict=True):
    difference = complex(float(bus["real"]), float(bus["imag"])) - complex(float(direct["real"]), float(direct["imag"]))
    close += abs(difference) < 3 * (float(bus["std"]) ** 2 + float(direct["std"]) ** 2) ** 0.5
assert close >= 45, close
PYTHON

# Limits: status 1, but what was measured is kept and says why it ends.
status=0
"$SERVOSCOPE" measure "${all[@]}" --mode torque --limit-position 0.02 --out limited.csv >said 2>err || status=$?
[ "$status" -eq 1 ] || fail "status $status at a limit"
grep -q '^servoscope measure: stopped early: travel limit: position ' err || fail "$(cat err)"
if [ -e limited.csv ]; then
    grep -q '^# stopped_by: travel limit' limited.csv || fail "no stopped_by in the file"
fi

# Ctrl-C: a long run is cut short, kept, marked, readable. Cut while it still fades in, there is nothing to keep: then later.
for delay in 0.1 0.4 1.6 6.4; do
    "$SERVOSCOPE" measure --drive sim:model.json --table table.mst --periods 5000 --settle 0 --out cut.csv >said 2>err &
    job=$!
    until grep -q '^SigCgt:.*[2367abef]$' "/proc/$job/status"; do sleep 0.02; done # it catches SIGINT: it measures
    sleep "$delay"
    kill -INT "$job"
    status=0
    wait "$job" || status=$?
    [ "$status" -eq 1 ] || fail "status $status after Ctrl-C: $(cat err)"
    grep -q 'interrupted by the user' err || fail "$(cat err)"
    [ ! -e cut.csv ] || break
done
grep -qx '# interrupted: true' cut.csv || fail "an interrupted run is not marked"
[ "$(grep -vc '^#' cut.csv)" -lt 2500000 ] || fail "an interrupted run is complete"
"$SERVOSCOPE" frf cut.csv --settle 0 --out cut-frf.csv --quiet || fail "an interrupted run cannot be read"

# The live view on a terminal: it stands there while it measures and leaves nothing but the summary behind, however it ends.
live=("$SERVOSCOPE" measure --drive sim:model.json --table table.mst --limit-torque 3 --periods 20000 --out live.csv)
for how in shown dumb narrow; do
    python3 "$SERVOSCOPE_SOURCE/tests/cli/measure_live.py" "$how" -- "${live[@]}" >screen || fail "$how: $(cat screen)"
    grep -q 'interrupted by the user' screen || fail "$how: $(cat screen)"
    ! grep -qE 'samples/s,|peak|Hz  ' screen || fail "$how: the view is left on the screen: $(cat screen)"
done
for option in --quiet --json; do
    python3 "$SERVOSCOPE_SOURCE/tests/cli/measure_live.py" absent -- "${live[@]}" "$option" >screen || fail "$option: $(cat screen)"
done
"${live[@]}" >said 2>err &
job=$!
sleep 2.5
kill -INT "$job"
wait "$job" || true
[ "$(wc -l <err)" -eq 1 ] || fail "not quiet when piped: $(cat err)"

# The page: every number from the run, whatever ended it; a sequence has one page for all.
"$SERVOSCOPE" measure "${all[@]}" --limit-torque 2 --out paged.csv --report paged.html --quiet
"$SERVOSCOPE" measure "${all[@]}" --mode torque --limit-position 0.005 --out limited.csv --report limited.html --quiet 2>err || true
python3 - <<'PYTHON' || fail "the page is not the run's"
import csv, html, re
def words(name):
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", re.sub(r"(?s)<(style|script|svg).*?</\1>", "", open(name).read()))).split())
rows = list(csv.DictReader(line for line in open("paged.csv") if not line.startswith("#")))
peak = max(abs(float(row["torque_Nm"])) for row in rows)
page = words("paged.html")
table = re.search(r"torque ([\d.]+) ([\d.]+) 2 ([\d.]+) % ", page)
assert table, page
assert abs(float(table[2]) - peak) < 1e-3 * peak and abs(float(table[3]) - 50 * peak) < 0.1, (table[0], peak)
for expected in ("1 settling and 3 counted periods of 500 samples", "0 of 2000 samples were lost", "Amplitudes at the 50 excited lines"):
    assert expected in page, (expected, page)
page = words("limited.html")
assert "Stopped early" in page and "travel limit" in page, page
PYTHON
"$SERVOSCOPE" design --rate 1000 --period 500 --lines octaves:2:100:2 --limit-torque 1 --inertia 0.005 --out sequence --quiet
"$SERVOSCOPE" measure --drive sim:model.json --table sequence.json --periods 2 --out segments.csv --report segments.html --quiet
grep -q 'Single periods and the settling within a segment are not shown' segments.html || fail "the page of a sequence"

# Refusals
refuse 2 '--drive is missing' --table table.mst --periods 3 --out x.csv
refuse 2 "'nonsense' is no drive that this program can reach; expected sim:MODEL.json" --drive nonsense --table table.mst \
    --periods 3 --out x.csv
refuse 1 'nosuch: ' --drive can:nosuch --table table.mst --periods 3 --out x.csv
refuse 1 'slcan:' --drive slcan:127.0.0.1:1 --table table.mst --periods 3 --out x.csv
refuse 1 'nosuch' --drive slcan:/nosuch --table table.mst --periods 3 --out x.csv
for query in node=0 node=128 node= 'node=5&bitrate=1' speed=3 profile=nosuch; do
    refuse 2 '--drive' --drive "can:can0?$query" --table table.mst --periods 3 --out x.csv
done
refuse 2 '--limit-position is missing' "${all[@]}" --mode torque --out x.csv
refuse 2 "--mode: 'velocity', expected cascade or torque" "${all[@]}" --mode velocity --out x.csv
refuse 1 'none.mst' --drive sim:model.json --table none.mst --periods 3 --out x.csv
refuse 1 'none.json' --drive sim:none.json --table table.mst --periods 3 --out x.csv
refuse 1 'nowhere/x.csv: cannot be written' "${all[@]}" --out nowhere/x.csv
refuse 1 'expected at most the limit of 0.5 Nm' "${all[@]}" --limit-torque 0.5 --out x.csv
echo '{"structure": "rigid", "mass_kg": 5, "sample_rate_hz": 1000}' >linear.json
refuse 1 'expected one kind' --drive sim:linear.json --table table.mst --periods 3 --out x.csv
refuse 1 'nowhere/x.html: cannot be written' "${all[@]}" --out x.csv --report nowhere/x.html
refuse 2 'would be overwritten' "${all[@]}" --out x.csv --report table.mst
refuse 2 '--report: a drive on Modbus' --drive modbus-tcp:127.0.0.1:1 --table table.mst --periods 3 --out x.csv --report x.html
for input in model.json ./table.mst; do
    sum=$(cksum <"$input")
    refuse 2 "$input: would be overwritten" "${all[@]}" --out "$input"
    [ "$(cksum <"$input")" = "$sum" ] || fail "$input was overwritten"
done

[ "$failures" -eq 0 ]
