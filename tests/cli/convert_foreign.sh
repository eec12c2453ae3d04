#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope convert on text of other programs: TwinCAT Scope exports and tables with other separators, decimal marks and units.
subcommand=convert
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

# An export as the Scope writes it: a head, properties, groups of channels each behind its own column of times in ms.
cat >scope.py <<'PYTHON'
import math, sys
separator, mark, path = {"tab": "\t", "semicolon": ";"}[sys.argv[1]], sys.argv[2], sys.argv[3]
number = lambda x: repr(round(x, 9)).replace(".", mark)
row = lambda *cells: separator.join(cells)
lines = [row("Name", "scope"), row("File", "x.csv"), row("Starttime of export", "132959733843760000", "Montag, 2. Mai 2022"),
         row("Endtime of export", "132959733853750000"), "", "",
         row("Name", "fast", "Name", "iq", "angle", "speed", "Name", "slow"),
         row("SymbolComment", "", "SymbolComment", "", "", "", "SymbolComment", ""),
         row("SampleTime[ms]", number(.5), "SampleTime[ms]", "1", "1", "1", "SampleTime[ms]", "5"),
         row("Unit", "V (Voltage)", "Unit", "Nm (Torque)", "\u00b0 (Angle)", "(None)", "Unit", "(None)"), ""]
for k in range(3000):
    cells = [number(.5 * k), number(2. * k)]
    cells += [number(1. * k), number(math.sin(.05 * k)), number(90 * math.sin(.01 * k)), number(math.cos(.01 * k))] if k < 1500 else [""] * 4
    cells += [number(5. * k - 3), number(k)] if k < 300 else [""] * 2
    lines.append(row(*cells))
open(path, "w", newline="").write("\r\n".join(lines + ["EOF"]) + "\r\n")
PYTHON
for kind in "tab ," "semicolon ." "semicolon ,"; do
    read -r separator mark <<<"$kind"
    python3 scope.py "$separator" "$mark" scope.csv
    "$SERVOSCOPE" convert scope.csv run.csv >said || fail "$kind: status $?"
    grep -q 'assumed: sample time 1 ms, that of most channels' said || fail "$kind: $(cat said)"
    grep -q 'assumed: position_rad is angle \[deg\] times 0.0174533' said || fail "$kind: $(cat said)"
    grep -q 'lost: fast \[V\]: of 2 values in 1 ms only the first is kept' said || fail "$kind: $(cat said)"
    grep -q 'lost: slow: sampled every 5 ms' said || fail "$kind: $(cat said)"
    python3 - <<'PYTHON' || fail "$kind: numbers"
import csv, math
rows = list(csv.DictReader(line for line in open("run.csv") if not line.startswith("#")))
assert len(rows) == 1500, len(rows)
for k, row in enumerate(rows):
    for name, expected in {"time_s": k / 1000, "torque_Nm": math.sin(.05 * k), "position_rad": math.pi / 2 * math.sin(.01 * k),
                           "speed": math.cos(.01 * k), "voltage_V": 4. * k}.items():
        assert abs(float(row[name]) - expected) < 1e-8, (k, name, row[name], expected)  # nine digits were written
PYTHON
done

# A map names channels without their units; the unit in the header counts, unless the map gives a factor.
"$SERVOSCOPE" convert scope.csv mapped.csv --map torque_Nm=iq,position_rad=angle,velocity_rad_per_s=speed*2 >said
grep -q 'assumed: position_rad: angle \[deg\], its unit by the file, times 0.0174533' said || fail "$(cat said)"
grep -q 'assumed: velocity_rad_per_s: the file gives speed no unit; its values times 2' said || fail "$(cat said)"
"$SERVOSCOPE" convert scope.csv mapped.csv --map torque_Nm=iq*0.5 >said
grep -q 'assumed: torque_Nm: iq \[Nm\] times 0.5 as --map says, not what its unit would give' said || fail "$(cat said)"
"$SERVOSCOPE" convert scope.csv fast.csv --rate 2000 >said
grep -q 'run, 3000 samples' said || fail "$(cat said)"
"$SERVOSCOPE" convert scope.csv slow.csv --rate 200 >said # the slow channel's times are 2 ms behind the others'
grep -q 'run, 299 samples' said || fail "$(cat said)"
grep -v '^#' slow.csv | sed -n 2p | grep -q '^0.002,.*,1$' || fail "slow.csv: $(head -5 slow.csv)"
refuse 1 "no channel has values at that sample time" scope.csv x.csv --rate 300
refuse 1 "there" scope.csv x.csv --map torque_Nm=nothing
sed '20s/;[^;]*$/;abc/' scope.csv >bad.csv
refuse 1 "bad.csv:20: cell 8: 'abc' is not a number" bad.csv x.csv
sed '21,24d' scope.csv >bad.csv
refuse 1 "bad.csv:21: time_s: 0.013 follows 0.008: 4 samples are missing" bad.csv x.csv
awk -F';' -v OFS=';' 'NR == 500 { $5 = "" } 1' scope.csv >hole.csv
"$SERVOSCOPE" convert hole.csv mapped.csv >said || fail "hole.csv: status $?"
grep -q 'run, 1500 samples' said || fail "hole.csv: $(cat said)"
grep -q 'kept: 1 row with an empty cell, the first is row 489 at 0.488 s (angle \[deg\]): marked as lost with valid 0' said || fail "$(cat said)"
grep -v '^#' mapped.csv | awk -F, 'NR == 1 { for (c = 1; c <= NF; c++) valid = $c == "valid" ? c : valid }
    NR > 1 && $valid != 1 { print NR - 2; lost++ } END { exit lost != 1 }' >lost || fail "hole.csv: lost rows $(cat lost)"
