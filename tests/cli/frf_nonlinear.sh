#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope frf: distortion from free bins, a response of twice the period, realisations, harmonics of a dwell, the load's
# side, several inputs, hold and delay, and what of these is refused. The recordings are made here, with known numbers.
subcommand=frf
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

cat >make.py <<'PYTHON'
import json, math, random

N, RATE = 400, 1000

def write(name, columns, bins=None, keys=()):
    rows = len(columns[0][1])
    with open(name, "w") as file:
        file.write(f"# sample_rate_hz: {RATE}\n# period_samples: {N}\n")
        for key in keys:
            file.write(f"# {key}\n")
        if bins:
            file.write(f"# excited_bins: {bins}\n")
        file.write(",".join(["time_s"] + [column for column, _ in columns]) + "\n")
        for n in range(rows):
            file.write(",".join([repr(n / RATE)] + [repr(values[n]) for _, values in columns]) + "\n")

def multisine(bins, draw, amplitude=1.0):
    phases = [2 * math.pi * draw.random() for _ in bins]
    return [amplitude * sum(math.cos(2 * math.pi * (b * n % N) / N + p) for b, p in zip(bins, phases)) for n in range(N)]

draw = random.Random(5)
odd = [b for b in range(1, 100, 2) if b % 8 != 5]
gauss = lambda size: draw.gauss(0, size)

# Realisations of a static polynomial, and of a linear drive; noise on the velocity.
for r in (1, 2, 3):
    u = multisine(odd, random.Random(r))
    rows = [u[n % N] for n in range(6 * N)]
    write(f"curved{r}.csv", [("torque_Nm", rows), ("velocity_rad_per_s",
          [3 * x + 0.003 * x ** 2 + 0.0006 * x ** 3 + gauss(0.02) for x in rows])], odd)
    write(f"straight{r}.csv", [("torque_Nm", rows), ("velocity_rad_per_s", [3 * x + gauss(0.02) for x in rows])], odd)

# A response of twice the period; the same as the second of three segments.
u = multisine(odd, draw)
rows = [u[n % N] for n in range(8 * N)]
late = [3 * x + 0.3 * math.cos(math.pi * 41 * n / N) + gauss(0.01) for n, x in enumerate(rows)]
write("late.csv", [("torque_Nm", rows), ("velocity_rad_per_s", late)], odd)

# A dwell with known harmonics, as a sequence of runs.
segments = []
for index, (line, third) in enumerate(((4, 0.1), (7, 0.01), (9, 0.0))):
    angle = [2 * math.pi * (line * n % N) / N for n in range(4 * N)]
    write(f"dwell-{index + 1}.csv", [("torque_Nm", [math.cos(a) for a in angle]), ("velocity_rad_per_s",
          [2 * math.sin(a) + 2 * third * math.cos(3 * a) + gauss(1e-4) for a in angle])], [line])
    segments.append({"table": f"t-{index + 1}.mst", "table_crc32": "0x1", "run": f"dwell-{index + 1}.csv", "periods": 4,
                     "periods_planned": 4})
json.dump({"holds": "runs", "kind": "dwell", "segments": segments}, open("dwell.csv", "w"))

# Motor and load: the load's angle is the motor's, integrated, at half the size, and drifts.
phases = random.Random(9)
terms = [(b, 2 * math.pi * phases.random()) for b in odd]
wave = lambda n, scale, shift: sum(scale(2 * math.pi * b * RATE / N) * math.cos(2 * math.pi * (b * n % N) / N + p + shift)
                                   for b, p in terms)
period = [(wave(n, lambda w: 1, 0), wave(n, lambda w: 5 / w, -math.pi / 2)) for n in range(N)]
write("belt.csv", [("torque_ref_Nm", [period[n % N][0] for n in range(5 * N)]),
                   ("torque_Nm", [period[n % N][0] for n in range(5 * N)]),
                   ("velocity_rad_per_s", [2 * period[n % N][0] + gauss(1e-3) for n in range(5 * N)]),
                   ("load_position_rad", [period[n % N][1] + 1e-3 * n + gauss(1e-6) for n in range(5 * N)])], odd)

