#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope convert from the command line: there and back in every format, what it says, what it refuses, that nothing is left behind.
subcommand=convert
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

echo '{"structure": "rigid", "motor_inertia_kgm2": 0.005, "sample_rate_hz": 3000, "seed": 3}' >model.json
"$SERVOSCOPE" design --rate 3000 --period 600 --lines quasilog:5:300:1.1 --limit-torque 1 --inertia 0.005 --method newman \
    --out table --quiet
"$SERVOSCOPE" simulate --model model.json --table table.mst --periods 3 --out run.csv --quiet
"$SERVOSCOPE" frf run.csv --out frf.csv --quiet

formats="uff uff58b"
if "$SERVOSCOPE" convert run.csv try.mat --quiet 2>err; then
    formats="$formats mat mat73"
else
    grep -q 'built without matio' err || fail "$(cat err)"
    grep -q 'install libmatio-dev' err || fail "$(cat err)"
    [ ! -e try.mat ] || fail "left behind try.mat"
    echo "skipped: MATLAB files (built without matio)"
fi

# There and back: byte for byte, but for the universal file in text, whose fields have 13 digits.
for format in $formats; do
    for kind in run frf; do
        "$SERVOSCOPE" convert "$kind.csv" "$kind.$format" --to "$format" --quiet || fail "$kind to $format"
        "$SERVOSCOPE" convert "$kind.$format" "$kind-$format.csv" --quiet || fail "$kind from $format"
        [ "$format" = uff ] || cmp "$kind.csv" "$kind-$format.csv" || fail "$kind through $format"
    done
done
for kind in run frf; do
    grep '^#' "$kind.csv" >keys
    grep '^#' "$kind-uff.csv" | cmp - keys || fail "keys of $kind through uff"
    python3 - "$kind" <<'PYTHON' || fail "numbers of $kind through uff"
import csv, sys
def read(path):
    return list(csv.DictReader(line for line in open(path) if not line.startswith("#")))
a, b = read(sys.argv[1] + ".csv"), read(sys.argv[1] + "-uff.csv")
assert len(a) == len(b) and a[0].keys() == b[0].keys()
for one, other in zip(a, b):
    for name in one:
        assert (one[name] == "") == (other[name] == ""), name
        if one[name]:
            x, y = float(one[name]), float(other[name])
            assert abs(x - y) <= 5.1e-13 * abs(x), (name, x, y)  # half a unit of the 13th digit
PYTHON
done

# From each format to each other: what holds all bits gives back the file that it came from.
for one in csv $formats; do
    for other in csv $formats; do
        for kind in run frf; do
            source=$kind.$one
            "$SERVOSCOPE" convert "$source" "pair.$other" --to "$other" --quiet || fail "$kind from $one to $other"
            "$SERVOSCOPE" convert "pair.$other" pair-back.csv --quiet || fail "$kind back from $other, that came from $one"
            reference=$kind.csv
            [ "$one" != uff ] && [ "$other" != uff ] || reference=$kind-uff.csv
            cmp "$reference" pair-back.csv || fail "$kind from $one through $other"
        done
    done
done

# A gzipped file is read as it is; the result through any format does for frf what the run itself did.
gzip -k run.csv
gzip -k run.uff
"$SERVOSCOPE" convert run.csv.gz a.csv --quiet
cmp run.csv a.csv || fail "gzipped CSV"
"$SERVOSCOPE" convert run.uff.gz a.csv --quiet
cmp run-uff.csv a.csv || fail "gzipped universal file"
"$SERVOSCOPE" frf run-uff58b.csv --out again.csv --quiet
cmp frf.csv again.csv || fail "frf of a run that went through uff58b"

# What is said; what is quiet; the ending in capitals; to standard output.
"$SERVOSCOPE" convert run.csv RUN.UNV >said
grep -qx 'run.csv -> RUN.UNV (csv to uff): run, 2400 samples of 7 columns at 3000 Hz' said || fail "$(cat said)"
grep -q '^  kept: keys in the identification lines' said || fail "$(cat said)"
grep -q '^  lost: digits beyond the 13th' said || fail "$(cat said)"
"$SERVOSCOPE" convert run.csv RUN.UNV --quiet >said
[ ! -s said ] || fail "--quiet says something"
"$SERVOSCOPE" convert frf.csv frf.unv --json >said
python3 -c '
import json
said = json.load(open("said"))
assert said["kind"] == "frf" and said["in_format"] == "csv" and said["out_format"] == "uff", said
assert said["input"] == "torque_Nm" and said["lines"] > 20 and said["lost"] and said["kept"] and said["assumed"] == [], said
' || fail "--json: $(cat said)"
"$SERVOSCOPE" convert run.uff58b /dev/stdout --to csv | cmp - run.csv || fail "to standard output"

# --out, as elsewhere.
"$SERVOSCOPE" convert run.csv --out b.csv --quiet && cmp run.csv b.csv || fail "convert IN --out OUT"
refuse 2 "OUT is given twice: 'x.csv' and --out 'b.csv'" run.csv x.csv --out b.csv

# A recording of others, in text.
awk -F, 'BEGIN {print "t,I_q,pos"} !/^#/ && !/^t/ {print $1 "," $3 * 2 "," $4}' run.csv >foreign.csv
"$SERVOSCOPE" convert foreign.csv mapped.csv --map time_s=t,torque_Nm=I_q*0.5,position_rad=pos >said
grep -q 'assumed: sample rate 3000 Hz, from the mean time step' said || fail "$(cat said)"
grep -qx 'time_s,torque_Nm,position_rad' mapped.csv || fail "names of mapped.csv"
"$SERVOSCOPE" convert foreign.csv mapped.unv --rate 2999 --map torque_Nm=I_q*0.5 >said
grep -q 'assumed: sample rate 2999 Hz, by --rate' said || fail "$(cat said)"

# Refusals; none of them leaves anything.
refuse 2 'IN OUT is missing' run.csv
refuse 2 "its ending names no format: expected --to csv, gnuplot, mat, mat73, uff or uff58b" run.csv x.dat
refuse 2 "--to: 'xls', expected csv, gnuplot, mat" run.csv x.csv --to xls
refuse 1 'none.csv: cannot be read' none.csv x.csv
refuse 1 'model.json: holds neither a run nor a frequency response' model.json x.csv
refuse 1 'table.mst: holds neither' table.mst x.csv
refuse 2 'would be overwritten' run.csv ./run.csv
refuse 1 'nowhere/x.csv: cannot be written' run.csv nowhere/x.csv
refuse 2 '--map is for runs' frf.csv x.csv --map torque_Nm=a
refuse 2 '--rate is for runs' frf.csv x.csv --rate 1000
refuse 2 "--rate: '0'" run.csv x.csv --rate 0
refuse 1 "there is no column 'I'" foreign.csv x.csv --map torque_Nm=I
refuse 2 'holds no frequency response for --function' run.uff x.csv --function 1
head -c 20000 run.uff >cut.uff
refuse 1 'cut.uff:' cut.uff x.csv
: >empty.csv
refuse 1 'empty.csv: is empty' empty.csv x.csv
for old in x.uff x.mat; do
    echo old >"$old"
    status=0
    "$SERVOSCOPE" convert cut.uff "$old" 2>err || status=$?
    [ "$status" -eq 1 ] || fail "status $status"
    [ "$(cat "$old")" = old ] || fail "$old was touched"
done
[ -z "$(find . -name '*.tmp-*')" ] || fail "temporary files are left: $(ls)"

[ "$failures" -eq 0 ]
