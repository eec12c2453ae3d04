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

# What looks for a heap, for floating point and for recursion finds them.
python3 - "$SERVOSCOPE_SOURCE/firmware" "$folder/cortex-m4f/firmware/example.elf" <<'END'
import sys

sys.path.insert(0, sys.argv[1])
sys.dont_write_bytecode = True
import report

names = [line.split()[-1] for line in report.run("arm-none-eabi-nm", sys.argv[2]).splitlines()]
assert any(report.FLOAT.match(name) for name in names), "no soft-float call seen in an image that calculates in double"
assert all(report.HEAP.match(name) for name in ("malloc", "_malloc_r", "_sbrk", "free")), "a heap would not be seen"
try:
    report.deepest("a", {"a": 8, "b": 8}, {"a": {"b"}, "b": {"a"}}, set(), {})
except SystemExit as stop:
    assert "recursion: a -> b -> a" in str(stop), stop
else:
    raise AssertionError("a calls b calls a, and nobody minds")
assert report.deepest("a", {"a": 8, "b": 16, "c": 4}, {"a": {"b", "c"}}, set(), {}) == 24
END

# One bit of what the host has come to is turned over in the image.
python3 - "$folder/tables/expected_stream/expected_values.h" "$folder/cortex-m4f/firmware/stream.elf" "$folder/wrong.elf" <<'END'
import re
import struct
import sys

words = [int(word, 16) for word in re.findall(r"0x[0-9a-f]+", open(sys.argv[1], encoding="utf-8").read())]
image = bytearray(open(sys.argv[2], "rb").read())
at = image.find(struct.pack("<8I", *words[:8]))
assert at >= 0, "the image does not hold the expected values"
image[at] ^= 1
open(sys.argv[3], "wb").write(image)
END
status=0
timeout 120 qemu-system-arm -M mps2-an386 -icount shift=0,sleep=off -display none -monitor none -serial none \
    -chardev stdio,id=out -semihosting-config enable=on,target=native,chardev=out -kernel "$folder/wrong.elf" >"$folder/out" || status=$?
if [ "$status" -ne 2 ] || ! grep -q ' 1 different' "$folder/out"; then
    echo "expected status 2 and one difference, have status $status: $(tail -n 1 "$folder/out")" >&2
    exit 1
fi