# Two inputs on interleaved lines, two outputs: y1 = 2 u1 + 0.5 u2, y2 = -u1 + 4 u2.
lines = [list(range(1, 60, 2)), list(range(2, 60, 2))]
u = [multisine(lines[0], draw), multisine(lines[1], draw, 0.3)]
for name, keys in (("pair.csv", ()), ("pair-2.csv", ("segment: 2 of 2",))):
    u1, u2 = ([signal[n % N] for n in range(3 * N)] for signal in u)
    write(name, [("torque_2_Nm", u2), ("velocity_1_rad_per_s", [2 * a + 0.5 * b for a, b in zip(u1, u2)]),
                 ("torque_1_Nm", u1), ("velocity_2_rad_per_s", [-a + 4 * b for a, b in zip(u1, u2)])],
          sorted(lines[0] + lines[1]), keys=keys)
# The same machine in two segments, as a sequence of runs.
for segment, (first, second) in enumerate((([61, 63], [62]), ([3, 5], [4, 6, 8]))):
    u1, u2 = ([signal[n % N] for n in range(3 * N)] for signal in (multisine(first, draw), multisine(second, draw)))
    write(f"part-{segment + 1}.csv", [("torque_1_Nm", u1), ("torque_2_Nm", u2),
          ("velocity_rad_per_s", [2 * a + 0.5 * b for a, b in zip(u1, u2)])], keys=(f"segment: {segment + 1} of 2",))
json.dump({"holds": "runs", "kind": "octaves", "segments": [
    {"table": f"a-{i}-1.mst", "table_crc32": "0x1", "run": f"part-{i}.csv", "periods": 3, "periods_planned": 3}
    for i in (1, 2)]}, open("parts.csv", "w"))
both = [a + b for a, b in zip(u1, u2)]
write("same.csv", [("torque_1_Nm", both), ("torque_2_Nm", both), ("velocity_rad_per_s", both)])
table = lambda name, bins: {"file": name, "table_crc32": "0x1", "excited_bins": bins}
json.dump({"holds": "tables", "kind": "octaves", "sample_rate_hz": RATE, "period_samples": N, "inputs": 2, "periods": 1,
           "settle_s": 0, "test_time_s": 1, "segments": [
    {"periods": 1, "tables": [table("a-1-1.mst", [61, 63]), table("a-1-2.mst", [62])]},
    {"periods": 1, "tables": [table("a-2-1.mst", [3, 5]), table("a-2-2.mst", [4, 6, 8])]}]}, open("design.json", "w"))
PYTHON
python3 make.py

cat >read.py <<'PYTHON'
import csv, math
def read(name):
    rows = list(csv.DictReader(line for line in open(name) if not line.startswith("#")))
    return [{k: (float(v) if v else None) for k, v in row.items()} for row in rows]
def keys(name):
    return dict(line[2:].rstrip("\n").split(": ", 1) for line in open(name) if line.startswith("# "))
PYTHON

# Free bins show odd and even distortion; on a linear drive nothing above the noise.
"$SERVOSCOPE" frf curved1.csv --out frf.csv --report page.html >said
grep -q 'odd-order distortion at [0-9]* free bins: -.* dB of the response .*; not in std' said || fail "$(cat said)"
grep -q 'even-order distortion at [0-9]* free bins: -' said || fail "$(cat said)"
grep -q 'Nonlinear distortion' page.html || fail "the page has no distortion"
python3 - <<'PYTHON' || fail "levels of frf.csv: $(cat frf.csv)"
from read import *
rows, said = read("frf.csv"), keys("frf.csv")
mean = lambda name: sum(row[name] ** 2 for row in rows[3:]) / len(rows[3:])
# Even: 0.003^2 times the 19 pairs of 38 lines that fall on a bin in the mean; odd: the realisations below say.
assert abs(mean("even_distortion") ** 0.5 / (0.003 * 19 ** 0.5) - 1) < 0.25, mean("even_distortion") ** 0.5
assert 0.005 < mean("odd_distortion") ** 0.5 < 0.05, mean("odd_distortion") ** 0.5
assert float(said["odd_distortion_chance"]) < 1e-6 and int(said["even_distortion_free_bins"]) == 49
assert said["hold"] == "zoh" and said["actuator"] == "not included"
PYTHON
"$SERVOSCOPE" frf straight1.csv --out frf.csv >said
[ "$(grep -c 'distortion at .* free bins: none above the noise' said)" -eq 2 ] || fail "$(cat said)"
"$SERVOSCOPE" frf straight1.csv --out frf.csv --json >said
python3 -c '
import json
said = json.load(open("said"))
assert said["distortion"]["odd"]["chance"] > 1e-3 and said["distortion"]["even"]["free_bins"] == 49, said
assert said["repetition"]["repeats_after_periods"] == 1 and "thd_db" not in said
' || fail "--json: $(cat said)"

