#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope design from the command line: what it writes, what it refuses (exit status and a message with value and
# expectation), and what is left on the disk then.
subcommand=design
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

# refuse STATUS PART ARGUMENTS...   the program ends with STATUS, says PART on standard error, prints and leaves nothing
refuse() {
    local expected=$1 part=$2 status=0
    shift 2
    "$SERVOSCOPE" design "$@" >out 2>err || status=$?
    [ "$status" -eq "$expected" ] || fail "status $status instead of $expected: $*"
    grep -qF -- "$part" err || fail "no '$part' in '$(cat err)': $*"
    grep -q '^servoscope design: ' err || fail "message without its origin: $(cat err)"
    [ "$(wc -l <err)" -eq 1 ] || fail "not one line: $(cat err)"
    [ ! -s out ] || fail "standard output is not empty: $*"
    if compgen -G 'x*' >/dev/null; then
        fail "left behind: $(echo x*): $*"
        rm -rf x*
    fi
}

grid=(--rate 1000 --period 2000)
lines=(--lines linear:0.5:100:0.5)
axis=(--limit-torque 1 --inertia 0.00516)
all=("${grid[@]}" "${lines[@]}" "${axis[@]}" --out x)

# Missing parts
refuse 2 '--rate is missing' --period 2000 "${lines[@]}" "${axis[@]}" --out x
refuse 2 '--out is missing' "${grid[@]}" "${lines[@]}" "${axis[@]}"
refuse 2 '--lines is missing' "${grid[@]}" "${axis[@]}" --out x
refuse 2 'no limit is given' "${grid[@]}" "${lines[@]}" --inertia 1 --out x
refuse 2 '--inertia is missing' "${grid[@]}" "${lines[@]}" --limit-torque 1 --out x
refuse 2 '--mass is missing' "${grid[@]}" "${lines[@]}" --limit-force-n 1 --out x

# Values
refuse 2 "unknown option '--limit-power'" "${all[@]}" --limit-power 3
refuse 2 "unexpected 'stray'" "${all[@]}" stray
refuse 2 "--limit-velocity: '0', expected a positive number" "${all[@]}" --limit-velocity 0
refuse 2 "--limit-velocity: '-1', expected a positive number" "${all[@]}" --limit-velocity -1
refuse 2 "--limit-velocity: 'nan' is not a number" "${all[@]}" --limit-velocity nan
refuse 2 "--limit-velocity: '1,5' has a decimal comma" "${all[@]}" --limit-velocity 1,5
refuse 2 "--limit-velocity: '3rad' is not a number" "${all[@]}" --limit-velocity 3rad
refuse 2 "--inertia: '0', expected a positive number" "${grid[@]}" "${lines[@]}" --limit-torque 1 --inertia 0 --out x
refuse 2 "--rate: '0', expected 0.001 to" --rate 0 --period 2000 "${lines[@]}" "${axis[@]}" --out x
refuse 2 "--rate: '1/0', expected" --rate 1/0 --period 2000 "${lines[@]}" "${axis[@]}" --out x
refuse 2 "--rate: 'fast' is not a number" --rate fast --period 2000 "${lines[@]}" "${axis[@]}" --out x
refuse 2 "--period: '3' is out of range, expected 4 to 1048576" --rate 1000 --period 3 "${lines[@]}" "${axis[@]}" --out x
refuse 2 "--period: '2000.5' is not a whole number" --rate 1000 --period 2000.5 "${lines[@]}" "${axis[@]}" --out x
refuse 2 "--iterations: '0' is out of range" "${all[@]}" --iterations 0
refuse 2 "x.csv: would be overwritten" "${all[@]}" --report x.csv
refuse 2 "x.csv: would be overwritten" "${grid[@]}" --lines list:x.csv "${axis[@]}" --out x
refuse 1 "nowhere/r.html: cannot be written" "${all[@]}" --report nowhere/r.html

# Words
refuse 2 "method: 'magic', expected one of fast, mca, linf, clip" "${all[@]}" --method magic
refuse 2 "--grid: 'both', expected continuous or samples" "${all[@]}" --grid both
refuse 2 "--start: 'middle', expected paper or none" "${all[@]}" --start middle
refuse 1 "m.json: cannot be read" "${all[@]}" --start model:m.json
refuse 2 "--start: 'model:', expected" "${all[@]}" --start model:
refuse 2 "--mode: 'speed', expected cascade or torque" "${all[@]}" --mode speed
refuse 2 "--amplitude-tolerance: 1 is for --method fast" "${all[@]}" --method mca --amplitude-tolerance 1
refuse 2 "--time-budget: 1 is for --method fast" "${all[@]}" --method mca --time-budget 1
refuse 2 "--keep: 'some', expected all or acceleration" "${all[@]}" --method clip --keep some
refuse 2 "--keep: 'all' is for --method clip" "${all[@]}" --keep all
refuse 2 "--starts: 3 is for --method fast" "${all[@]}" --method mca --starts 3

