#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope frf on recordings that are read piece by piece: more than 512 Ki numbers. From a file, gzipped and through a pipe, the same
# response; a true period that is no whole number of samples; what such a recording is refused for.
subcommand=frf
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

# write PERIOD ROWS   lines 3, 10 and 40, response (2 - j) / 4 at all of them, noise
write() {
    awk -v period="$1" -v rows="$2" 'BEGIN {
        print "# sample_rate_hz: 1000\n# period_samples: 2000\n# excited_bins: [3, 10, 40]\ntorque_Nm,velocity_rad_per_s"
        srand(1)
        turn = 6.283185307179586 / period
        for (n = 0; n < rows; n++) {
            a = turn * 3 * n; b = turn * 10 * n + 1; c = turn * 40 * n + 2
            x = cos(a) + cos(b) + cos(c)
            y = 0.5 * x + 0.25 * (sin(a) + sin(b) + sin(c))
            printf "%.7g,%.7g\n", x + 0.01 * (rand() - 0.5), y + 0.01 * (rand() - 0.5)
        }
    }'
}

# agrees FRF.csv HZ   lines at multiples of HZ, the response within 5 of its standard deviations, which are below 1e-4
agrees() {
    python3 - "$@" <<'PYTHON'
import csv, sys
rows = list(csv.DictReader(line for line in open(sys.argv[1]) if not line.startswith("#")))
assert [round(float(row["frequency_hz"]) / float(sys.argv[2]), 4) for row in rows] == [3, 10, 40], rows
for row in rows:
    off = abs(complex(float(row["real"]), float(row["imag"])) - (0.5 - 0.25j))
    assert row["valid"] == "1" and 0 < float(row["std"]) < 1e-4 and off < 5 * float(row["std"]), row
PYTHON
}

write 2000 1100000 >long.csv
"$SERVOSCOPE" frf long.csv --out frf.csv >said
grep -q '^long.csv: 550 of 550 periods of 2000 samples count' said || fail "$(cat said)"
grep -q 'read piece by piece: what else is said of it is of its first 131 periods' said || fail "$(cat said)"
agrees frf.csv 0.5 || fail "frf.csv is not the response"
gzip -1 -c long.csv >long.csv.gz
"$SERVOSCOPE" frf long.csv.gz --out gz.csv --quiet
cmp frf.csv gz.csv || fail "gzipped it is another response"
cat long.csv | "$SERVOSCOPE" frf /dev/stdin --out pipe.csv --json >said
cmp frf.csv pipe.csv || fail "through a pipe it is another response"
grep -q '"leading_periods":[[:space:]]*131' said || fail "$(cat said)"

# Read whole by a method that needs it; the same response, but for what its window does.
"$SERVOSCOPE" frf long.csv --method hann --out hann.csv >said
grep -q 'piece by piece' said && fail "hann says it was read piece by piece"
agrees hann.csv 0.5 || fail "hann.csv is not the response"

# An error far behind the leading part is found, with its line; nothing is written. So is a key that comes too late.
{ cat long.csv; echo '1,nan'; } >bad.csv
refuse 1 'bad.csv:1100005: velocity_rad_per_s: '"'nan'"' is not a number' bad.csv --out x.csv
{ cat long.csv; echo '# periods: 3'; } >late.csv
refuse 1 'late.csv:1100005: periods: in a recording that is too large for memory' late.csv --out x.csv

# 50 ppm between two clocks: found in the leading part, corrected in every part.
write 2000.1 1100000 >slow.csv
"$SERVOSCOPE" frf slow.csv --out frf.csv >said
grep -q 'a period is 2000\.\(1\|0999\|1000\)[0-9]* samples (std [0-9.e-]*), not 2000: +50 ppm; resampled to it' said || fail "$(cat said)"
grep -qx '# clock: resampled' frf.csv || fail "no key clock"
grep -qx '# parts: 5' frf.csv || fail "$(grep parts frf.csv)"
agrees frf.csv 0.49997500125 || fail "with another clock frf.csv is not the response"

[ "$failures" -eq 0 ]
