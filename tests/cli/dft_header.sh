#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# `servoscope design --dft-header`: const tables that compile without a warning as C99 and C++, are what the library builds itself to the
# last bit, and run as they lie there; refusals.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
source=$SERVOSCOPE_SOURCE
warnings=(-Wall -Wextra -Wpedantic -Wshadow -Wundef -Wconversion -Wsign-conversion -Werror)

# Compares with what the library makes of the same lines, then measures with a table in read-only memory.
cat >check.c <<'END_OF_C'
#include HEADER
#include "frf/block.h"
#include "frf/dft.h"

#include <stdio.h>
#include <string.h>

#define JOIN_(a, b) a##b
#define JOIN(a, b)  JOIN_(a, b)
#define N           JOIN(UPPER, _PERIOD_SAMPLES)
#define K           JOIN(UPPER, _BIN_COUNT)
#define IT(what)    JOIN(LOWER, what)

static int16_t frames[2 * N];

#ifdef HAS_BLOCK
#define L JOIN(UPPER, _BLOCK_SAMPLES)
#define R JOIN(UPPER, _BLOCK_TERMS)
#define Q JOIN(UPPER, _BLOCK_REPEATS)
static int32_t built[FRF_BLOCK_TABLE_WORDS(K, L, R)], storage[FRF_BLOCK_STORAGE_WORDS(K, 1u, 1u, L, R)];
static int32_t part[FRF_BLOCK_PART_WORDS(1u, N, Q)];

static int measure(const struct frf_block_table *table, int64_t *out_sums)
{
    struct frf_block dft;
    struct frf_block_period period;
    struct frf_block_config config;
    memset(&config, 0, sizeof config);
    config.table = table;
    config.channels = config.banks = 1;
    config.storage = storage;
    config.storage_words = sizeof storage / sizeof *storage;
    config.part = part;
    config.part_words = sizeof part / sizeof *part;
    if (frf_block_init(&dft, &config) != core_ok) {
        return 0;
    }
    frf_block_add_i16(&dft, frames, N);
    if (!frf_block_latest(&dft, &period) || period.reasons != 0) {
        return 0;
    }
    for (uint32_t b = 0; b < K; ++b) {
        frf_block_sums(&dft, &period, b, 0, out_sums + 2 * b, out_sums + 2 * b + 1);
    }
    return 1;
}

static int check(void)
{
    static int64_t from_flash[2 * K], from_memory[2 * K];
    struct frf_block_layout layout = {L, R, Q};
    struct frf_block_table table;
    return sizeof built == sizeof IT(_coefficients) &&
           frf_block_build(built, sizeof built / sizeof *built, IT(_bins), K, N, &layout, &table) == core_ok &&
           memcmp(built, IT(_coefficients), sizeof built) == 0 && measure(&IT(_block_table), from_flash) &&
           measure(&table, from_memory) && memcmp(from_flash, from_memory, sizeof from_flash) == 0;
}
#else
static union frf_word words[FRF_STORAGE_WORDS(K, 1u)];

static int check(void)
{
    static int16_t q15[FRF_TWIDDLE_WORDS(N)];
    static int32_t q31[FRF_TWIDDLE_WORDS(N)];
    struct frf_twiddles_q15 table_q15;
    struct frf_twiddles_q31 table_q31;
    struct frf_dft_config config = {IT(_bins), K, 1, words, sizeof words / sizeof *words, 0, 0};
    struct frf_dft dft;
    struct frf_period period;
    int64_t real;
    if (frf_twiddles_build_q15(q15, FRF_TWIDDLE_WORDS(N), N, &table_q15) != core_ok ||
        frf_twiddles_build_q31(q31, FRF_TWIDDLE_WORDS(N), N, &table_q31) != core_ok ||
        memcmp(q15, IT(_sines_q15), sizeof q15) != 0 || memcmp(q31, IT(_sines_q31), sizeof q31) != 0 ||
        frf_dft_init_q15(&dft, &config, &IT(_twiddles_q15)) != core_ok) {
        return 0;
    }
    frf_dft_add_i16(&dft, frames, N);
    if (!frf_dft_latest(&dft, &period)) {
        return 0;
    }
    real = frf_period_real(&dft, &period, 0, 0);
    if (frf_dft_init_q31(&dft, &config, &IT(_twiddles_q31)) != core_ok) {
        return 0;
    }
    frf_dft_add_i16(&dft, frames, N);
    /* Q31 is Q15 with 16 more bits: the same but for Q15's rounding, half a unit a sample. */
    return frf_dft_latest(&dft, &period) && real != 0 &&
           frf_period_real(&dft, &period, 0, 0) / 65536 - real < 32768 * (int64_t)N &&
           real - frf_period_real(&dft, &period, 0, 0) / 65536 < 32768 * (int64_t)N;
}
#endif

