#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The library on Cortex-M0 and M4F under QEMU: the images' results are the host's to the last bit, the response measured in the
# image is the simulated drive's, and nothing costs more than firmware/ceilings.txt says. ./run firmware is the same on all cores.
set -euo pipefail
for tool in arm-none-eabi-gcc qemu-system-arm ninja; do
    command -v "$tool" >/dev/null || {
        echo "$tool is not here; ./run test installs it where it can"
        exit 77
    }
done
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$SERVOSCOPE_SOURCE/firmware/firmware.sh" "$folder" --short

# The gates can fail: a ceiling below what is measured, and a result that is not the host's.
report=("$SERVOSCOPE_SOURCE/firmware/report.py" "$folder" cortex-m0)
sed 's/^\(instructions  *guard_step  *\)[0-9]*/\11/' "$SERVOSCOPE_SOURCE/firmware/ceilings.txt" >"$folder/ceilings.txt"
if arm-none-eabi-gcc -dumpfullversion | grep -q '^12\.2' && "${report[@]}" --ceilings "$folder/ceilings.txt" >"$folder/out" 2>&1; then
    echo "expected a guard_step of more than 1 instruction to be above its ceiling" >&2
    exit 1
fi
