#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# What a person waits for, as the median of several runs, beside the aim: ./run bench feel
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat >drive.json <<'JSON'
{"structure": "rigid", "motor_inertia_kgm2": 0.00516, "viscous_friction_Nms_per_rad": 0.01, "coulomb_friction_Nm": 0.05,
 "sample_rate_hz": 1000, "process_noise_Nm": 0.004,
 "effects": {"cogging": {"amplitude_Nm": 0.05, "periods_per_rev": 12, "phase_rad": 0.4}}}
JSON
sed '/"effects"/d; s/0.004,/0.004}/' drive.json >model.json
limits="--rate 1000 --period 2000 --lines quasilog:0.5:100:1.1 --limit-torque 1 --limit-velocity 3.14 --inertia 0.00516"
# shellcheck disable=SC2086
"$SERVOSCOPE" design $limits --out a --quiet
# shellcheck disable=SC2086
"$SERVOSCOPE" design $limits --method random --seed 2 --out b --quiet
"$SERVOSCOPE" simulate --model drive.json --table a.mst --periods 11 --settle 0 --out long.csv --quiet # 22 s
for table in a b; do # 14 s each
    "$SERVOSCOPE" simulate --model drive.json --table $table.mst --periods 6 --settle 1 --out $table.csv --quiet
done
echo '{"structure": "rigid", "motor_inertia_kgm2": 0.00516, "viscous_friction_Nms_per_rad": 0.01, "sample_rate_hz": 1000}' >smooth.json
"$SERVOSCOPE" design --rate 1000 --period 2000 --lines linear:0.5:250:0.5 --limit-torque 1 --inertia 0.00516 --method schroeder \
    --out c --quiet
"$SERVOSCOPE" simulate --model smooth.json --table c.mst --periods 6 --out c.csv --quiet
"$SERVOSCOPE" frf c.csv --out c-frf.csv --quiet

feel() { # feel AIM_MS TIMES NAME COMMAND...
    local aim=$1 times=$2 name=$3
    shift 3
    python3 - "$aim" "$times" "$name" "$@" <<'PYTHON'
import statistics, subprocess, sys, time
aim, times, name, command = float(sys.argv[1]), int(sys.argv[2]), sys.argv[3], sys.argv[4:]
taken = []
for _ in range(times):
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    taken.append(1000 * (time.perf_counter() - start))
median = statistics.median(taken)
print(f"{name:44} {median:9.1f} ms   aim {aim:6.0f} ms   {'met' if median <= aim else 'MISSED'}")
PYTHON
}

feel 20 21 "--help" "$SERVOSCOPE" --help
feel 100 11 "frf of 22 s at 1 kHz" "$SERVOSCOPE" frf long.csv --out frf.csv
feel 300 5 "frf with its page (aims 100 + 200)" "$SERVOSCOPE" frf long.csv --out frf.csv --report frf.html
feel 5000 5 "diagnose of a pair of 14 s" "$SERVOSCOPE" diagnose a.csv --validate b.csv --model model.json --json-out d.json
feel 5200 3 "diagnose with its page (aims 5000 + 200)" "$SERVOSCOPE" diagnose a.csv --validate b.csv --model model.json --report r.html
feel 200 5 "tune with its page" "$SERVOSCOPE" tune c-frf.csv --bandwidth 5 --report t.html