int main(void)
{
    uint32_t state = 1;
    for (uint32_t i = 0; i < N; ++i) {
        state = state * 1664525u + 1013904223u;
        frames[i] = (int16_t)((int32_t)(state >> 17) - 16384);
    }
    if (!check()) {
        puts("the header's tables are not the library's, or do not run");
        return 1;
    }
    return 0;
}
END_OF_C

design() { # design NAME KINDS LINES PERIOD
    "$SERVOSCOPE" design --rate 8000 --period "$4" --lines "$3" --limit-torque 1 --inertia 0.01 --method schroeder --quiet \
        --dft-header "$2" --out "$1"
}

check() { # check NAME DEFINITION...: $1-dft.h, of which C makes $1_dft
    local upper=${1^^} names
    names=(-DHEADER="\"$1-dft.h\"" -DUPPER="${upper}_DFT" -DLOWER="$1_dft" "${@:2}")
    cc -std=c99 "${warnings[@]}" -Wstrict-prototypes -Wmissing-prototypes "${names[@]}" -I. -I "$source/lib" check.c \
        "$source"/lib/core/*.c "$source"/lib/frf/*.c -lm -o "$1-c"
    "./$1-c"
    # Alone, as C++ too: the header's own includes are enough, and nothing in it is C only.
    printf '#include "%s-dft.h"\nint main() { return %s_dft_bins[0] == 0; }\n' "$1" "$1" >"$1.cpp"
    local standard
    for standard in c++14 c++20; do
        c++ -std=$standard "${warnings[@]}" -I "$source/lib" "$1.cpp" -o "$1-cpp"
    done
    printf '#include "%s-dft.h"\nint main(void) { return %s_dft_bins[0] == 0; }\n' "$1" "$1" >"$1.c"
    cc -std=c99 "${warnings[@]}" -I "$source/lib" "$1.c" -o "$1-alone"
}

expect_layout() { # expect_layout NAME L R Q
    local macro=${1^^}_DFT_BLOCK
    grep -q "^#define ${macro}_SAMPLES  $2u\$" "$1-dft.h" && grep -q "^#define ${macro}_TERMS    $3u\$" "$1-dft.h" &&
        grep -q "^#define ${macro}_REPEATS  $4u\$" "$1-dft.h" || {
        grep '^#define' "$1-dft.h" >&2
        echo "$1: expected a layout of $2, $3, $4" >&2
        exit 1
    }
}

design wide block linear:40:3600:40 2000
expect_layout wide 32 32 1
check wide -DHAS_BLOCK
design low block linear:4:800:4 2000 # a basis that all lines share
grep -q '/\* basis \*/' low-dft.h
check low -DHAS_BLOCK
design odd folded odd:4:3996:4 2000
expect_layout odd 32 32 2
check odd -DHAS_BLOCK
design sines q15,q31 linear:100:1000:100 80
check sines
design everything q31,folded,q15 odd:4:800:4 2000
check everything -DHAS_BLOCK

refuse() { # refuse STATUS PART_OF_MESSAGE ARGUMENT...
    local status=0
    design "${@:3}" 2>log || status=$?
    if [ "$status" -ne "$1" ] || ! grep -qF -- "$2" log; then
        cat log >&2
        echo "expected status $1 and '$2', got $status" >&2
        exit 1
    fi
    if [ -e "$3.mst" ] || [ -e "$3-dft.h" ]; then
        echo "$3: expected nothing to be written" >&2
        exit 1
    fi
}
refuse 2 "--dft-header: 'block,q16': expected block, folded, q15, q31" none block,q16 linear:100:1000:100 80
refuse 2 "--dft-header: 'block,': expected block" none block, linear:100:1000:100 80
refuse 2 "--dft-header: 'block,folded': expected block or folded, not both" none block,folded linear:100:1000:100 80
refuse 2 "--dft-header is for a single table" none block octaves:10:1000:10 2000
refuse 1 "none-dft.h: a period of 50 samples has no blocks: expected 64 to 65536" none block linear:800:3200:800 50
refuse 1 "none-dft.h: a period of 80000 samples: expected at most 65536" none q15 linear:10:100:10 80000
