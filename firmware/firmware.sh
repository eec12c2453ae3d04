#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Builds the example and the counting program for Cortex-M0, M3, M4F and M7, runs them under QEMU, compares their results with
# the host's, and prints instructions, flash, RAM and stack with the change against firmware/ceilings.txt.
# usage: SERVOSCOPE=PROGRAM firmware/firmware.sh FOLDER [--short] [--accept] [--document]
#   FOLDER      where everything is built
#   --short     Cortex-M0 and M4F only
#   --accept    writes the measured numbers as the new ceilings
#   --document  writes the tables of docs/firmware.md
set -euo pipefail
folder=$(realpath -m "${1:?usage: firmware/firmware.sh FOLDER [--short] [--accept] [--document]}")
shift
cd "$(dirname "$0")/.."
: "${SERVOSCOPE:?expected the path of the program}"
cores=(cortex-m0 cortex-m3 cortex-m4f cortex-m7)
report=()
for option in "$@"; do
    case $option in
    --short) cores=(cortex-m0 cortex-m4f) ;;
    --accept | --document) report+=("$option") ;;
    *)
        printf 'firmware: %s: expected --short, --accept or --document\n' "$option" >&2
        exit 2
        ;;
    esac
done
tables=$folder/tables
mkdir -p "$tables/expected_stream" "$tables/expected_example"

quietly() { # quietly COMMAND...: shows what it said only if it fails
    local log
    log=$("$@" 2>&1) || {
        printf '%s\n' "$log" >&2
        return 1
    }
}

# The measurement as an engineer would design it: 32 lines to 640 Hz for a belt drive, played at 8 kHz.
cat >"$tables/model.json" <<'END'
{"structure": "two_mass", "motor_inertia_kgm2": 0.002, "load_inertia_kgm2": 0.003, "belt_stiffness_Nm_per_rad": 600,
 "belt_damping_Nms_per_rad": 0.4, "viscous_friction_Nms_per_rad": 0.02, "coulomb_friction_Nm": 0.05, "torque_lag_s": 0.0002,
 "sample_rate_hz": 8000}
END
quietly "$SERVOSCOPE" design --rate 8000 --period 2000 --lines linear:20:640:20 --limit-torque 1 --limit-velocity 15 \
    --inertia 0.005 --iterations 50 --threads 1 --dft-header block,q15,q31 --out "$tables/excitation"
quietly "$SERVOSCOPE" simulate --model "$tables/model.json" --table "$tables/excitation.mst" --periods 3 --out "$tables/run.csv"

host=(cc -std=c11 -O2 -ffp-contract=off -fno-math-errno -Wall -Wextra -Wpedantic -Werror -DSERVOSCOPE_REAL_BITS=32
    -I. -Ilib -I"$tables")
library=(lib/core/*.c lib/msgen/*.c lib/frf/*.c lib/guard/*.c)
python3 firmware/record.py "$tables/run.csv" >"$tables/recording.h"

# What the target has to come to.
on_host=(firmware/board_host.c firmware/print.c firmware/expected_write.c firmware/sample_path.c "${library[@]}")
# The masters' halves are for hosts; of the rest the linker takes what is needed.
mapfile -t protocols < <(find drivers/can drivers/modbus -name '*.c' ! -name '*master*' ! -name '*setup*' ! -name host.c \
    ! -name table_player.c -printf "$PWD/%p\n")
rm -rf "$tables/objects" "$tables/protocols.a"
mkdir "$tables/objects"
(cd "$tables/objects" && "${host[@]}" -I"$OLDPWD" -I"$OLDPWD/lib" -c "${protocols[@]}" && ar rcs ../protocols.a ./*.o)
"${host[@]}" firmware/stream.c "${on_host[@]}" -lm -o "$tables/stream"
"${host[@]}" firmware/main.c firmware/axis.c firmware/belt.c firmware/results.c firmware/{can,modbus}_door.c "${on_host[@]}" "$tables/protocols.a" -lm \
    -o "$tables/example"
FIRMWARE_EXPECTED=$tables/expected_stream/expected_values.h "$tables/stream" >"$tables/stream.txt"
FIRMWARE_EXPECTED=$tables/expected_example/expected_values.h "$tables/example" >"$tables/example.txt"

build() { # build CORE
    quietly cmake -S . -B "$folder/$1" -G Ninja -DCMAKE_TOOLCHAIN_FILE="$PWD/cmake/toolchains/$1.cmake" -DSERVOSCOPE_HOST=OFF \
        -DSERVOSCOPE_TESTS=OFF -DCMAKE_BUILD_TYPE=Release -DCMAKE_C_FLAGS_RELEASE=-O2 -DFIRMWARE_TABLES="$tables"
    quietly cmake --build "$folder/$1" -j 2
}

run() { # run MACHINE SHIFT IMAGE OUTPUT
    local status=0
    timeout 120 qemu-system-arm -M "$1" -icount "shift=$2,sleep=off" -display none -monitor none -serial none \
        -chardev stdio,id=out -semihosting-config enable=on,target=native,chardev=out -kernel "$3" >"$4" || status=$?
    [ "$status" -eq 0 ] || {
        tail -n 20 "$4" >&2
        printf 'firmware: %s on %s ended with status %s\n' "${3##*/}" "$1" "$status" >&2
        return 1
    }
}

same() { # same CORE IMAGE: what the target has printed is what the host has, but for what only a target can say
    diff <(grep -v 'instructions\|^compared\|^heartbeats\|^modbus_requests' "$tables/$2.txt") <(grep -v 'instructions\|^compared\|^heartbeats\|^modbus_requests' "$folder/$1/$2.txt") >&2 || {
        printf 'firmware: %s on %s and on the host differ\n' "$2" "$1" >&2
        return 1
    }
    printf '%-11s %-8s %s\n' "$1" "$2" "$(grep '^compared' "$folder/$1/$2.txt")"
}

# An instruction takes 2^shift ns of the simulated time: 15.6 million a second at 6, as on a slow controller. What needs more than
# that at 8 kHz runs on a faster one: three transforms at once, soft floating point.
declare -A machine=([cortex-m0]=microbit [cortex-m3]=mps2-an385 [cortex-m4f]=mps2-an386 [cortex-m7]=mps2-an500)
declare -A counter=([cortex-m0]=mps2-an385 [cortex-m3]=mps2-an385 [cortex-m4f]=mps2-an386 [cortex-m7]=mps2-an500)
shift_of() { sed -n 's/.*FIRMWARE_INSTRUCTION_SHIFT \([0-9]*\).*/\1/p' "cmake/toolchains/$1.cmake"; }
for core in "${cores[@]}"; do
    build "$core"
    run "${machine[$core]}" 0 "$folder/$core/firmware/stream.elf" "$folder/$core/stream.txt"
    same "$core" stream
    run "${counter[$core]}" 6 "$folder/$core/firmware/count.elf" "$folder/$core/count.txt"
    if [ "$core" != cortex-m0 ]; then
        run "${machine[$core]}" "$(shift_of "$core")" "$folder/$core/firmware/example.elf" "$folder/$core/example.txt"
        same "$core" example
    fi
done
firmware/report.py "$folder" "${report[@]}" "${cores[@]}"