# Realisations: those of the linear drive agree, those of the other differ by what the free bins of each say.
"$SERVOSCOPE" frf straight[123].csv --out frf.csv >said
grep -q 'the 3 realisations agree within their noise' said || fail "$(cat said)"
"$SERVOSCOPE" frf curved[123].csv --out frf.csv --json >said
python3 - <<'PYTHON' || fail "realisations: $(cat said)"
import json
from read import *
said, rows = json.load(open("said")), read("frf.csv")
assert said["realisations"]["differ"] and said["realisations"]["count"] == 3
std = sum(3 * row["std"] ** 2 for row in rows[3:]) / len(rows[3:])
odd = sum(row["odd_distortion"] ** 2 for row in rows[3:]) / len(rows[3:])
assert abs(10 * math.log10(odd / std)) < 3, (odd, std) # three realisations of 35 lines scatter by 0.6 dB
assert keys("frf.csv")["noise_degrees_of_freedom"] == "30"
PYTHON

# Twice the period: a warning in the file, the summary and --json.
"$SERVOSCOPE" frf late.csv --out frf.csv >said
grep -q 'warning: with .* Hz excited the response repeats only after 2 periods' said || fail "$(cat said)"
grep -qx '# repeats_after_periods: 2' frf.csv || fail "$(grep '^#' frf.csv)"
"$SERVOSCOPE" frf late.csv --out frf.csv --json >said
python3 -c '
import json
said = json.load(open("said"))
assert said["repetition"]["repeats_after_periods"] == 2 and "std does not hold" in said["warning_repetition"], said
' || fail "--json: $(cat said)"

# Total harmonic distortion of each sine of a dwell: -20 and -40 dB, and none.
"$SERVOSCOPE" frf dwell.csv --out frf.csv --report page.html >said
grep -q 'total harmonic distortion at most -20.0. dB, at 10 Hz' said || fail "$(cat said)"
grep -q 'total harmonic distortion in dB' page.html || fail "the page has no harmonics"
"$SERVOSCOPE" frf dwell.csv --out frf.csv --json >said
python3 - <<'PYTHON' || fail "harmonics: $(cat said) $(grep thd frf.csv)"
import json
from read import *
said = json.load(open("said"))
assert abs(said["thd_db"][0] + 20) < 0.01 and abs(said["thd_db"][1] + 40) < 0.1 and said["thd_db"][2] is None, said
assert said["input_thd_db"] == [None, None, None]
in_file = json.loads(keys("frf.csv")["thd_db"])
assert len(in_file) == 3 and abs(in_file[0] + 20) < 0.01 and in_file[2] is None
PYTHON

# The load's side: named in the summary, and estimated although its position drifts.
"$SERVOSCOPE" frf belt.csv --out motor.csv >said
grep -q -- '--output load_position_rad for its response' said || fail "$(cat said)"
"$SERVOSCOPE" frf belt.csv --output load_position_rad --input torque_ref_Nm --delay 0.0015 --hold band-limited --out load.csv >said
! grep -q 'the load is measured too' said || fail "$(cat said)"
python3 - <<'PYTHON' || fail "load.csv: $(head -20 load.csv)"
import cmath
from read import *
for row in read("load.csv"):
    w = 2 * math.pi * row["frequency_hz"]
    expected = 5 / (1j * w) * cmath.exp(1j * w * 0.0015)
    assert row["valid"] == 1 and abs(complex(row["real"], row["imag"]) / expected - 1) < 0.01, row
said = keys("load.csv")
assert said["actuator"] == "included" and said["hold"] == "band-limited" and float(said["delay_removed_s"]) == 0.0015
assert said["units"] == "rad/Nm"
PYTHON

