#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The bus in figures: 1 kHz streaming over vcan0 for a minute, and frames per second of node and master against the rate that
# candump and cansend's like (cangen) reach on the same vcan. usage: ./run bench bus [SECONDS]
# Needs can-utils; runs itself inside scripts/with-vcan. In User-Mode Linux the figures are those of a slow, shared machine.
set -euo pipefail
source_folder=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
if [ "${1:-}" != inside ]; then
    exec "$source_folder/scripts/with-vcan" -t 600 bash "${BASH_SOURCE[0]}" inside "$@"
fi
seconds=${2:-60}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
echo '{"structure": "rigid", "motor_inertia_kgm2": 0.005, "sample_rate_hz": 1000, "seed": 3}' >model.json
"$SERVOSCOPE" design --rate 1000 --period 1000 --lines linear:1:300:1 --limit-torque 1 --inertia 0.005 --method newman \
    --out table --quiet

settle() { # settle FILE: until it has not grown for two seconds
    local before=-1
    while [ "$before" -ne "$(stat -c %s "$1")" ]; do
        before=$(stat -c %s "$1")
        sleep 2
    done
}

echo "streaming at 1 kHz for $seconds s over vcan0"
"$SERVOSCOPE" drive --model model.json --can vcan0 >drive.txt &
drive=$!
sleep 0.5
status=0
"$SERVOSCOPE" measure --drive 'can:vcan0?node=5&sync_timeout_ms=400' --table table.mst --periods "$((seconds - 1))" \
    --out run.csv --json >run.json || status=$?
kill -INT "$drive"
wait "$drive" || status=$?
cat drive.txt
python3 - <<'PYTHON' || status=1
import csv, json
said = json.load(open("run.json"))
bus = said["bus"]
print(f"{bus['cycle_bits']} bits per cycle, load {bus['load']:.3f}; {bus['real_time']}; {bus['syncs_late']} SYNCs late, "
      f"SYNC off its spacing p99 {bus['sync_jitter']['p99_us']} us, SYNC to answer mean {bus['sync_to_answer']['mean_us']:.0f} us, "
      f"p99 {bus['sync_to_answer']['p99_us']} us; {bus['frames'] * said['samples_per_s'] / said['rows']:.0f} frames/s")
keys = dict(line[2:].rstrip().split(": ", 1) for line in open("run.csv") if line.startswith("#"))
rows = list(csv.DictReader(line for line in open("run.csv") if not line.startswith("#")))
lost = sum(row.get("valid") == "0" for row in rows)
print(f"rows {len(rows)}, marked as lost {lost}, counted as lost {keys['samples_lost']}, late {keys['samples_late']}")
assert lost == int(keys["samples_lost"])
# A lost sample repeats the last one; one that is not marked repeats it exactly only by accident of the noise.
same = sum(a == b for a, b in ((tuple(list(x.values())[1:5]), tuple(list(y.values())[1:5])) for x, y in zip(rows, rows[1:])
                               if y.get("valid") != "0"))
print(f"unmarked rows that repeat the one before: {same}")
assert same == 0
PYTHON

echo "frames per second: master and node on the bus inside the program"
"$SERVOSCOPE" measure --drive sim:model.json --table table.mst --periods 20 --out inside.csv --json >inside.json
python3 - <<'PYTHON'
import json
said = json.load(open("inside.json"))
print(f"{said['bus']['frames'] * said['samples_per_s'] / said['rows']:.0f} frames/s, each taken by both")
PYTHON

echo "frames per second: SDO requests of cangen, as fast as it can, and the drive's answers"
"$SERVOSCOPE" drive --model model.json --can vcan0 --json >drive.json &
drive=$!
sleep 0.5
candump -L vcan0,585:7FF >answers.txt &
dump=$!
cangen vcan0 -g 0 -I 605 -L 8 -D 4041600000000000 -n 5000 -i
settle answers.txt
kill -INT "$drive"
wait "$drive" || true
kill "$dump"
wait "$dump" 2>/dev/null || true
python3 - <<'PYTHON'
import json, re
times = [float(re.match(r"\((\d+\.\d+)\)", line).group(1)) for line in open("answers.txt")]
said = json.load(open("drive.json"))
span = times[-1] - times[0]
frames = said["frames_received"] + said["frames_sent"]
print(f"drive: {said['frames_received']} of 5000 requests taken, {said['frames_lost']} lost and counted, {said['frames_sent']} frames "
      f"sent, {frames / span:.0f} frames/s; candump saw {len(times)} of the answers")
PYTHON

echo "frames per second: cangen to candump alone"
candump -L vcan0 >all.txt &
dump=$!
sleep 0.3
cangen vcan0 -g 0 -I 605 -L 8 -D 4041600000000000 -n 5000 -i
settle all.txt
kill "$dump"
wait "$dump" 2>/dev/null || true
python3 - <<'PYTHON'
import re
times = [float(re.match(r"\((\d+\.\d+)\)", line).group(1)) for line in open("all.txt")]
print(f"cangen: {5000 / (times[-1] - times[0]):.0f} frames/s, of which candump saw {len(times)} of 5000")
PYTHON
exit "$status"
