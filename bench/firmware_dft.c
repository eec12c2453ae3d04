/* SPDX-License-Identifier: MIT */
/* What the DFT at the excited bins costs on a Cortex-M, counted; the same program on the host gives the same sums.
 * Prints a line a case: name, channels, instructions (a period fed at once, a period fed frame by frame, the longest
 * call of one frame, the same with the work spread), samples times bins times channels, RAM and table bytes, and a
 * checksum of all sums. */
#include "bench/firmware_port.h"

#include "frf/block.h"

#define PERIOD_MAX   16384u
#define BINS_MAX     200u
#define CHANNELS_MAX 2u

static int32_t coefficients[FRF_BLOCK_TABLE_WORDS(BINS_MAX, 128u, 128u)];
static int32_t storage[FRF_BLOCK_STORAGE_WORDS(BINS_MAX, CHANNELS_MAX, 1u, 128u, 64u) +
                       FRF_BLOCK_SPREAD_WORDS(CHANNELS_MAX, 128u)];
static int32_t part[FRF_BLOCK_PART_WORDS(CHANNELS_MAX, 2000u, 2u)];
static union frf_word words[FRF_STORAGE_WORDS(BINS_MAX, CHANNELS_MAX)];
static int32_t table[FRF_TWIDDLE_WORDS(PERIOD_MAX)];
static int16_t samples[PERIOD_MAX * CHANNELS_MAX];
static int32_t samples_i24[PERIOD_MAX];
static uint32_t bins[BINS_MAX];

struct cost {
    uint32_t at_once, by_frames, longest, longest_spread;
};

static void fill(uint32_t count)
{
    uint32_t state = 1;
    for (uint32_t i = 0; i < count; ++i) {
        state = state * 1664525u + 1013904223u;
        samples[i] = (int16_t)((int32_t)(state >> 17) - 16384);
    }
}

static void spread_bins(uint32_t last, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        bins[i] = 1u + i * (last - 1u) / (count - 1u);
    }
}

static void odd_bins(uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        bins[i] = 2u * i + 1u;
    }
}

/* Fletcher's way: the order counts. */
static void add_to(uint32_t *io_checksum, int64_t value)
{
    uint64_t bits = (uint64_t)value;
    io_checksum[0] += (uint32_t)bits;
    io_checksum[1] += io_checksum[0];
    io_checksum[0] += (uint32_t)(bits >> 32);
    io_checksum[1] += io_checksum[0];
}

static void print_case(const char *name, uint32_t channels, const struct cost *cost, uint32_t products, uint32_t ram,
                       uint32_t table_bytes, const uint32_t *checksum)
{
    const uint32_t values[] = {channels, cost->at_once, cost->by_frames, cost->longest, cost->longest_spread,
                               products, ram,           table_bytes,     checksum[0],   checksum[1]};
    port_print(name);
    for (unsigned i = 0; i < sizeof values / sizeof values[0]; ++i) {
        port_print(" ");
        port_print_number(values[i]);
    }
    port_print("\n");
}

static void count_block_by_frames(struct frf_block *dft, uint32_t *out_all, uint32_t *out_longest)
{
    uint32_t begin = port_instructions();
    for (uint32_t n = 0; n < dft->table.period_samples; ++n) {
        frf_block_add_i16(dft, samples + n * dft->channels, 1);
    }
    *out_all = port_instructions() - begin;
    *out_longest = 0;
    for (uint32_t n = 0; n < dft->table.period_samples; ++n) {
        begin = port_instructions();
        frf_block_add_i16(dft, samples + n * dft->channels, 1);
        uint32_t count = port_instructions() - begin;
        *out_longest = count > *out_longest ? count : *out_longest;
    }
}

