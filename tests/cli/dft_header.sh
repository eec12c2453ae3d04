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
static const struct frf_dft_config config = {IT(_bins), K, 1, words, sizeof words / sizeof *words, 0, 0};

/* What is built equals what is in flash, and what is in flash runs. */
#define CHECK(kind, init, number, word, words_of)                                                                      \
    static int check_##kind##_##number(struct frf_dft *dft)                                                            \
    {                                                                                                                  \
        static word built[words_of(N)];                                                                                \
        struct frf_##kind##_##number table;                                                                            \
        return frf_##kind##_build_##number(built, words_of(N), N, &table) == core_ok &&                                \
               sizeof built == sizeof IT(JOIN(SINES_##kind, number)) &&                                                \
               memcmp(built, IT(JOIN(SINES_##kind, number)), sizeof built) == 0 &&                                     \
               IT(_##kind##_##number).sine - IT(JOIN(SINES_##kind, number)) == table.sine - built &&                   \
               SAME_##kind(IT(_##kind##_##number), table) &&                                                           \
               frf_dft_init_##init(dft, &config, &IT(_##kind##_##number)) == core_ok;                                  \
    }
#define SINES_twiddles          _sines_
#define SINES_quarter           _quarter_sines_
#define SAME_twiddles(a, b)     ((a).period_samples == (b).period_samples && (a).cosine - (a).sine == (b).cosine - (b).sine)
#define SAME_quarter(a, b)                                                                                             \
    ((a).period_samples == (b).period_samples && (a).quarter_steps == (b).quarter_steps &&                             \
     (a).sample_steps == (b).sample_steps)
CHECK(twiddles, q15, q15, int16_t, FRF_TWIDDLE_WORDS)
CHECK(twiddles, q23, q23, int32_t, FRF_TWIDDLE_WORDS)
CHECK(twiddles, q31, q31, int32_t, FRF_TWIDDLE_WORDS)
CHECK(quarter, quarter_q15, q15, int16_t, FRF_QUARTER_WORDS)
CHECK(quarter, quarter_q23, q23, int32_t, FRF_QUARTER_WORDS)
CHECK(quarter, quarter_q31, q31, int32_t, FRF_QUARTER_WORDS)

/* A sum over the samples, or over them as 24-bit ones, 256 times as large. */
static double sum_of(struct frf_dft *dft, int is_q23)
{
    static int32_t wide[N];
    struct frf_period period;
    if (is_q23) {
        for (uint32_t i = 0; i < N; ++i) {
            wide[i] = frames[i] * 256;
        }
        frf_dft_add_i24(dft, wide, N);
    } else {
        frf_dft_add_i16(dft, frames, N);
    }
    return frf_dft_latest(dft, &period) ? (double)frf_period_real(dft, &period, 0, 0) : 0;
}

static int check(void)
{
    struct frf_dft dft;
    double sums[6];
    if (!check_twiddles_q15(&dft)) {
        return 0;
    }
    sums[0] = sum_of(&dft, 0);
    if (!check_quarter_q15(&dft)) {
        return 0;
    }
    sums[1] = sum_of(&dft, 0);
    if (!check_twiddles_q31(&dft)) {
        return 0;
    }
    sums[2] = sum_of(&dft, 0) / 65536;
    if (!check_quarter_q31(&dft)) {
        return 0;
    }
    sums[3] = sum_of(&dft, 0) / 65536;
    if (!check_twiddles_q23(&dft)) {
        return 0;
    }
    sums[4] = sum_of(&dft, 1) / 65536;
    if (!check_quarter_q23(&dft)) {
        return 0;
    }
    sums[5] = sum_of(&dft, 1) / 65536;
    for (unsigned i = 1; i < 6; ++i) {
        /* Apart by the rounding of Q15's factors at most, half a unit a sample. */
        if (!(sums[i] - sums[0] < 16384.0 * N && sums[0] - sums[i] < 16384.0 * N) || !(sums[0] < 0 || sums[0] > 0)) {
            return 0;
        }
    }
    return 1;
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
design sines quarter-q31,q15,quarter-q23,q31,q23,quarter-q15 linear:100:1000:100 80
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
refuse 2 "--dft-header: 'block,q16': expected block or folded, q15, q23, q31, quarter-q15" none block,q16 linear:100:1000:100 80
refuse 2 "--dft-header: 'block,': expected block or folded" none block, linear:100:1000:100 80
refuse 2 "--dft-header: 'block,folded': expected block or folded, not both" none block,folded linear:100:1000:100 80
refuse 2 "--dft-header is for a single table" none block octaves:10:1000:10 2000
refuse 1 "none-dft.h: a period of 50 samples has no blocks: expected 64 to 65536" none block linear:800:3200:800 50
refuse 1 "none-dft.h: a period of 80000 samples: expected at most 65536" none q15 linear:10:100:10 80000