# Lines
refuse 2 'half the rate is 500 Hz' "${grid[@]}" --lines linear:0.5:500:0.5 "${axis[@]}" --out x
refuse 2 "is not on the period's grid of 0.5 Hz" "${grid[@]}" --lines linear:0.7:100:0.5 "${axis[@]}" --out x
refuse 2 'no line is left' "${grid[@]}" --lines odd:2:2.4:1 "${axis[@]}" --out x
printf '1\n2\nthree\n' >list.txt
refuse 1 "list.txt:3: 'three' is not a number" "${grid[@]}" --lines list:list.txt "${axis[@]}" --out x
refuse 1 'missing.txt: cannot be opened' "${grid[@]}" --lines list:missing.txt "${axis[@]}" --out x

# Axes
refuse 2 'rotary and linear limits are mixed' "${all[@]}" --limit-velocity-m-per-s 1
refuse 2 '--inertia and --mass are both given' "${all[@]}" --mass 1 --pulley-radius 0.1
refuse 1 'nowhere' "${grid[@]}" "${lines[@]}" "${axis[@]}" --out nowhere/x

# What is played under the multisine, what is asked of it
refuse 2 "--stroke: '0.5', expected AMPLITUDE:PERIODS" "${all[@]}" --stroke 0.5
refuse 2 "--stroke-m is of a linear axis" "${all[@]}" --stroke-m 0.1:4
refuse 1 "which leaves nothing for the multisine" "${all[@]}" --limit-velocity 2 --bias-velocity 3
refuse 1 "expected at least 2 Nm" "${all[@]}" --minimum-effective 2
refuse 2 "--stroke is for a single table" "${grid[@]}" --lines octaves:1:100:1 "${axis[@]}" --stroke 0.5:4 --out x

# What is written
"$SERVOSCOPE" design "${all[@]}" >out 2>err
for ending in mst csv h; do
    [ -s "x.$ending" ] || fail "x.$ending was not written"
done
[ ! -s err ] || fail "not silent on standard error: $(cat err)"
cp x.mst first.mst
"$SERVOSCOPE" design "${all[@]}" --quiet >out
[ ! -s out ] || fail '--quiet is not quiet'
cmp -s x.mst first.mst || fail 'the same command wrote another table'
rm -f x.*

# A linear axis through its pulley is the rotary one: F = M / r, m = J / r^2 (the CSV's figures agree to rounding)
"$SERVOSCOPE" design "${grid[@]}" "${lines[@]}" --limit-torque 1 --inertia 0.01 --limit-velocity 2 --out rotary --json >a
"$SERVOSCOPE" design "${grid[@]}" "${lines[@]}" --limit-force-n 10 --mass 1 --limit-velocity-m-per-s 0.2 \
    --pulley-radius 0.1 --out pulley --json >b
"$SERVOSCOPE" design "${grid[@]}" "${lines[@]}" --limit-force-n 10 --mass 1 --limit-velocity-m-per-s 0.2 \
    --out linear --json >c
value() {
    sed -n "s/^ *\"$2\": \\([-0-9.e+]*\\),*\$/\\1/p" "$1" | head -n 1
}
same() {
    awk -v a="$1" -v b="$2" 'BEGIN { exit !(a != "" && b != "" && (a - b) ^ 2 <= 1e-6 * a ^ 2) }'
}
same "$(value a effective_torque_Nm)" "$(value b effective_torque_Nm)" || fail 'the pulley changes the effective torque'
same "$(value a effective_torque_Nm)" "$(awk -v f="$(value c effective_force_N)" 'BEGIN { print f * 0.1 }')" ||
    fail 'force times radius is not the torque'
head -n 20 linear.csv | grep -q '^n,force_N,position_m,velocity_m_per_s,acceleration_m_per_s2$' ||
    fail 'the linear CSV has other names'
for key in method lines effective_torque_Nm effective_torque_continuous_Nm crest_factor peak peak_continuous bound_Nm \
    start_index cpu_s test_time_s predicted_std; do
    grep -q "^  \"$key\":" a || fail "--json lacks $key"
done

# The program around it
"$SERVOSCOPE" --help | grep -q '^  design ' || fail 'design is not in the list'
"$SERVOSCOPE" design --help | grep -q '^  servoscope design --rate' || fail 'the help has no example'
"$SERVOSCOPE" --version | grep -q '^servoscope [0-9]' || fail 'no version'
status=0
"$SERVOSCOPE" desing >out 2>err || status=$?
[ "$status" -eq 2 ] && grep -q "'desing' is not a subcommand" err || fail 'a wrong subcommand is not refused'
status=0
"$SERVOSCOPE" >out 2>err || status=$?
[ "$status" -eq 2 ] && [ ! -s out ] || fail 'no subcommand is not refused'

[ "$failures" -eq 0 ]