/* repeats: 1, or 2 for odd lines */
static void run_block(const char *name, uint32_t period, uint32_t bin_count, uint32_t channels, uint32_t block,
                      uint32_t terms, uint32_t repeats)
{
    struct frf_block_layout layout = {block, terms, repeats};
    struct frf_block_table block_table;
    struct frf_block_config config = {.table = &block_table, .channels = channels, .banks = 1};
    struct frf_block dft;
    struct frf_block_period latched;
    struct cost cost;
    uint32_t checksum[2] = {1, 0}, unused;
    config.storage = storage;
    config.storage_words = sizeof storage / sizeof *storage;
    config.part = part;
    config.part_words = sizeof part / sizeof *part;
    fill(period * channels);
    if (frf_block_build(coefficients, sizeof coefficients / sizeof *coefficients, bins, bin_count, period, &layout,
                        &block_table) != core_ok ||
        frf_block_init(&dft, &config) != core_ok) {
        port_exit(1);
    }
    uint32_t begin = port_instructions();
    frf_block_add_i16(&dft, samples, period);
    cost.at_once = port_instructions() - begin;
    if (!frf_block_latest(&dft, &latched)) {
        port_exit(1);
    }
    for (uint32_t b = 0; b < bin_count * channels; ++b) {
        int64_t real, imaginary;
        frf_block_sums(&dft, &latched, b % bin_count, b / bin_count, &real, &imaginary);
        add_to(checksum, real);
        add_to(checksum, imaginary);
    }
    count_block_by_frames(&dft, &cost.by_frames, &cost.longest);
    config.spread = true;
    if (frf_block_init(&dft, &config) != core_ok) {
        port_exit(1);
    }
    count_block_by_frames(&dft, &unused, &cost.longest_spread);
    print_case(name, channels, &cost, period * bin_count * channels,
               4u * FRF_BLOCK_STORAGE_WORDS(bin_count, channels, 1u, block, terms) +
                   (repeats > 1 ? 4u * FRF_BLOCK_PART_WORDS(channels, period, repeats) : 0u),
               4u * FRF_BLOCK_TABLE_WORDS(bin_count, block, terms), checksum);
}

/* The exact DFTs: builds a table in `table` and sets up over it; returns the table's bytes, 0 on error. */
typedef uint32_t set_up(struct frf_dft *dft, const struct frf_dft_config *config, uint32_t period);

#define FULL(number, word)                                                                                             \
    static uint32_t full_##number(struct frf_dft *dft, const struct frf_dft_config *config, uint32_t period)           \
    {                                                                                                                  \
        struct frf_twiddles_##number twiddles;                                                                         \
        uint32_t count = FRF_TWIDDLE_WORDS(period);                                                                    \
        bool done = frf_twiddles_build_##number((word *)(void *)table, count, period, &twiddles) == core_ok &&         \
                    frf_dft_init_##number(dft, config, &twiddles) == core_ok;                                          \
        return done ? count * (uint32_t)sizeof(word) : 0;                                                              \
    }
#define QUARTER(number, word)                                                                                          \
    static uint32_t quarter_##number(struct frf_dft *dft, const struct frf_dft_config *config, uint32_t period)        \
    {                                                                                                                  \
        struct frf_quarter_##number quarter;                                                                           \
        uint32_t count = FRF_QUARTER_WORDS(period);                                                                    \
        bool done = frf_quarter_build_##number((word *)(void *)table, count, period, &quarter) == core_ok &&           \
                    frf_dft_init_quarter_##number(dft, config, &quarter) == core_ok;                                   \
        return done ? count * (uint32_t)sizeof(word) : 0;                                                              \
    }
#define TWO_LEVEL(number, point, turn)                                                                                 \
    static uint32_t two_level_##number(struct frf_dft *dft, const struct frf_dft_config *config, uint32_t period)      \
    {                                                                                                                  \
        struct frf_two_level_##number levels;                                                                          \
        struct point *coarse = (struct point *)(void *)table;                                                          \
        uint32_t points = FRF_COARSE_POINTS(period), turns = FRF_FINE_TURNS(period);                                   \
        struct turn *fine = (struct turn *)(void *)(coarse + points);                                                  \
        bool done = frf_two_level_build_##number(coarse, points, fine, turns, period, &levels) == core_ok &&           \
                    frf_dft_init_two_level_##number(dft, config, &levels) == core_ok;                                  \
        return done ? points * (uint32_t)sizeof(struct point) + turns * (uint32_t)sizeof(struct turn) : 0;             \
    }
FULL(q15, int16_t)
FULL(q23, int32_t)
FULL(q31, int32_t)
QUARTER(q15, int16_t)
QUARTER(q23, int32_t)
QUARTER(q31, int32_t)
TWO_LEVEL(q15, frf_point, frf_turn_q15)
TWO_LEVEL(q23, frf_point, frf_turn)
TWO_LEVEL(q31, frf_point, frf_turn)

