#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# lib/ and the tables that design writes as .h, without one warning: C99, C11 and C++, gcc and clang, 64 and 32 bits, every option
# of core/config.h at another value.
set -euo pipefail
: "${SERVOSCOPE_SOURCE:?}" "${SERVOSCOPE:?}"
source=$SERVOSCOPE_SOURCE
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
warnings=(-Wall -Wextra -Wpedantic -Wshadow -Wundef -Wconversion -Wsign-conversion -Wdouble-promotion -Werror -O2)
# All that clang has, but for: padding, C90's order of declarations, a cast around a call, guards that nobody looks at, a default
# beside all values of an enumeration (they come from bytes and from memory that may be damaged).
everything=(-Weverything -Wno-padded -Wno-declaration-after-statement -Wno-bad-function-cast -Wno-unused-macros -Wno-unknown-warning-option
    -Wno-unsafe-buffer-usage -Wno-switch-default -Wno-covered-switch-default)
clang=$(command -v clang-14 || command -v clang || true)
if [ -z "$clang" ] || ! command -v i686-linux-gnu-gcc >/dev/null; then
    echo "clang or i686-linux-gnu-gcc is not here; left out" >&2
    exit 77
fi
options=(-DSERVOSCOPE_REAL_BITS=32 -DSERVOSCOPE_FRF_LONG_MULTIPLY=0 -DSERVOSCOPE_FRF_CHANNELS_MAX=1 -DSERVOSCOPE_FRF_CHANNELS_MAX=8
    -DSERVOSCOPE_FRF_PERIOD_MAX=4 -DSERVOSCOPE_FRF_BINS_MAX=1 -DSERVOSCOPE_TABLE_SAMPLES_MAX=4 -DSERVOSCOPE_FRF_BLOCK=8)
count=0

compile() { # compile COMPILER FLAGS... FILE
    "$@" -c -o /dev/null
    count=$((count + 1))
}

"$source/scripts/amalgamate" --output . msgen frf guard >/dev/null
pair=servoscope_msgen_frf_guard.c
for standard in c99 c11; do
    compile gcc -std=$standard "${warnings[@]}" -Wstrict-prototypes -Wmissing-prototypes "$pair"
    compile "$clang" -std=$standard "${warnings[@]}" "${everything[@]}" "$pair"
done
compile g++ -std=c++14 "${warnings[@]}" -x c++ "$pair"
compile "$clang" -std=c++17 "${warnings[@]}" -x c++ "$pair"
compile i686-linux-gnu-gcc -std=c99 "${warnings[@]}" "$pair"
compile "$clang" --target=i686-linux-gnu -isystem /usr/i686-linux-gnu/include -std=c99 "${warnings[@]}" "${everything[@]}" "$pair"
for option in "${options[@]}"; do
    compile gcc -std=c99 "${warnings[@]}" -fsyntax-only "$option" "$pair"
done
# A value out of range stops the compiler.
for option in -DSERVOSCOPE_REAL_BITS=16 -DSERVOSCOPE_FRF_LONG_MULTIPLY=2 -DSERVOSCOPE_FRF_CHANNELS_MAX=9 -DSERVOSCOPE_FRF_PERIOD_MAX=65537 \
    -DSERVOSCOPE_FRF_BINS_MAX=0 -DSERVOSCOPE_TABLE_SAMPLES_MAX=3 -DSERVOSCOPE_FRF_BLOCK=7; do
    if gcc -std=c99 -fsyntax-only "$option" "$pair" 2>log; then
        echo "$option: expected the compiler to refuse it" >&2
        exit 1
    fi
    grep -q "^.*error: .*${option:2:12}" log || {
        cat log >&2
        exit 1
    }
done

# Generated tables: a name that is no C name, three channels.
"$SERVOSCOPE" design --rate 1000 --period 500 --lines linear:2:40:2 --limit-velocity 2 --limit-torque 1 --inertia 0.01 \
    --method schroeder --quiet --out '7-my table'
cat >plays.c <<'END'
#include "7-my table.h"
#include "core/status.h"
#include "msgen/table.h"

int main(void)
{
    struct msgen_table table;
    return msgen_table_open(table_7_my_table_mst, TABLE_7_MY_TABLE_BYTES, &table) == core_ok &&
                   table.header_crc32 == TABLE_7_MY_TABLE_CRC32 && table.period_samples == TABLE_7_MY_TABLE_PERIOD_SAMPLES
               ? 0
               : 1;
}
END
for compiler in gcc "$clang"; do
    for standard in c99 c11; do
        compile "$compiler" -std=$standard "${warnings[@]}" -Wstrict-prototypes -Wmissing-prototypes -I "$source/lib" plays.c
    done
    for standard in c++14 c++20; do
        compile "$compiler" -std=$standard "${warnings[@]}" -I "$source/lib" -x c++ plays.c
    done
done
gcc -std=c99 -I "$source/lib" plays.c "$pair" -I . -lm -o plays
./plays
echo "$count builds without a warning"
