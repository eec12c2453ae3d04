#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope frf on recordings with a fault: lost samples in what is left out, a wrong sign, lines that are not excited.
subcommand=frf
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

# A rigid axis, 1/(0.01 j w), six periods of 1000 samples at 1000 Hz, written by the options of a line:
# write NAME FIRST_HZ SIGN DELAY_SAMPLES
write() {
    python3 - "$@" <<'PYTHON'
import math, random, sys
name, first, sign, delay = sys.argv[1], *map(int, sys.argv[2:])
random.seed(5)
bins = range(first, 300, 4)
phases = [random.uniform(0, 2 * math.pi) for _ in bins]
torque = [sum(math.cos(2 * math.pi * k * n / 1000 + p) for k, p in zip(bins, phases)) for n in range(1000)]
speed = [sum(sign * 100 / (2 * math.pi * k) * math.sin(2 * math.pi * k * (n - delay) / 1000 + p)
             for k, p in zip(bins, phases)) for n in range(1000)]
with open(name, "w") as file:
    file.write(f"# sample_rate_hz: 1000\n# period_samples: 1000\n# excited_bins: {list(bins)}\n")
    file.write("time_s,torque_Nm,velocity_rad_per_s,valid\n")
    for n in range(6000):
        noise = random.gauss(0, 0.01)
        file.write(f"{n / 1000:.3f},{torque[n % 1000]:.12g},{speed[n % 1000] + noise:.12g},1\n")
PYTHON
}

# lose FROM TO ROW...: those rows get valid 0 and garbage, their time included.
lose() {
    awk -F, -v rows=" ${*:3} " '/^[0-9]/ { n++; if (index(rows, " " n " ")) { print "1e5,1e6,-1e6,0"; next } } { print }' \
        "$1" >"$2"
}

# The sign: told where no delay explains it, never of an axis that counts as it should.
for delay in 0 1 2 4; do
    for first in 7 70; do
        write right.csv "$first" 1 "$delay"
        "$SERVOSCOPE" frf right.csv --out f.csv >said
        grep -q 'the other way round' said && fail "from $first Hz, delay $delay: $(cat said)"
    done
    write wrong.csv 7 -1 "$delay"
    "$SERVOSCOPE" frf wrong.csv --out f.csv >said
    grep -q 'velocity_rad_per_s counts the other way round than torque_Nm' said || fail "delay $delay: $(cat said)"
done

# Lost samples: their values reach nothing; those in what is left out are counted by themselves.
write run.csv 7 1 1
lose run.csv first.csv 101
"$SERVOSCOPE" frf first.csv --out f.csv --report page.html >said
grep -q '5 of 6 periods of 1000 samples count, 0 left out for settling, 1 for lost samples (the first in row 101)' said ||
    fail "$(cat said)"
grep -q 'of its size in the first period' said || fail "$(cat said)"
grep -q 'e+0[3-9] of its size' said && fail "garbage in a lost row: $(cat said)"
grep -q 'transient (' said && fail "garbage passes for a transient: $(cat said)"
"$SERVOSCOPE" frf first.csv --settle 1 --out f.csv >said
grep -q '1 lost samples (the first in row 101) cost no period that would count' said || fail "$(cat said)"
grep -qx '# lost_rows_outside: 1' f.csv || fail "$(grep lost f.csv)"
grep -q '^# lost_periods' f.csv && fail "a period that was left out anyway counts as lost"
lose run.csv last.csv 1 5990 6000
"$SERVOSCOPE" frf last.csv --out f.csv >said
grep -q '4 of 6 periods .* 2 for lost samples (the first in row 1)' said || fail "$(cat said)"
grep -q 'e+0[3-9] of its size\|e+0[3-9] in the last' said && fail "garbage in the last period: $(cat said)"

# Lines that nothing excites, a file's own period that is a miscount, an output that is the input.
refuse 1 'torque_Nm has no power on any of 51 lines: the strongest, ' run.csv --lines linear:300:400:2 --out x.csv
sed 's/^# period_samples: 1000/# period_samples: 998/; /^# excited_bins/d' run.csv >miscounted.csv
refuse 1 'expected --period 1000' miscounted.csv --out x.csv
awk -F, -v OFS=, '/^[0-9]/ { $3 = $2 } { print }' run.csv >equal.csv
refuse 1 'torque_Nm and velocity_rad_per_s hold the same numbers in all 6000 rows' equal.csv --out x.csv

# A transient that dies away is no oscillation.
awk -F, -v OFS=, '/^[0-9]/ { $3 += 20 * exp(-$1 / 3) } { print }' run.csv >slow.csv
"$SERVOSCOPE" frf slow.csv --method lpm --out f.csv >said
grep -q 'oscillates by itself' said && fail "$(cat said)"

[ "$failures" -eq 0 ]
