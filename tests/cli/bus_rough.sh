#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# drive and measure in rough hands: addresses that are none, options that mean nothing on a bus, a terminal that is closed, a
# reader that goes, a program killed before, a serial line that is pulled out, Ctrl-C before anything has moved.
subcommand=drive
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"
jobs_of_test=()
trap 'kill "${jobs_of_test[@]}" 2>/dev/null || true; rm -rf "$folder"' EXIT

"$SERVOSCOPE" design --rate 500 --period 250 --lines linear:2:100:2 --limit-torque 1 --inertia 0.005 --method newman --out table \
    --quiet
echo '{"structure": "rigid", "motor_inertia_kgm2": 0.005, "sample_rate_hz": 500, "seed": 3}' >model.json

# wait_for PATTERN FILE: half a minute, because a machine may have other work
wait_for() {
    for _ in {1..300}; do
        ! grep -q -- "$1" "$2" 2>/dev/null || return 0
        sleep 0.1
    done
    fail "no '$1' in $2: $(cat "$2")"
}

# ---- What is refused, as wrong usage (2) or as not there (1)

refuse 2 'port 0..65535' --model model.json --can slcan:70000
refuse 2 'port 0..65535' --model model.json --can slcan:127.0.0.1:99999999999999999999
refuse 2 'port 1..65535' --model model.json --can slcan-connect:127.0.0.1:0
refuse 2 'port 0..65535' --model model.json --modbus tcp::70000
refuse 2 'expected tcp:HOST:PORT' --model model.json --modbus tcp:
refuse 2 'those of a drive on CAN' --model model.json --modbus tcp::0 --latch-delay 100
refuse 2 'it has no SYNC' --model model.json --odrive slcan:0 --reply-delay 100
refuse 1 'is no serial device' --model model.json --modbus rtu:/dev/null:9600
subcommand=measure
with_table=(--table table.mst --periods 3 --out x.csv)
refuse 2 'port 1..65535' "${with_table[@]}" --drive slcan:127.0.0.1:70000
refuse 2 "'kt' is nothing that can be asked behind '?' of slcan:" "${with_table[@]}" --drive 'slcan:127.0.0.1:1?kt=1'
refuse 2 "'profile' is nothing" "${with_table[@]}" --drive 'odrive-slcan:127.0.0.1:1?profile=generic'
refuse 2 'profile=: expected' "${with_table[@]}" --drive 'slcan:127.0.0.1:1?profile='
refuse 2 'modbus-tcp:HOST:PORT or modbus-rtu:DEVICE:BAUD' "${with_table[@]}" --drive ethercat:1
refuse 2 'expected HOST:PORT' "${with_table[@]}" --drive modbus-tcp:1502
refuse 1 'is no serial device' "${with_table[@]}" --drive modbus-rtu:/dev/null:9600
refuse 1 'nobody.invalid:1502: ' "${with_table[@]}" --drive modbus-tcp:nobody.invalid:1502
! grep -q refused err || fail "a name that nobody knows is no refused connection: $(cat err)"

# ---- The link to a pty

start_pty() { # start_pty FILE OPTION...: in `drive`
    local said=$1
    shift
    "$SERVOSCOPE" drive --model model.json --can "slcan:$PWD/tty" "$@" >"$said" 2>"$said.err" &
    drive=$!
    jobs_of_test+=("$drive")
    wait_for '^node' "$said"
}
start_pty killed
kill -KILL "$drive"
wait "$drive" 2>/dev/null || true
[ -L tty ] || fail "a killed drive takes its link away: this test tests nothing"
start_pty second --for 1e300
subcommand=drive
refuse 1 'File exists' --model model.json --can "slcan:$PWD/tty"
[ -L tty ] || fail "the link of a running drive was taken away"
sleep 0.5
kill -0 "$drive" || fail "--for 1e300 ends at once: $(cat second)"
kill -HUP "$drive" # its terminal is closed
wait "$drive" || fail "closed terminal: status $?: $(cat second.err)"
[ ! -L tty ] || fail "the link is left behind"
grep -q '^ended in state' second || fail "closed terminal: $(cat second)"
touch tty
refuse 1 'File exists' --model model.json --can "slcan:$PWD/tty"
[ -f tty ] || fail "somebody's file was taken away"
rm tty
{ "$SERVOSCOPE" drive --model model.json --can "slcan:$PWD/tty" --for 1 || true; } | head -n 1 >first-line
[ ! -L tty ] || fail "the link is left behind where nobody reads the end"

