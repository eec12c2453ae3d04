#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# python-can's slcan against `servoscope drive`, over TCP and over a pty, in a virtual environment beside the build.
subcommand=drive
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"
source "$SERVOSCOPE_SOURCE/tests/support/foreign.sh"
python_with slcan can,serial python-can==4.6.1 pyserial==3.5
echo '{"structure": "rigid", "motor_inertia_kgm2": 0.005, "sample_rate_hz": 1000, "seed": 3}' >model.json
cat >client.py <<'PYTHON'
import sys, time, can

bus = can.Bus(interface="slcan", channel=sys.argv[1], bitrate=1000000)

def send(identifier, data):
    bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=bytes.fromhex(data)))

def expect(identifier, data):
    end = time.monotonic() + 10
    while time.monotonic() < end:
        message = bus.recv(1)
        if message and message.arbitration_id == identifier and message.data.hex() == data:
            return
    sys.exit(f"no {identifier:03X}#{data}")

send(0x000, "8005")  # pre-operational, whatever the client before has left
send(0x605, "4000100000000000")
expect(0x585, "4300100092010200")  # a servo drive
send(0x605, "2b17100032000000")
expect(0x585, "6017100000000000")
expect(0x705, "7f")  # heartbeat each 50 ms, pre-operational
send(0x000, "0105")
expect(0x705, "05")
for _ in range(200):  # as fast as they go out: every one is answered
    send(0x605, "4018100000000000")
answers = 0
end = time.monotonic() + 20
while answers < 200 and time.monotonic() < end:
    message = bus.recv(1)
    answers += bool(message) and message.arbitration_id == 0x585
bus.shutdown()
assert answers == 200, answers
PYTHON

for way in slcan:127.0.0.1:0 "slcan:$PWD/tty"; do
    : >drive.txt
    "$SERVOSCOPE" drive --model model.json --can "$way" >drive.txt 2>drive.err &
    drive=$!
    for _ in {1..100}; do
        ! grep -q '^node' drive.txt || break
        sleep 0.1
    done
    port=$(sed -n 's/^node 5 on slcan, TCP port \([0-9]*\);.*/\1/p' drive.txt)
    channel=$PWD/tty
    [ -z "$port" ] || channel=socket://127.0.0.1:$port
    for _ in 1 2; do # the second client finds the drive as the first one did
        timeout 100 "$venv/bin/python" client.py "$channel" || fail "$way: the client: $(cat drive.txt drive.err)"
    done
    kill -INT "$drive"
    wait "$drive" || fail "$way: drive: $(cat drive.err)"
    grep -q '^408 frames received, ' drive.txt || fail "$way: $(cat drive.txt)"
done
[ "$failures" -eq 0 ]