# Two inputs: a matrix of responses, each on its own input's lines.
"$SERVOSCOPE" frf pair.csv --out m.csv --report page.html >said || fail "$(cat said)"
[ ! -e m.csv ] || fail "m.csv is there"
[ "$(grep -c '<h2' page.html)" -ge 4 ] || fail "the page has not four sections"
python3 - <<'PYTHON' || fail "the matrix is wrong: $(cat said)"
from read import *
gains = {(1, 1): 2, (1, 2): 0.5, (2, 1): -1, (2, 2): 4}
for (output, input), gain in gains.items():
    rows, said = read(f"m-{output}-{input}.csv"), keys(f"m-{output}-{input}.csv")
    assert said["input"] == f"torque_{input}_Nm" and said["output"] == f"velocity_{output}_rad_per_s"
    assert [round(row["frequency_hz"] / 2.5) for row in rows] == list(range(input, 60, 2))
    for row in rows:
        error = abs(complex(row["real"], row["imag"]) / gain - 1)
        assert row["valid"] == 1 and 20 * math.log10(1 + error) < 1e-6, (row, gain)
PYTHON
"$SERVOSCOPE" frf pair-2.csv --design design.json --out d.csv --json >said
python3 - <<'PYTHON' || fail "--design: $(cat said)"
import json
said = json.load(open("said"))
assert said["inputs"] == ["torque_1_Nm", "torque_2_Nm"] and len(said["responses"]) == 4
assert [r["lines"] for r in said["responses"]] == [2, 3, 2, 3] and said["responses"][1]["out"] == "d-1-2.csv"
PYTHON
for option in "" "--design design.json"; do
    # shellcheck disable=SC2086 # no option, or two words
    "$SERVOSCOPE" frf parts.csv $option --out p.csv --quiet || fail "a sequence of runs with two inputs: $option"
    python3 - <<'PYTHON' || fail "a sequence of runs with two inputs $option: $(cat p-1-1.csv p-1-2.csv)"
from read import *
for name, bins, gain in (("p-1-1.csv", [3, 5, 61, 63], 2), ("p-1-2.csv", [4, 6, 8, 62], 0.5)):
    rows = read(name)
    assert [round(row["frequency_hz"] / 2.5) for row in rows] == bins, name
    assert all(abs(complex(row["real"], row["imag"]) / gain - 1) < 1e-9 for row in rows), name
PYTHON
done
"$SERVOSCOPE" frf pair.csv --input torque_2_Nm --output velocity_1_rad_per_s --out one.csv --quiet
python3 -c '
from read import *
assert [round(row["frequency_hz"] / 2.5) for row in read("one.csv")] == list(range(2, 60, 2))
' || fail "one input of two: $(cat one.csv)"
"$SERVOSCOPE" frf pair.csv pair-2.csv --out twice.csv --quiet
grep -qx '# realisations: 1' twice-2-1.csv || fail "two runs of two inputs, which are of one excitation"
grep -qx '# runs: 2' twice-2-1.csv || fail "two runs of two inputs"

# Refusals
rm -f x*.csv
refuse 2 "--hold: 'foh', expected zoh" curved1.csv --hold foh --out x.csv
refuse 2 '--delay' curved1.csv --delay soon --out x.csv
refuse 2 '--delay' curved1.csv --delay -0.001 --out x.csv
refuse 1 'same.csv: both torque_1_Nm and torque_2_Nm are excited on bin' same.csv --out x.csv
refuse 2 '--lines: pair.csv has the inputs torque_1_Nm to torque_2_Nm' pair.csv --lines list:none --out x.csv
refuse 2 "--lines: 'odd:1:2:1'" pair.csv --lines odd:1:2:1 --design design.json --out x.csv
refuse 1 'expected which of the 2 segments of design.json it is' pair.csv --design design.json --out x.csv
refuse 1 'curved1.csv: no two inputs' curved1.csv --design design.json --out x.csv
refuse 1 'none.json' pair.csv --design none.json --out x.csv
refuse 1 "no column 'velocity_3_rad_per_s'" pair.csv --output velocity_3_rad_per_s --out x.csv
refuse 2 '--model-out' pair.csv --method parametric --model-out x.json --out x.csv
cp pair.csv m-1-1.csv
refuse 2 'm-1-1.csv' m-1-1.csv --out m.csv
awk -F, '/^#/{print; next} {print $1 "," $2 "," $4}' pair.csv >blind.csv
refuse 1 'blind.csv: no output column' blind.csv --out x.csv
[ -z "$(ls x*.csv 2>/dev/null)" ] || fail "left behind: $(ls x*.csv)"

[ "$failures" -eq 0 ]