[ "$(cat lost)" = 488 ] || fail "hole.csv: row $(cat lost) is lost"
# A channel that ends early ends the others, and that is said.
awk -F';' -v OFS=';' 'NR >= 1000 && NR < 1512 { $5 = "" } 1' scope.csv >short.csv
"$SERVOSCOPE" convert short.csv mapped.csv >said || fail "short.csv: status $?"
grep -q 'lost: angle \[deg\]: ends after 988 values, others after 1500: only so many are kept' said || fail "$(cat said)"
sed '11,$d' scope.csv >bad.csv
refuse 1 "expected a row of names that begins with 'Name', a blank line, values" bad.csv x.csv

# Tables with a preamble, semicolons, decimal commas and a row of units; tabs and units in the names.
{
    printf 'Made by somebody\nDate;1.2.2026\n\nZeit;Ist Moment;Position;Drehzahl\nms;Nm;mm;U/min\n'
    for k in {0..99}; do echo "$k;$k,5;1,25;-3,$k"; done
} >table.csv
"$SERVOSCOPE" convert table.csv run.csv >said || fail "table.csv: status $?"
grep -q 'cells between semicolons, decimal comma, names in line 4, units behind it, values from line 6' said || fail "$(cat said)"
grep -q 'time_s is Zeit in ms' said || fail "$(cat said)"
grep -q 'velocity_rad_per_s is Drehzahl \[rpm\] times 0.10472' said || fail "$(cat said)"
[ "$(sed -n 's/^0.002,//p' run.csv | cut -d, -f1)" = 2.5 ] || fail "$(head -5 run.csv)"
sed '20,22d' table.csv >bad.csv
refuse 1 "bad.csv:20: time_s: 0.017 follows 0.013: 3 samples are missing" bad.csv x.csv
# Names in camel case, as the Scope's are: the set-point is not the measured one.
printf 'Time [ms];SetPos [deg];ActPos [deg];IqCmd [A];Axis1.ActTorque [A]\n0;0;1;2;3\n1;0;1;2;3\n2;0;1;2;3\n' >camel.csv
"$SERVOSCOPE" convert camel.csv mapped.csv >said || fail "camel.csv: status $?"
[ "$(sed -n 2p mapped.csv)" = time_s,position_ref_rad,position_rad,current_ref_A,current_A ] || fail "camel.csv: $(cat said)"
# A unit behind the name counts as one in brackets does.
printf 't_s;pos_deg\n0;0\n0,001;1\n0,002;2\n' >suffix.csv
"$SERVOSCOPE" convert suffix.csv mapped.csv --map position_rad=pos_deg >said || fail "suffix.csv: status $?"
grep -q 'assumed: position_rad: pos_deg, its unit by the file, times 0.0174533' said || fail "$(cat said)"
{
    printf '# by hand\ntime\ttorque (Nm)\tangle_deg\n'
    for k in {0..99}; do printf '%d.5\t%d.25\t-1e-%d\n' "$k" "$k" $((k % 5)); done
} >table.txt
"$SERVOSCOPE" convert table.txt run.csv >said || fail "table.txt: status $?"
grep -q 'time_s is time in seconds: the file gives no unit' said || fail "$(cat said)"
grep -q 'torque_Nm is torque \[Nm\] times 1' said || fail "$(cat said)"
gzip -k table.txt
"$SERVOSCOPE" convert table.txt.gz again.csv --quiet && cmp run.csv again.csv || fail "gzipped"
sed '50s/;1,25;/;/' table.csv >bad.csv
refuse 1 "bad.csv:50: 3 cells, expected 4" bad.csv x.csv
sed '50s/1,25/1,2,5/' table.csv >bad.csv
refuse 1 "bad.csv:50: cell 3: '1,2,5' is not a number" bad.csv x.csv
printf 'a;b\nc;d\n' >bad.csv
refuse 1 "no row of numbers was found" bad.csv x.csv
refuse 2 "expected csv, gnuplot" table.csv x.csv --to twincat

# What reads recordings itself says where to go.
"$SERVOSCOPE" frf table.txt --out x.csv 2>err && fail "frf reads tabs"
grep -q "'servoscope convert' makes such a file of it" err || fail "$(cat err)"
# A unit in a mapped column's name is honoured here, and said; what reads the recording itself asks for it. A factor, 1 too, answers.
printf 'Time_ms,Iq_A,Angle_deg\n0,1,2\n1,2,3\n2,3,4\n' >deg.csv
"$SERVOSCOPE" convert deg.csv good.csv --map time_s=Time_ms,position_rad=Angle_deg >said || fail "deg.csv: status $?"
grep -q 'assumed: time_s: Time_ms, its unit by the file, times 0.001' said || fail "$(cat said)"
grep -q 'assumed: position_rad: Angle_deg, its unit by the file, times 0.0174533' said || fail "$(cat said)"
"$SERVOSCOPE" convert deg.csv good.csv --map time_s=Time_ms*0.001,position_rad=Angle_deg*1 --quiet || fail "a factor of 1"
[ "$(tail -1 good.csv)" = 0.002,3,4 ] || fail "a factor of 1: $(tail -1 good.csv)"
subcommand=frf
refuse 1 "deg.csv:1: --map: position_rad=Angle_deg: the column's name says another unit; expected position_rad=Angle_deg*0.0174532925" \
    deg.csv --out x.csv --rate 1000 --map position_rad=Angle_deg
refuse 1 "time_s=Time_ms*0.001" deg.csv --out x.csv --map time_s=Time_ms
[ "$failures" -eq 0 ]
