#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# A result that cannot be written is found before anything is measured, searched or moved.
subcommand=measure
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

echo '{"structure": "rigid", "motor_inertia_kgm2": 0.005, "sample_rate_hz": 1000, "seed": 3}' >model.json
design=(--rate 1000 --period 500 --lines quasilog:6:100:1.3 --limit-torque 1 --inertia 0.005 --method newman)
"$SERVOSCOPE" design "${design[@]}" --out table --quiet
"$SERVOSCOPE" simulate --model model.json --table table.mst --periods 3 --out run.csv --quiet
"$SERVOSCOPE" frf run.csv --out frf.csv --quiet

# The drive is none that there is: what is refused is refused before the drive is looked for, let alone moved.
nowhere=(--drive can:none0 --table table.mst --periods 3)
full="/dev/full: cannot be written: No space left on device"
refuse 1 "$full" "${nowhere[@]}" --out /dev/full
refuse 1 "$full" "${nowhere[@]}" --out x.csv --report /dev/full
refuse 1 "$full" --drive modbus-tcp:127.0.0.1:1 --table table.mst --periods 3 --out /dev/full
refuse 1 "/nowhere/: No such file or directory" "${nowhere[@]}" --out /nowhere/x.csv
refuse 1 "/proc/x.csv: cannot be written" "${nowhere[@]}" --out /proc/x.csv
refuse 1 ".: is a folder" "${nowhere[@]}" --out .
for arguments in "simulate --model model.json --table table.mst --periods 3 --out" "frf run.csv --out" \
    "frf run.csv --out x.csv --report" "frf run.csv --method parametric --out x.csv --model-out" "tune frf.csv --bandwidth 10 --out" \
    "tune frf.csv --bandwidth 10 --report" "diagnose run.csv --json-out" "diagnose run.csv --report" "diagnose run.csv --extended" \
    "convert run.csv --to csv --out" "convert run.csv --to uff --out"; do
    read -r subcommand words <<<"$arguments"
    read -ra words <<<"$words"
    refuse 1 "$full" "${words[@]}" /dev/full
done
subcommand=design
refuse 1 "$full" "${design[@]}" --out x --report /dev/full
[ ! -e x.mst ] || fail "design wrote a table"

# A disk that is full: the file size that a process may write stands for it.
for subcommand in measure simulate; do
    drive=(--drive can:none0)
    [ $subcommand = measure ] || drive=(--model model.json)
    status=0
    (trap '' XFSZ && ulimit -f 2 && exec "$SERVOSCOPE" $subcommand "${drive[@]}" --table table.mst --periods 3 --out x.csv) 2>err || status=$?
    [ "$status" -eq 1 ] || fail "$subcommand on a full disk: status $status"
    grep -q "x.csv: cannot be written" err || fail "$subcommand on a full disk: $(cat err)"
    [ ! -e x.csv ] || fail "$subcommand left x.csv"
done

# What is there stays, a device that takes everything is taken, and nothing is left behind.
echo old >x.old
subcommand=simulate
"$SERVOSCOPE" simulate --model model.json --table table.mst --periods 3 --out /dev/null --quiet || fail "/dev/null"
"$SERVOSCOPE" simulate --model model.json --table table.mst --periods 3 --out /dev/stdout --quiet | cmp - run.csv || fail "/dev/stdout"
[ "$(cat x.old)" = old ] || fail "x.old"
[ -z "$(find . -name '.servoscope-*' -o -name '*.tmp-*')" ] || fail "left behind: $(ls -A)"
[ "$failures" -eq 0 ]
