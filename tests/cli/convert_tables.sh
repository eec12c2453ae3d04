#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope convert on tables as other programs export them: what is assumed, what is lost, what is refused, and the numbers.
subcommand=convert
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

PYTHONIOENCODING=utf-8 python3 "$SERVOSCOPE_SOURCE/tests/support/foreign_tables.py"
compare() { # compare NAME: the numbers of NAME.out against what was written
    python3 - "$1" <<'PYTHON'
import csv, json, sys
name = sys.argv[1]
expected = json.load(open("expected.json"))
lost = expected["lost"][name]
rows = list(csv.DictReader(line for line in open(name + ".out", encoding="utf-8") if not line.startswith("#")))
assert len(rows) == (190 if name == "no_end" else 200), len(rows)
tolerance = {"time_s": 1e-9, "torque_Nm": 1e-9, "position_rad": 1e-9}  # ten digits were written, most of them exact
for k, row in enumerate(rows):
    assert (row.get("valid", "1") == "0") == (k in lost), (k, row)
    for column, digits in tolerance.items():
        assert k in lost or abs(float(row[column]) - expected[column][k]) <= digits, (k, column, row[column], expected[column][k])
    if name.startswith("thousands_"):
        assert abs(float(row["Geber"]) - 12345.678 * (k + 1)) <= 5.1e-4, (k, row["Geber"])  # three decimals
PYTHON
}
count=0
while IFS='|' read -r name arguments parts lost; do
    count=$((count + 1))
    words=()
    [ -z "$arguments" ] || read -ra words <<<"$arguments"
    if [[ $parts == "refuse "* ]]; then
        refuse 1 "${parts#refuse }" "$name.csv" x.csv "${words[@]}"
        continue
    fi
    "$SERVOSCOPE" convert "$name.csv" "$name.out" --to csv "${words[@]}" >said 2>&1 || fail "$name: $(cat said)"
    while [ -n "$parts" ]; do
        part=${parts%%&&*}
        grep -qF -- "$part" said || fail "$name: no '$part' in: $(cat said)"
        [[ $parts == *"&&"* ]] && parts=${parts#*&&} || parts=
    done
    compare "$name" || fail "$name: numbers"
done <cases.txt
[ "$count" -ge 50 ] || fail "only $count cases"

# Times that are coarser than the samples: the rate says it. What stands in front is kept.
"$SERVOSCOPE" convert coarse_stamps.csv rated.csv --rate 1000 >said || fail "coarse stamps with a rate: $(cat said)"
grep -q 'lost: Time: its times are coarser than the samples' said || fail "$(cat said)"
"$SERVOSCOPE" convert ticks.csv rated.csv --map "time_s=Time*1,torque_Nm=M" --quiet || fail "a factor for an unknown unit of time"
grep -qx '# remark: cold' preamble.out || fail "$(head -5 preamble.out)"
grep -qx '# Logger 3000; Version 2,1' preamble.out || fail "$(head -5 preamble.out)"
# What reads recordings by itself says where to go with a table that it does not take.
for name in iso units_row two_line_names utf16_be bars preamble no_names quoted_commas semicolon_comma zipped; do
    "$SERVOSCOPE" frf "$name.csv" --out x.csv 2>err && fail "frf takes $name.csv"
    grep -q "'servoscope convert'" err || fail "frf of $name.csv: $(cat err)"
done
# Marked gaps are what frf leaves out, and what a converted file says stays when it is converted again.
"$SERVOSCOPE" convert marked_holes.out again.csv --quiet
cmp marked_holes.out again.csv || fail "a converted table changes when it is converted again"
[ "$failures" -eq 0 ]
