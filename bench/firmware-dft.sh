#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The DFT at the excited bins on Cortex-M4 and M0+: instructions per sample, bin and channel, counted under QEMU (mps2-an386, every
# instruction 64 ns), beside what is required; the longest call; RAM, tables, code. The sums of host, M4 and M0+ have to be the same
# to the last bit. The M0+ build runs on the M4 model, which executes ARMv6-M as it is.
# usage: ./run bench firmware-dft
set -euo pipefail
cd "$(dirname "$0")/.."
: "${SERVOSCOPE_BUILD:?run this as ./run bench firmware-dft}"
folder=$SERVOSCOPE_BUILD/firmware-dft
mkdir -p "$folder"
warnings=(-Wall -Wextra -Wpedantic -Wshadow -Wundef -Wstrict-prototypes -Wmissing-prototypes -Wconversion -Wsign-conversion -Werror)
sources=(bench/firmware_dft.c lib/frf/*.c lib/core/status.c)

cc -std=c11 -O2 "${warnings[@]}" -Ilib -I. "${sources[@]}" bench/firmware_port_host.c -lm -o "$folder/host"
"$folder/host" >"$folder/host.txt"

count() { # count CPU
    local vectors=0 code=0x100 data=0x20000000
    arm-none-eabi-gcc -std=c11 -O2 -mthumb -mcpu="$1" -ffunction-sections -fdata-sections "${warnings[@]}" -Ilib -I. "${sources[@]}" \
        bench/firmware_port_mps2.c -nostartfiles --specs=nosys.specs -Wl,--gc-sections,-u,port_vectors,-e,port_reset \
        -Wl,--section-start=.vectors="$vectors",-Ttext="$code",-Tdata="$data" -lm -o "$folder/$1.elf"
    timeout 300 qemu-system-arm -M mps2-an386 -icount shift=6,sleep=off -display none -monitor none -serial none \
        -chardev stdio,id=out -semihosting-config enable=on,target=native,chardev=out -kernel "$folder/$1.elf" >"$folder/$1.txt"
}
count cortex-m4
count cortex-m0plus
python3 - "$folder" <<'PY'
import pathlib
import subprocess
import sys

folder = pathlib.Path(sys.argv[1])
NAMES = ("channels", "at_once", "by_frames", "longest", "spread", "products", "ram", "table", "sum_1", "sum_2")
REQUIRED_M4 = {"any-32": 2.5, "below-0.1": 1.0, "below-0.02-128": 0.4}
REQUIRED_M0 = {"exact-q15": 25.0}
OTHER_TABLES = ("quarter", "two-level")


def read(name):
    rows = {}
    for line in (folder / f"{name}.txt").read_text(encoding="utf-8").splitlines():
        case, *values = line.split()
        row = dict(zip(NAMES, map(int, values)))
        rows[case, row["channels"]] = row
    return rows


def required(case, limits):
    at_200 = (case.endswith("K200") or case.startswith("exact")) and not case.endswith(OTHER_TABLES)
    return next((limit for start, limit in limits.items() if at_200 and case.startswith(start)), None)


def report(title, rows, limits):
    failed = 0
    print(f"\n{title}, instructions per sample, bin and channel\n{'':22}{'chan.':>6}{'required':>9}{'blocks':>9}{'frames':>9}"
          f"{'longest':>10}{'spread':>9}{'RAM B':>7}{'table B':>9}")
    for (case, channels), row in rows.items():
        limit, measured = required(case, limits), row["at_once"] / row["products"]
        late = limit is not None and measured > limit
        failed += late
        print(f"{case:22}{channels:6}{'' if limit is None else limit:>9}{measured:9.3f}{row['by_frames'] / row['products']:9.3f}"
              f"{row['longest']:10}{row['spread']:9}{row['ram']:7}{row['table']:9}{'   TOO MANY' if late else ''}")
    return failed


host, m4, m0 = read("host"), read("cortex-m4"), read("cortex-m0plus")
failures = report("Cortex-M4", m4, REQUIRED_M4)
failures += report("Cortex-M0+", {key: row for key, row in m0.items() if key[0].startswith("exact")}, REQUIRED_M0)
print("\nblocks: a period fed at once; frames: fed frame by frame, the call included; longest: instructions of the longest call of "
      "one frame;\nspread: the same with the work spread over the next block. Line sets: 'any' below 0.45 of the sample rate.")
sizes = subprocess.run(["arm-none-eabi-nm", "--print-size", "--size-sort", folder / "cortex-m4.elf"], check=True, capture_output=True,
                       text=True).stdout
code = sum(int(line.split()[1], 16) for line in sizes.splitlines() if line.split()[-1].startswith("frf_block")
           and "build" not in line and "choose" not in line and "portable" not in line)
print(f"public functions of the block DFT on Cortex-M4, without the tables' making: {code} bytes of code")
for name, rows in (("Cortex-M4", m4), ("Cortex-M0+", m0)):
    different = [key for key, row in host.items() if (row["sum_1"], row["sum_2"]) != (rows[key]["sum_1"], rows[key]["sum_2"])]
    print(f"sums on {name} and host: {'the same in all ' + str(len(host)) + ' cases' if not different else different}")
    failures += len(different)
sys.exit(failures > 0)
PY