static void add_frames(struct frf_dft *dft, uint32_t first, uint32_t count)
{
    if (dft->number == frf_number_q23) {
        frf_dft_add_i24(dft, samples_i24 + first, count);
    } else {
        frf_dft_add_i16(dft, samples + first, count);
    }
}

static void add_sums(const struct frf_dft *dft, uint32_t *io_checksum)
{
    struct frf_period latched;
    if (!frf_dft_latest(dft, &latched)) {
        port_exit(1);
    }
    for (uint32_t b = 0; b < dft->bin_count; ++b) {
        add_to(io_checksum, frf_period_real(dft, &latched, b, 0));
        add_to(io_checksum, frf_period_imaginary(dft, &latched, b, 0));
    }
}

static void run_exact(const char *name, uint32_t period, uint32_t last, uint32_t bin_count, set_up *set)
{
    struct frf_dft_config config = {bins, bin_count, 1, words, sizeof words / sizeof *words, 0, 0};
    struct frf_dft dft;
    struct cost cost = {0, 0, 0, 0};
    uint32_t checksum[2] = {1, 0};
    spread_bins(last, bin_count);
    fill(period);
    for (uint32_t n = 0; n < period; ++n) {
        samples_i24[n] = samples[n] * 256 - 77;
    }
    uint32_t table_bytes = set(&dft, &config, period);
    if (table_bytes == 0) {
        port_exit(1);
    }
    uint32_t begin = port_instructions();
    add_frames(&dft, 0, period);
    cost.at_once = port_instructions() - begin;
    add_sums(&dft, checksum);
    begin = port_instructions();
    for (uint32_t n = 0; n < period; ++n) {
        uint32_t before = port_instructions();
        add_frames(&dft, n, 1);
        uint32_t count = port_instructions() - before;
        cost.longest = count > cost.longest ? count : cost.longest;
    }
    cost.by_frames = port_instructions() - begin;
    cost.longest_spread = cost.longest;
    print_case(name, 1, &cost, period * bin_count, 8u * FRF_STORAGE_WORDS(bin_count, 1u), table_bytes, checksum);
}

static void run_all_exact(void)
{
    static const struct {
        const char *name;
        set_up *set;
    } cases[] = {{"exact-q15", full_q15}, {"exact-q15-quarter", quarter_q15}, {"exact-q15-two-level", two_level_q15},
                 {"exact-q23", full_q23}, {"exact-q23-quarter", quarter_q23}, {"exact-q23-two-level", two_level_q23},
                 {"exact-q31", full_q31}, {"exact-q31-quarter", quarter_q31}, {"exact-q31-two-level", two_level_q31}};
    for (unsigned i = 0; i < sizeof cases / sizeof *cases; ++i) {
        run_exact(cases[i].name, 2000, 900, BINS_MAX, cases[i].set);
    }
}

int main(void)
{
    run_all_exact();
    static const uint32_t counts[] = {32, BINS_MAX};
    for (unsigned c = 0; c < 2; ++c) {
        uint32_t count = counts[c];
        bool few = count == 32;
        for (uint32_t channels = 1; channels <= CHANNELS_MAX; ++channels) {
            spread_bins(900, count);
            run_block(few ? "any-16-K32" : "any-16-K200", 2000, count, channels, 16, 16, 1);
            run_block(few ? "any-32-K32" : "any-32-K200", 2000, count, channels, 32, 32, 1);
            run_block(few ? "any-64-K32" : "any-64-K200", 2000, count, channels, 64, 64, 1);
            run_block(few ? "any-128-K32" : "any-128-K200", 2000, count, channels, 128, 128, 1);
            spread_bins(200, count);
            run_block(few ? "below-0.1-64-K32" : "below-0.1-64-K200", 2000, count, channels, 64, 24, 1);
            run_block(few ? "below-0.1-128-K32" : "below-0.1-128-K200", 2000, count, channels, 128, 36, 1);
            spread_bins(327, count);
            run_block(few ? "below-0.02-64-K32" : "below-0.02-64-K200", 16384, count, channels, 64, 12, 1);
            run_block(few ? "below-0.02-128-K32" : "below-0.02-128-K200", 16384, count, channels, 128, 12, 1);
            odd_bins(count);
            run_block(few ? "odd-32-K32" : "odd-32-K200", 2000, count, channels, 32, 32, 2);
        }
    }
    port_exit(0);
}
