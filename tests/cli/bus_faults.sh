#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# drive --faults, met by measure over slcan on this machine: each lost sample is counted and marked, a drive that fails ends the
# measurement with its reason, what was injected is said. Every fault at every position is tests/fault, on the bus inside.
subcommand=drive
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

"$SERVOSCOPE" design --rate 500 --period 250 --lines linear:2:100:2 --limit-torque 1 --inertia 0.005 --method newman --out table \
    --quiet
echo '{"structure": "rigid", "motor_inertia_kgm2": 0.005, "sample_rate_hz": 500, "seed": 3}' >model.json
# A sample is waited for a fifth of a second: what is lost then is what was injected, also on a machine with other work.
patience='sync_timeout_ms=800'

drive_options=()
with_faults() { # with_faults FAULTS MEASURE_ARGUMENT...: result, what drive and measure say in drive.txt, said.json, err
    local faults=$1
    shift
    : >drive.txt
    "$SERVOSCOPE" drive --model model.json --can slcan:127.0.0.1:0 --faults "$faults" "${drive_options[@]}" >drive.txt 2>drive.err &
    local drive=$!
    for _ in {1..100}; do
        ! grep -q '^node' drive.txt || break
        sleep 0.1
    done
    local port
    port=$(sed -n 's/^node 5 on slcan, TCP port \([0-9]*\);.*/\1/p' drive.txt)
    rm -f run.csv said.json
    result=0
    "$SERVOSCOPE" measure --drive "slcan:127.0.0.1:$port?node=5&$patience" --table table.mst --periods 4 --out run.csv --json \
        "$@" >said.json 2>err || result=$?
    kill -INT "$drive"
    wait "$drive" || fail "$faults: drive: $(cat drive.err)"
}

# lost FAULTS COUNT WHAT   the measurement is complete, COUNT samples are lost, the drive says what it has done
lost() {
    with_faults "$1"
    [ "$result" -eq 0 ] || fail "$1: $(cat err)"
    grep -qx "injected $3" drive.txt || fail "$1: $(cat drive.txt)"
    python3 - "$2" <<'PYTHON' || fail "$1: $(cat said.json)"
import csv, json, sys
count, said = int(sys.argv[1]), json.load(open("said.json"))
rows = list(csv.DictReader(line for line in open("run.csv") if not line.startswith("#")))
marked = sum(row.get("valid") == "0" for row in rows)
assert len(rows) == 1250 and marked == said["samples_lost"] == count, (len(rows), marked)
PYTHON
    "$SERVOSCOPE" frf run.csv --out frf.csv --quiet || fail "$1: no response"
}
lost drop:285:700:2 2 'drop: 2'
lost corrupt:185:700:3:0x10 1 'corrupt: 1'
lost shorten:285:700 1 'shorten: 1'
lost drop:305:700 1 'drop: 1'         # the drive holds its last set-point and says that it did not use a new one
lost duplicate:185:700 0 'duplicate: 1'
lost delay:185:700:3000 0 'delay: 1'  # is waited for
lost sync-missed:700 2 'sync-missed: 1' # its own, and the next: two set-points have come for that one
lost silent:700 1 'silent: 1'

# ends FAULTS REASON [ARGUMENT...]   status 1, and the reason on standard error and in the run
ends() {
    local faults=$1 reason=$2
    shift 2
    with_faults "$faults" "$@"
    [ "$result" -eq 1 ] || fail "$faults: status $result"
    grep -qE "$reason" err || fail "$faults: $(cat err)"
    [ ! -e run.csv ] || grep -qE "^# stopped_by: .*($reason)" run.csv || fail "$faults: $(grep '^# stopped' run.csv)"
}
ends reset:700 'restarted'
ends heartbeat-stops:700 'its heartbeat stopped'
ends end-stop:0.02 'end|fault|8612'
ends encoder-dead:700 'fault'

# What the drive takes from SYNC to its answer is seen: a millisecond of its own, and the way.
drive_options=(--latch-delay 300 --reply-delay 700)
lost drop:285:700 1 'drop: 1'
python3 -c '
import json
answer = json.load(open("said.json"))["bus"]["sync_to_answer"]
assert answer["mean_us"] > 1000 and sum(answer["bins"][:7]) == 0, answer # no answer within 500 us
' || fail "delays: $(cat said.json)"
drive_options=()

# The second protocol behind the same door: an ODrive on its own clock. No SYNC ties a sample to a set-point, so its response is
# compared where a period is long against a cycle: up to 20 Hz, within 2 % (noise: 0.2 %) and 2 degrees (a cycle of 2 ms is 14).
: >drive.txt
"$SERVOSCOPE" drive --model model.json --odrive slcan:127.0.0.1:0 >drive.txt 2>drive.err &
drive=$!
for _ in {1..100}; do
    ! grep -q '^node' drive.txt || break
    sleep 0.1
done
port=$(sed -n 's/^node 5 on slcan, TCP port \([0-9]*\);.*/\1/p' drive.txt)
"$SERVOSCOPE" measure --drive "odrive-slcan:127.0.0.1:$port?node=5&kt=0.05" --table table.mst --periods 12 --out odrive.csv \
    --quiet || fail "odrive"
kill -INT "$drive"
wait "$drive" || fail "odrive: $(cat drive.err)"
"$SERVOSCOPE" measure --drive sim:model.json --table table.mst --periods 12 --out inside.csv --quiet
for name in odrive inside; do
    "$SERVOSCOPE" frf $name.csv --out $name-frf.csv --quiet || fail "$name: no response"
done
python3 - <<'PYTHON' || fail "the response through the second protocol"
import cmath, csv, math
def read(name):
    return [row for row in csv.DictReader(line for line in open(name) if not line.startswith("#"))]
compared = 0
for a, b in zip(read("odrive-frf.csv"), read("inside-frf.csv"), strict=True):
    if float(a["frequency_hz"]) > 20:
        break
    ratio = complex(float(a["real"]), float(a["imag"])) / complex(float(b["real"]), float(b["imag"]))
    assert abs(abs(ratio) - 1) < 0.02 and abs(math.degrees(cmath.phase(ratio))) < 2, (a["frequency_hz"], ratio)
    compared += 1
assert compared == 10, compared
PYTHON

# Refusals
all=(--model model.json --can slcan:127.0.0.1:0 --for 1)
refuse 2 "--faults: 'drop:285': expected drop:ID:N[:COUNT]" "${all[@]}" --faults drop:285
refuse 2 "--faults: 'corrupt:285:1:8:1': expected corrupt:ID:N:BYTE:MASK" "${all[@]}" --faults corrupt:285:1:8:1
refuse 2 "'drop:800:1': expected" "${all[@]}" --faults drop:285:1,drop:800:1
refuse 2 "'lightning' is no fault" "${all[@]}" --faults lightning:1
refuse 2 "--can: 'slcan:nowhere', expected slcan:HOST:PORT" --model model.json --can slcan:nowhere
refuse 2 '--node' "${all[@]}" --node 128
refuse 1 'none.json' --model none.json --can slcan:127.0.0.1:0
touch taken
refuse 1 'taken: cannot be made a link' --model model.json --can "slcan:$PWD/taken"

[ "$failures" -eq 0 ]
