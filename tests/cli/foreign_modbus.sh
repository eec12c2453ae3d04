#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Foreign Modbus clients against `servoscope drive --modbus`: pymodbus measures by the registers alone over TCP and over RTU on a
# pair of ptys (tests/foreign/modbus_client.py, in a virtual environment beside the build), and gets the streamed response;
# mbpoll reads what the documentation says, gives a command and uploads a table word by word.
subcommand=drive
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"
source "$SERVOSCOPE_SOURCE/tests/support/foreign.sh"
source "$SERVOSCOPE_SOURCE/tests/support/modbus_drive.sh"
python_with modbus pymodbus,serial pymodbus==3.16.1 pyserial==3.5

"$SERVOSCOPE" design --rate 2000 --period 500 --lines linear:4:240:4 --limit-torque 1 --inertia 0.005 --method newman \
    --out table --quiet
cat >model.json <<'JSON'
{"structure": "rigid", "motor_inertia_kgm2": 0.005, "load_inertia_kgm2": 0, "sample_rate_hz": 2000, "process_noise_Nm": 0.02,
 "sensors": {"velocity_noise_rad_per_s": 0.02, "torque_noise_Nm": 0.005}, "seed": 5}
JSON
"$SERVOSCOPE" simulate --model model.json --table table.mst --periods 8 --out streamed.csv --quiet
"$SERVOSCOPE" frf streamed.csv --out streamed-frf.csv --quiet

# The gate is 3 sigma on nine lines in ten, which chance breaks less than once in a thousand runs.
compare() {
    python3 - "$1" <<'PYTHON' || fail "$1: another response than the streamed one"
import csv, json, sys
streamed = list(csv.DictReader(line for line in open("streamed-frf.csv") if not line.startswith("#")))
two = three = 0
for (hz, real, imag, std), row in zip(json.load(open(sys.argv[1])), streamed, strict=True):
    assert abs(hz - float(row["frequency_hz"])) < 1e-6 * hz
    off = abs(complex(real, imag) - complex(float(row["real"]), float(row["imag"])))
    sigma = (std ** 2 + float(row["std"]) ** 2) ** 0.5
    two += off <= 2 * sigma
    three += off <= 3 * sigma
print(f"{sys.argv[1]}: {two} of {len(streamed)} lines within 2 sigma, {three} within 3")
assert three >= 54
PYTHON
}

client=("$venv/bin/python" "$SERVOSCOPE_SOURCE/tests/foreign/modbus_client.py")
serve tcp:127.0.0.1:0
port=${place##*:}
"${client[@]}" tcp 127.0.0.1 "$port" 1 table.mst 8 >tcp.json 2>err || fail "pymodbus over TCP: $(tail -n 3 err)"
compare tcp.json

# mbpoll: the probes, and a table of its own with functions 16 and 06. A command is three words in one request.
poll=(mbpoll -m tcp -p "$port" -0 -1 -q)
"${poll[@]}" -B -t 4:float -r 4 127.0.0.1 >probe && grep -q '^\[4\]:.*1$' probe || fail "FLOAT_PROBE: $(cat probe)"
"${poll[@]}" -t 4:hex -r 32 127.0.0.1 >probe && grep -q '0x0006' probe || fail "the drive is not done: $(cat probe)"
acknowledged=$("${poll[@]}" -t 4:hex -r 33 127.0.0.1 | sed -n 's/^\[33\]:[^0]*\(0x[0-9A-F]*\).*/\1/p')
"${poll[@]}" -t 4 -r 16 127.0.0.1 1 0 $((acknowledged + 1)) >probe 2>&1 || fail "OPEN_UPLOAD: $(cat probe)"
words=$(python3 -c '
import struct
table = open("table.mst", "rb").read()
print(*struct.unpack(f">{len(table) // 2}H", table))')
offset=0
for word in $words; do
    chunk+=("$word")
    if [ ${#chunk[@]} -eq 100 ]; then
        "${poll[@]}" -t 4 -r 256 127.0.0.1 $((offset >> 16)) $((offset & 65535)) "${chunk[@]}" >probe 2>&1 || fail "chunk: $(cat probe)"
        offset=$((offset + 100))
        chunk=()
    fi
done
"${poll[@]}" -t 4 -r 256 127.0.0.1 $((offset >> 16)) $((offset & 65535)) "${chunk[@]}" >probe 2>&1 || fail "chunk: $(cat probe)"
"${poll[@]}" -t 4 -r 16 127.0.0.1 2 0 $((acknowledged + 2)) >probe 2>&1 || fail "VERIFY: $(cat probe)"
"${poll[@]}" -t 4 -r 16 127.0.0.1 3 42405 $((acknowledged + 3)) >probe 2>&1 || fail "ARM: $(cat probe)"
"${poll[@]}" -t 4 -r 16 127.0.0.1 4 42405 $((acknowledged + 4)) >probe 2>&1 || fail "START: $(cat probe)"
for _ in {1..100}; do
    "${poll[@]}" -t 4 -r 31 127.0.0.1 1 >probe 2>&1 || fail "sign of life: $(cat probe)"
    "${poll[@]}" -t 4:hex -r 32 127.0.0.1 >probe
    ! grep -q '0x0006' probe || break
    sleep 0.1
done
grep -q '0x0006' probe || fail "mbpoll's run does not end: $(cat probe)"
"${poll[@]}" -t 4 -r 512 127.0.0.1 65535 65535 0 4711 >probe 2>&1 || fail "select: $(cat probe)"
"${poll[@]}" -t 4 -r 528 -c 8 127.0.0.1 >probe
grep -q '^\[528\]:.*4711' probe && grep -q '^\[529\]:.*0$' probe && grep -q '^\[535\]:.*8$' probe || fail "snapshot: $(cat probe)"
"${poll[@]}" -B -t 4:float -r 536 -c 4 127.0.0.1 >probe || fail "spectrum: $(cat probe)"
python3 - <<'PYTHON' || fail "mbpoll's first line is another response: $(cat probe)"
import csv, re
streamed = next(csv.DictReader(line for line in open("streamed-frf.csv") if not line.startswith("#")))
numbers = [float(value) for value in re.findall(r"^\[\d+\]:\s*(\S+)", open("probe").read(), re.M)]
response = complex(*numbers[2:4]) / complex(*numbers[0:2])
expected = complex(float(streamed["real"]), float(streamed["imag"]))
assert abs(response - expected) <= 5 * float(streamed["std"]) + 1e-4 * abs(expected), (response, expected)
PYTHON
kill -INT "$drive"
wait "$drive" || fail "drive: $(cat served-err)"

python3 "$SERVOSCOPE_SOURCE/tests/support/pty_pair.py" "$folder/line-a" "$folder/line-b" &
jobs_of_test+=($!)
for _ in {1..100}; do
    [ ! -e line-b ] || break
    sleep 0.05
done
serve "rtu:$folder/line-a:115200"
"${client[@]}" rtu "$folder/line-b" 5 table.mst 8 >rtu.json 2>err || fail "pymodbus over RTU: $(tail -n 3 err)"
compare rtu.json
kill -INT "$drive"
wait "$drive" || fail "drive: $(cat served-err)"
[ "$failures" -eq 0 ]
