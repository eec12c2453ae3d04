#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# python-canopen's CiA 402 client against `servoscope drive` on a SocketCAN interface (tests/foreign/canopen_402.py), in a virtual
# environment beside the build.
# Runs itself inside scripts/with-vcan. Programs with AddressSanitizer do not run there: SERVOSCOPE_OPTIMISED is taken if it is set.
set -euo pipefail
if [ "${1:-}" != inside ]; then
    if [ ! -e /sys/class/net/vcan0 ] && ! command -v linux.uml >/dev/null; then
        [ -n "${CI:-}" ] || exit 77 # elsewhere nothing is installed for it
    fi
    source "$SERVOSCOPE_SOURCE/tests/support/foreign.sh"
    python_with canopen canopen,can canopen==2.4.1 python-can==4.6.1
    program=${SERVOSCOPE_OPTIMISED:-$SERVOSCOPE}
    exec env SERVOSCOPE="$program" SERVOSCOPE_VENV="$venv" \
        "$SERVOSCOPE_SOURCE/scripts/with-vcan" -t 200 bash "${BASH_SOURCE[0]}" inside
fi
subcommand=drive
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

inertia=0.005
printf '{"structure": "rigid", "motor_inertia_kgm2": %s, "load_inertia_kgm2": 0, "viscous_friction_Nms_per_rad": 0,
 "coulomb_friction_Nm": 0, "torque_lag_s": 0, "dead_time_s": 0, "sample_rate_hz": 1000,
 "controller": {"position_gain_per_s": 20, "velocity_gain_Nms_per_rad": 0.2, "velocity_integral_time_s": 0.5},
 "sensors": {"counts_per_rev": 1048576, "position_noise_rad": 0, "velocity_noise_rad_per_s": 0, "torque_noise_Nm": 0},
 "process_noise_Nm": 0, "seed": 1}\n' $inertia >model.json
"$SERVOSCOPE" drive --model model.json --can vcan0 --period-tolerance 0.5 >drive.txt 2>drive.err &
drive=$!
for _ in {1..100}; do
    ! grep -q '^node' drive.txt || break
    sleep 0.1
done
"$SERVOSCOPE_VENV/bin/python" "$SERVOSCOPE_SOURCE/tests/foreign/canopen_402.py" vcan0 \
    "$SERVOSCOPE_SOURCE/sim/node/servoscope-drive.eds" $inertia || fail "the client failed; drive: $(cat drive.txt drive.err)"
kill -INT "$drive"
wait "$drive" || fail "drive: $(cat drive.err)"
[ "$failures" -eq 0 ]
