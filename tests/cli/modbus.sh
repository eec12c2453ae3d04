#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# servoscope drive --modbus and servoscope measure over it, in two processes: TCP on the loopback and RTU over a pair of ptys give
# the response of the streamed measurement; one client commands; what is refused.
subcommand=measure
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"
source "$SERVOSCOPE_SOURCE/tests/support/modbus_drive.sh"

"$SERVOSCOPE" design --rate 2000 --period 500 --lines linear:4:240:4 --limit-torque 1 --inertia 0.005 --method newman \
    --out table --quiet
cat >model.json <<'JSON'
{"structure": "two_mass", "motor_inertia_kgm2": 0.003, "load_inertia_kgm2": 0.002, "belt_stiffness_Nm_per_rad": 300,
 "belt_damping_Nms_per_rad": 0.05, "viscous_friction_Nms_per_rad": 0.01, "coulomb_friction_Nm": 0, "sample_rate_hz": 2000,
 "process_noise_Nm": 0.02, "sensors": {"velocity_noise_rad_per_s": 0.02, "torque_noise_Nm": 0.005}, "seed": 3}
JSON

# compare FILE: the response against the streamed one. Two estimates of 10 periods differ by more than 2 sigma on about 3 % of
# the lines; the gate is 3 sigma on nine in ten, which chance breaks less than once in a thousand runs.
compare() {
    python3 - "$1" streamed-frf.csv <<'PYTHON' || fail "$1 is another response than the streamed one"
import csv, sys
def read(name):
    return [row for row in csv.DictReader(line for line in open(name) if not line.startswith("#"))]
two = three = lines = 0
for ours, streamed in zip(read(sys.argv[1]), read(sys.argv[2]), strict=True):
    assert ours["frequency_hz"] == streamed["frequency_hz"] and ours["valid"] == "1"
    off = abs(complex(float(ours["real"]), float(ours["imag"])) - complex(float(streamed["real"]), float(streamed["imag"])))
    sigma = (float(ours["std"]) ** 2 + float(streamed["std"]) ** 2) ** 0.5
    two += off <= 2 * sigma
    three += off <= 3 * sigma
    lines += 1
print(f"{sys.argv[1]}: {two} of {lines} lines within 2 sigma, {three} within 3")
assert lines == 60 and three >= 54, three
PYTHON
}

"$SERVOSCOPE" simulate --model model.json --table table.mst --periods 10 --out streamed.csv --quiet
"$SERVOSCOPE" frf streamed.csv --out streamed-frf.csv --quiet
run=(--table table.mst --periods 10)

