#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Frama-C's Eva over lib/: for every value that the drivers of tests/frama-c leave open there is no undefined behaviour (overflow,
# access outside, uninitialised, division). An alarm fails. Tables' making (math.h) and the kernels in assembly are left to tests.
# usage: ./run bench frama-c [DRIVER...]      (table takes four minutes, the others one together)
set -euo pipefail
cd "$(dirname "$0")/.."
command -v frama-c >/dev/null || {
    echo "frama-c is not here (Debian: frama-c-base)" >&2
    exit 77
}
log=$(mktemp)
trap 'rm -f "$log"' EXIT
declare -A sources=(
    [crc]='lib/core/*.c'
    [guard]='lib/guard/*.c lib/core/status.c'
    [table]='lib/msgen/table.c lib/core/crc32.c'
    [player]='lib/msgen/player.c lib/msgen/table.c lib/core/crc32.c'
    [dft]='lib/frf/dft.c lib/frf/dft_q15.c lib/frf/dft_q31.c lib/frf/dft_i16.c lib/frf/dft_by_twos.c'
    [twiddle]='lib/frf/dft.c lib/frf/dft_i16.c lib/frf/dft_i24.c lib/frf/dft_q23.c lib/frf/dft_quarter_q*.c lib/frf/dft_two_level_q*.c'
    [block]='lib/frf/block.c lib/frf/block_kernel.c'
)
# Loops of the numeric drivers are followed one by one; what a sample's value decides (rails, marks) is joined where it is decided,
# or every sample would double what has to be followed. The guard's driver has any number of samples, joined.
declare -A options=(
    [dft]='-eva-slevel 300 -eva-slevel-function frf_dft_add_i16:0,frf_dft_mark:0 -eva-min-loop-unroll 70'
    [twiddle]='-eva-slevel 300 -eva-slevel-function frf_dft_add_i16:0,look_at:0,frf_dft_mark:0 -eva-min-loop-unroll 70'
    [block]='-eva-slevel 50 -eva-min-loop-unroll 40
        -eva-slevel-function count_saturated:0,frf_block_mark:0,frf_block_skip:0,frf_block_add_i16:0'
    [table]='-eva-slevel 1000 -eva-slevel-function main:3000,open_all:3000,open:0,core_crc32:0 -eva-auto-loop-unroll 7'
)
[ $# -gt 0 ] || set -- crc guard table player dft twiddle block
status=0
for driver in "$@"; do
    read -ra files < <(eval "echo ${sources[$driver]}")
    read -ra extra < <(echo ${options[$driver]:-})
    timeout 1800 frama-c -eva -eva-precision 2 -eva-split-return full -eva-no-print -warn-special-float none -machdep gcc_x86_64 \
        "${extra[@]}" -cpp-extra-args='-Ilib -I. -DSERVOSCOPE_MEMORY_BARRIER\(\)=' "tests/frama-c/drive_$driver.c" "${files[@]}" \
        >"$log" 2>&1 || {
        tail -n 5 "$log" >&2
        status=1
    }
    alarms=$(grep -c 'eva:alarm' "$log" || true)
    summary=$(sed -n 's/^ *\([0-9]* functions analyzed\).*/\1/p; s/^ *In these functions, \(.*coverage\)\./\1/p' "$log" | paste -sd ',')
    printf 'frama-c %-8s %s alarms; %s\n' "$driver" "$alarms" "${summary:-no result}"
    if [ "$alarms" -gt 0 ] || [ -z "$summary" ]; then
        grep -A2 'eva:alarm' "$log" | head -n 20 >&2 || true
        status=1
    fi
done
exit "$status"