# ---- A terminal that is closed under a moving axis

: >drive.txt
"$SERVOSCOPE" drive --model model.json --can slcan:127.0.0.1:0 >drive.txt 2>drive.err &
drive=$!
jobs_of_test+=("$drive")
wait_for '^node' drive.txt
port=$(sed -n 's/^node 5 on slcan, TCP port \([0-9]*\);.*/\1/p' drive.txt)
"$SERVOSCOPE" measure --drive "slcan:127.0.0.1:$port?sync_timeout_ms=800" --table table.mst --periods 1000 --out hung-up.csv --quiet \
    2>err &
master=$!
jobs_of_test+=("$master")
sleep 2 # well into the run: opening takes a part of it, a period half a second
kill -HUP "$master"
status=0
wait "$master" || status=$?
[ "$status" -eq 1 ] || fail "closed terminal: status $status: $(cat err)"
grep -q 'interrupted by the user' err || fail "closed terminal: $(cat err)"
grep -q '^# interrupted: true' hung-up.csv || fail "closed terminal: $(head -n 30 hung-up.csv)"
kill -INT "$drive"
wait "$drive" || fail "drive: $(cat drive.err)"
# Brought to rest and told so: neither a missing SYNC nor a lost heartbeat had to stop it.
grep -q '^ended in state switch-on disabled, error code 0000' drive.txt || fail "closed terminal: $(cat drive.txt)"

# ---- A serial line that is pulled out under the drive

python3 "$SERVOSCOPE_SOURCE/tests/support/pty_pair.py" "$PWD/near" "$PWD/far" &
pair=$!
jobs_of_test+=("$pair")
for _ in {1..100}; do
    [ ! -L far ] || break
    sleep 0.1
done
"$SERVOSCOPE" drive --model model.json --modbus "rtu:$PWD/near:115200" >served 2>served.err &
drive=$!
jobs_of_test+=("$drive")
wait_for '^simulated drive on Modbus' served
kill "$pair"
wait "$pair" 2>/dev/null || true
for _ in {1..100}; do
    kill -0 "$drive" 2>/dev/null || break
    sleep 0.1
done
status=0
kill -INT "$drive" 2>/dev/null || true
wait "$drive" || status=$?
[ "$status" -eq 1 ] || fail "line pulled out: status $status"
grep -q 'the line is gone' served.err || fail "line pulled out: $(cat served.err)"

# ---- Ctrl-C while a table is sent: nothing is played

"$SERVOSCOPE" design --rate 500 --period 32000 --lines linear:2:100:2 --limit-torque 1 --inertia 0.005 --method newman \
    --out long --quiet
"$SERVOSCOPE" drive --model model.json --modbus tcp::0 >served-tcp 2>served.err &
drive=$!
jobs_of_test+=("$drive")
wait_for '^simulated drive on Modbus' served-tcp
cat >slow_line.py <<'PYTHON'
# Passes bytes on, each lump 10 ms late: a table of 800 chunks takes 16 s. usage: slow_line.py PORT; says where it listens
import select, socket, sys, time
listener = socket.create_server(("127.0.0.1", 0))
print(listener.getsockname()[1], flush=True)
client = listener.accept()[0]
drive = socket.create_connection(("127.0.0.1", int(sys.argv[1])))
while True:
    for ready in select.select([client, drive], [], [])[0]:
        lump = ready.recv(4096)
        if not lump:
            sys.exit()
        time.sleep(0.01)
        (drive if ready is client else client).sendall(lump)
PYTHON
place=$(sed -n 's/^simulated drive on Modbus \([^ ,]*\),.*/\1/p' served-tcp)
python3 slow_line.py "${place##*:}" >slow 2>slow.err &
jobs_of_test+=("$!")
wait_for '[0-9]' slow
"$SERVOSCOPE" measure --drive "modbus-tcp:127.0.0.1:$(cat slow)" --table long.mst --periods 2 --out never.csv --quiet 2>err &
master=$!
jobs_of_test+=("$master")
sleep 3
kill -INT "$master"
status=0
wait "$master" || status=$?
[ "$status" -eq 1 ] || fail "interrupted while sending: status $status"
grep -q 'interrupted by the user before anything was played' err || fail "interrupted while sending: $(cat err)"
[ ! -e never.csv ] || fail "interrupted while sending: a file"
kill -INT "$drive"
wait "$drive" || fail "drive: $(cat served.err)"

[ "$failures" -eq 0 ]