# TCP. A second client may read, not write; the commander's run goes on. Another run follows on the same drive.
serve tcp::0
case $place in 127.0.0.1:*) ;; *) fail "listens at $place without being told" ;; esac
"$SERVOSCOPE" measure --drive "modbus-tcp:$place" "${run[@]}" --out tcp.csv >said 2>err &
job=$!
sleep 1.5
if command -v mbpoll >/dev/null; then
    port=${place##*:}
    mbpoll -m tcp -p "$port" -0 -1 -B -t 4:int -r 2 127.0.0.1 >probe || fail "mbpoll cannot read: $(cat probe)"
    grep -q '16909060' probe || fail "mbpoll reads another ORDER_PROBE: $(cat probe)"
    mbpoll -m tcp -p "$port" -0 -1 -t 4:hex -r 32 127.0.0.1 >probe || fail "mbpoll cannot read: $(cat probe)"
    grep -q '0x000[45]' probe || fail "the drive is not under way: $(cat probe)"
    ! mbpoll -m tcp -p "$port" -0 -1 -t 4 -r 31 127.0.0.1 7 >probe 2>&1 || fail "a second client may write"
fi
status=0
"$SERVOSCOPE" measure --drive "modbus-tcp:$place" "${run[@]}" --out x.csv >said2 2>err2 || status=$?
[ "$status" -eq 1 ] || fail "a second commander: status $status"
grep -q 'exception 06 (another client commands)' err2 || fail "$(cat err2)"
wait "$job" || fail "measure over TCP: $(cat err)"
grep -q '^tcp.csv: response of 60 lines (60 valid) from 10 periods of 500 samples at 2000 Hz, measured in the drive' said ||
    fail "$(cat said)"
compare tcp.csv
for key in 'method: mean' 'periods: 10' 'settle_periods: 1' 'mode: cascade' 'spectra: periods of the drive' "drive: modbus-tcp:$place"; do
    grep -qx "# $key" tcp.csv || fail "no key '$key'"
done
rm -f x.csv
"$SERVOSCOPE" measure --drive "modbus-tcp:$place" "${run[@]}" --out again.csv --json >said || fail "a second run"
python3 -c '
import json
said = json.load(open("said"))
assert said["ended"] == "complete" and said["periods"] == 10 and said["replies_not_believed"] == 0, said
' || fail "--json: $(cat said)"
"$SERVOSCOPE" tune again.csv --bandwidth 20 --quiet || fail "tune does not take the response"

# Limits: refused, or stopped early, and nothing that looks like a whole response is left behind.
refuse 1 "stopped early: speed limit" --drive "modbus-tcp:$place" "${run[@]}" --limit-velocity 0.2 --out x.csv
refuse 1 "expected at most the limit" --drive "modbus-tcp:$place" "${run[@]}" --limit-torque 0.01 --out x.csv
refuse 2 "a response needs the scatter" --drive "modbus-tcp:$place" --table table.mst --periods 1 --out x.csv

# Periods that end faster than they can be read: the drive's own means tell, with as many periods.
"$SERVOSCOPE" design --rate 8000 --period 10 --lines linear:800:3200:800 --limit-torque 1 --inertia 0.005 --method newman \
    --out fast --quiet
"$SERVOSCOPE" measure --drive "modbus-tcp:$place" --table fast.mst --periods 2000 --settle 200 --out fast.csv --quiet || fail "fast"
grep -qx '# spectra: means and variances of the drive' fast.csv || fail "the periods were read in time"
grep -qx '# periods: 2000' fast.csv && grep -q '^# periods_not_read: ' fast.csv || fail "$(head -n 20 fast.csv)"
"$SERVOSCOPE" simulate --model model.json --table fast.mst --periods 2000 --settle 200 --out x-fast.csv --quiet 2>/dev/null ||
    { sed 's/"sample_rate_hz": 2000/"sample_rate_hz": 8000/' model.json >fast.json &&
        "$SERVOSCOPE" simulate --model fast.json --table fast.mst --periods 2000 --settle 200 --out x-fast.csv --quiet; }
"$SERVOSCOPE" frf x-fast.csv --out x-fast-frf.csv --quiet
python3 - <<'PYTHON' || fail "the drive's means are another response"
import csv
def read(name):
    return [row for row in csv.DictReader(line for line in open(name) if not line.startswith("#"))]
for ours, streamed in zip(read("fast.csv"), read("x-fast-frf.csv"), strict=True):
    off = abs(complex(float(ours["real"]), float(ours["imag"])) - complex(float(streamed["real"]), float(streamed["imag"])))
    # Four lines at 5 sigma of 2000 periods: chance breaks this less than once in 10^9 runs.
    assert ours["valid"] == "1" and off <= 5 * (float(ours["std"]) ** 2 + float(streamed["std"]) ** 2) ** 0.5
    assert 0.7 < float(ours["std"]) / float(streamed["std"]) < 1.4
PYTHON
rm -f x-fast.csv x-fast-frf.csv

# Ctrl-C ramps the drive down; what was measured until then is kept and says so.
"$SERVOSCOPE" measure --drive "modbus-tcp:$place" --table table.mst --periods 200 --out cut.csv >said 2>err &
job=$!
sleep 4
kill -INT "$job"
status=0
wait "$job" || status=$?
[ "$status" -eq 1 ] || fail "status $status after Ctrl-C"
grep -q 'interrupted by the user' err || fail "$(cat err)"
grep -q '^# stopped_by: ' cut.csv || fail "no stopped_by"
kill -INT "$drive"
wait "$drive" || fail "drive: $(cat served-err)"

# A master that dies in mid-run: the drive stops by itself, says so, and takes the next one.
serve tcp:127.0.0.1:0
"$SERVOSCOPE" measure --drive "modbus-tcp:$place" --table table.mst --periods 1000 --out dead.csv >said 2>err &
job=$!
sleep 2
kill -KILL "$job"
wait "$job" 2>/dev/null || true
sleep 7 # silence, ramp, standstill
if command -v mbpoll >/dev/null; then
    mbpoll -m tcp -p "${place##*:}" -0 -1 -t 4:hex -r 32 -c 6 127.0.0.1 >probe || fail "mbpoll: $(cat probe)"
    grep -q '^\[32\]:.*0x000F' probe || fail "not in fault after its master died: $(cat probe)"
    grep -q '^\[37\]:.*0x0008' probe || fail "does not say that the host was silent: $(cat probe)"
fi
"$SERVOSCOPE" measure --drive "modbus-tcp:$place" "${run[@]}" --out after.csv --quiet || fail "after a dead master"
kill -INT "$drive"
wait "$drive" || fail "drive: $(cat served-err)"

# A drive that is gone in mid-run: what was read until then is kept, and says why it ended.
serve tcp:127.0.0.1:0
"$SERVOSCOPE" measure --drive "modbus-tcp:$place" --table table.mst --periods 1000 --out lost.csv >said 2>err &
job=$!
sleep 4
kill -KILL "$drive"
wait "$drive" 2>/dev/null || true
status=0
wait "$job" || status=$?
[ "$status" -eq 1 ] || fail "a drive that is gone: status $status"
grep -Eq 'the response of [0-9]+ periods until then is kept' err || fail "a drive that is gone: $(cat err)"
grep -q '^# stopped_by: --drive: ' lost.csv || fail "a drive that is gone: no stopped_by in lost.csv"
periods=$(sed -n 's/^# periods: //p' lost.csv)
[ "${periods:-0}" -ge 2 ] && [ "$periods" -lt 1000 ] || fail "a drive that is gone: $periods periods"
"$SERVOSCOPE" tune lost.csv --bandwidth 20 --quiet || fail "tune does not take the response that was kept"
rm -f lost.csv
refuse 1 "Connection refused" --drive "modbus-tcp:$place" "${run[@]}" --out x.csv

# RTU, at the default slave number of the drive, and at one that nobody has.
python3 "$SERVOSCOPE_SOURCE/tests/support/pty_pair.py" "$folder/line-a" "$folder/line-b" &
jobs_of_test+=($!)
for _ in {1..100}; do
    [ ! -e line-b ] || break
    sleep 0.05
done
serve "rtu:$folder/line-a:115200"
"$SERVOSCOPE" measure --drive "modbus-rtu:$folder/line-b:115200?slave=5" "${run[@]}" --out rtu.csv >said 2>err ||
    fail "measure over RTU: $(cat err)"
compare rtu.csv
refuse 1 "no reply in time" --drive "modbus-rtu:$folder/line-b:115200?slave=6" "${run[@]}" --out x.csv
kill -INT "$drive"
wait "$drive" || fail "drive: $(cat served-err)"

# Wrong usage.
refuse 2 "expected ?slave=N" --drive "modbus-tcp:127.0.0.1:1502?slave=300" "${run[@]}" --out x.csv
refuse 2 "expected HOST:PORT" --drive "modbus-tcp:127.0.0.1" "${run[@]}" --out x.csv
refuse 2 "expected DEVICE:BAUD" --drive "modbus-rtu:/dev/null" "${run[@]}" --out x.csv
subcommand=drive
refuse 2 "expected tcp:HOST:PORT or rtu:DEVICE:BAUD" --model model.json --modbus udp:127.0.0.1:1502
refuse 1 "expected DEVICE:BAUD" --model model.json --modbus rtu:/dev/null:12345

[ "$failures" -eq 0 ]
