/* SPDX-License-Identifier: MIT */
/* One line of name and CRC-32 for each integer result of lib/: machines of any byte order and word size have to print
 * the same. Numbers are put into bytes before the CRC, so that it does not depend on how they lie in memory. */
#include "core/bytes.h"
#include "core/crc32.h"
#include "frf/block.h"
#include "frf/dft.h"
#include "frf/dft_by_twos.h"
#include "guard/guard.h"
#include "msgen/player.h"

#include <stdio.h>
#include <stdlib.h>

enum { period_max = 4096, bins_max = 24, channels = 3, block_words = 65536 };

static int16_t samples[2 * period_max * channels];
static int32_t samples_i24[2 * period_max * channels];
static uint32_t bins[bins_max];
static union frf_word storage[FRF_STORAGE_WORDS(bins_max, channels)];
static int32_t coefficients[FRF_BLOCK_TABLE_WORDS(bins_max, 128u, 64u)];
static int32_t sums[block_words];
static uint8_t table_bytes[65536];
static uint32_t crc;

static void require(bool holds, const char *what)
{
    if (!holds) {
        printf("FAILED: %s\n", what);
        exit(1);
    }
}

static void take(int64_t value)
{
    uint8_t bytes[8];
    core_put_u32(bytes, (uint32_t)((uint64_t)value & 0xFFFFFFFFu));
    core_put_u32(bytes + 4, (uint32_t)((uint64_t)value >> 32));
    crc = core_crc32(crc, bytes, sizeof bytes);
}

static void report(const char *name, uint32_t number)
{
    printf("%s %u 0x%08x\n", name, (unsigned)number, (unsigned)crc);
    crc = 0;
}

/* Random numbers with stretches at the rails, where a wrong width or sign would show. */
static void fill_samples(void)
{
    uint32_t state = 1;
    for (uint32_t i = 0; i < sizeof samples / sizeof samples[0]; i++) {
        state = state * 1664525u + 1013904223u;
        bool at_rail = i / 500 % 4 == 1;
        uint16_t bits = (uint16_t)(at_rail ? (state >> 31 ? 0x8000u : 0x7FFFu) : state >> 16);
        uint8_t bytes[2];
        core_put_u16(bytes, bits);
        samples[i] = core_get_i16(bytes);
        samples_i24[i] = (int32_t)samples[i] * 256 + (samples[i] < 0 ? 0 : (int32_t)(state & 0xFFu));
    }
}

static uint32_t spread_bins(uint32_t last, uint32_t step)
{
    uint32_t count = 0;
    for (uint32_t bin = step; bin <= last && count < bins_max; bin += step * (1u + last / step / bins_max))
        bins[count++] = bin;
    return count;
}

static void add_frames(struct frf_dft *dft, uint32_t first, uint32_t count)
{
    if (dft->number == frf_number_q23)
        frf_dft_add_i24(dft, samples_i24 + (size_t)first * channels, count);
    else
        frf_dft_add_i16(dft, samples + (size_t)first * channels, count);
}

static void run_dft(struct frf_dft *dft, const char *name, uint32_t period)
{
    struct frf_period latched;
    add_frames(dft, 0, period - 7u);
    add_frames(dft, period - 7u, period + 7u);
    require(frf_dft_latest(dft, &latched) && latched.sequence == 2, name);
    for (uint32_t b = 0; b < dft->bin_count; b++) {
        for (uint32_t c = 0; c < channels; c++) {
            take(frf_period_real(dft, &latched, b, c));
            take(frf_period_imaginary(dft, &latched, b, c));
        }
    }
    take(dft->err.saturated);
    take(latched.reasons);
    report(name, period);
}

static void exact_sums(uint32_t period)
{
    static int16_t storage_q15[FRF_TWIDDLE_WORDS(period_max - 1u) + 1u];
    static int32_t storage_q23[FRF_TWIDDLE_WORDS(period_max - 1u) + 1u];
    static int32_t storage_q31[FRF_TWIDDLE_WORDS(period_max - 1u) + 1u];
    uint32_t words = FRF_TWIDDLE_WORDS(period), count = spread_bins((period - 1u) / 2u, 1);
    struct frf_twiddles_q15 q15;
    struct frf_twiddles_q23 q23;
    struct frf_twiddles_q31 q31;
    struct frf_dft dft;
    struct frf_dft_config config = {bins, count, channels, storage, FRF_STORAGE_WORDS(bins_max, channels), 0, 0};
    require(frf_twiddles_build_q15(storage_q15, words, period, &q15) == core_ok, "Q15 table");
    require(frf_twiddles_build_q23(storage_q23, words, period, &q23) == core_ok, "Q23 table");
    require(frf_twiddles_build_q31(storage_q31, words, period, &q31) == core_ok, "Q31 table");
    for (uint32_t i = 0; i < words; i++)
        take(storage_q31[i] ^ (int32_t)storage_q15[i] ^ storage_q23[i] / 128);
    report("twiddles", period);
    require(frf_dft_init_q15(&dft, &config, &q15) == core_ok, "DFT Q15");
    run_dft(&dft, "sums-q15", period);
    require(frf_dft_init_q23(&dft, &config, &q23) == core_ok, "DFT Q23");
    run_dft(&dft, "sums-q23", period);
    require(frf_dft_init_q31(&dft, &config, &q31) == core_ok, "DFT Q31");
    run_dft(&dft, "sums-q31", period);
    struct frf_walk walk = {3, bins[count - 1u], period, channels};
    take(frf_sum_by_twos_portable(storage_q15, samples, &walk, period / 2u));
    take(walk.index);
    report("sum-by-twos", period);
}

static void quarter_sums(uint32_t period)
{
    static int16_t storage_q15[FRF_QUARTER_WORDS(period_max - 1u)];
    static int32_t storage_q23[FRF_QUARTER_WORDS(period_max - 1u)], storage_q31[FRF_QUARTER_WORDS(period_max - 1u)];
    uint32_t words = FRF_QUARTER_WORDS(period), count = spread_bins((period - 1u) / 2u, 1);
    struct frf_quarter_q15 q15;
    struct frf_quarter_q23 q23;
    struct frf_quarter_q31 q31;
    struct frf_dft dft;
    struct frf_dft_config config = {bins, count, channels, storage, FRF_STORAGE_WORDS(bins_max, channels), 0, 0};
    require(frf_quarter_build_q15(storage_q15, words, period, &q15) == core_ok, "Q15 quarter");
    require(frf_quarter_build_q23(storage_q23, words, period, &q23) == core_ok, "Q23 quarter");
    require(frf_quarter_build_q31(storage_q31, words, period, &q31) == core_ok, "Q31 quarter");
    require(frf_dft_init_quarter_q15(&dft, &config, &q15) == core_ok, "DFT Q15");
    run_dft(&dft, "quarter-sums-q15", period);
    require(frf_dft_init_quarter_q23(&dft, &config, &q23) == core_ok, "DFT Q23");
    run_dft(&dft, "quarter-sums-q23", period);
    require(frf_dft_init_quarter_q31(&dft, &config, &q31) == core_ok, "DFT Q31");
    run_dft(&dft, "quarter-sums-q31", period);
}

static void two_level_sums(uint32_t period)
{
    static struct frf_point coarse[3][128];
    static struct frf_turn fine[2][128];
    static struct frf_turn_q15 fine_q15[128];
    uint32_t points = FRF_COARSE_POINTS(period), turns = FRF_FINE_TURNS(period);
    uint32_t count = spread_bins((period - 1u) / 2u, 1);
    struct frf_two_level_q15 q15;
    struct frf_two_level_q23 q23;
    struct frf_two_level_q31 q31;
    struct frf_dft dft;
    struct frf_dft_config config = {bins, count, channels, storage, FRF_STORAGE_WORDS(bins_max, channels), 0, 0};
    require(points <= 128 && turns <= 128, "room for two levels");
    require(frf_two_level_build_q15(coarse[0], points, fine_q15, turns, period, &q15) == core_ok, "Q15 levels");
    require(frf_two_level_build_q23(coarse[1], points, fine[0], turns, period, &q23) == core_ok, "Q23 levels");
    require(frf_two_level_build_q31(coarse[2], points, fine[1], turns, period, &q31) == core_ok, "Q31 levels");
    require(frf_dft_init_two_level_q15(&dft, &config, &q15) == core_ok, "DFT Q15");
    run_dft(&dft, "two-level-sums-q15", period);
    require(frf_dft_init_two_level_q23(&dft, &config, &q23) == core_ok, "DFT Q23");
    run_dft(&dft, "two-level-sums-q23", period);
    require(frf_dft_init_two_level_q31(&dft, &config, &q31) == core_ok, "DFT Q31");
    run_dft(&dft, "two-level-sums-q31", period);
}

static void block_sums(const struct frf_block_layout *layout, uint32_t period, uint32_t last, bool spread)
{
    static int32_t part[FRF_BLOCK_PART_WORDS(channels, period_max, 2u)];
    uint32_t count = spread_bins(last, layout->repeats > 1 ? layout->repeats : 1);
    struct frf_block_table table;
    struct frf_block dft;
    struct frf_block_period latched;
    require(frf_block_build(coefficients, sizeof coefficients / sizeof *coefficients, bins, count, period, layout,
                            &table) == core_ok,
            "block table");
    for (uint32_t w = 0; w < FRF_BLOCK_TABLE_WORDS(count, layout->block_samples, layout->terms); w++)
        take(coefficients[w]);
    report("block-table", layout->block_samples * 1000u + layout->terms);
    struct frf_block_config config = {&table, channels, 2, spread, sums, block_words, part, sizeof part / sizeof *part,
                                      0,      0};
    require(frf_block_init(&dft, &config) == core_ok, "block DFT");
    frf_block_add_i16(&dft, samples, period + layout->block_samples);
    require(frf_block_latest(&dft, &latched), "block period");
    for (uint32_t b = 0; b < count; b++) {
        for (uint32_t c = 0; c < channels; c++) {
            int64_t real, imaginary;
            frf_block_sums(&dft, &latched, b, c, &real, &imaginary);
            take(real);
            take(imaginary);
        }
    }
    report("block-sums", layout->block_samples * 1000u + layout->terms);
}

static size_t write_table(enum msgen_format format)
{
    struct msgen_table table = {0};
    uint32_t bytes_each = format == msgen_format_i16 ? 2 : 4, period = 500;
    table.rate_num_hz = 8000;
    table.rate_den = 1;
    table.period_samples = period;
    table.bin_count = 1;
    table.start_index = 123;
    table.channels = channels;
    table.format = format;
    for (unsigned c = 0; c < channels; c++)
        table.scale_bits[c] = 0x3A83126Fu;
    table.travel_q30 = format == msgen_format_i32 ? -123456789012345 : 0;
    uint8_t *data = table_bytes + msgen_table_header_bytes(&table);
    core_put_u32(data, 7);
    for (uint32_t i = 0; i < period * channels; i++) {
        if (format == msgen_format_i16)
            core_put_u16(data + 4u + 2u * i, (uint16_t)samples[i]);
        else
            core_put_u32(data + 4u + 4u * i, (uint32_t)samples[i] * 4096u);
    }
    uint32_t size = 4u + period * channels * bytes_each;
    table.data_crc32 = core_crc32(0, data, size);
    require(msgen_table_encode_header(&table, table_bytes) == core_ok, "header");
    return (size_t)(data - table_bytes) + size;
}

static void played_samples(enum msgen_format format)
{
    size_t size = write_table(format);
    struct msgen_table table;
    struct msgen_player player;
    struct msgen_player_config config = {2, 77, 0, 0, 55, 33, {65536, -40000, 65536}, {30000, 0, 0}};
    crc = core_crc32(0, table_bytes, size);
    report("table", format);
    require(msgen_table_open(table_bytes, size, &table) == core_ok, "table");
    require(msgen_player_init(&player, &table, &config) == core_ok, "player");
    for (unsigned n = 0; n < 1200; n++) {
        int32_t out[channels] = {0};
        struct msgen_player_state state = msgen_player_step(&player, out);
        take(state.phase);
        take(state.index);
        for (unsigned c = 0; c < channels; c++)
            take(out[c]);
    }
    take(player.err.saturated);
    report("played", format);
}

static void guarded(void)
{
    static const struct guard_limits limits = {-30000, 30000, 32000, 1000, 5, 3, 20000};
    struct guard guard;
    struct guard_sample sample = {0, 0, 0, true};
    require(guard_init(&guard, &limits) == core_ok, "guard");
    for (uint32_t i = 0; i + 3 < 6000; i += 3) {
        if (guard.state.mode != guard_armed)
            take(guard_arm(&guard, &sample));
        sample.position = samples[i];
        sample.velocity = samples[i + 1];
        sample.torque = guard_clip_torque(&guard, samples[i + 2] * 2);
        if (i % 2)
            guard_alive(&guard.state);
        take(guard_step(&guard, &sample));
        take(guard.state.cause);
        take(guard.trip_value);
        take(sample.torque);
    }
    take(guard.state.count.trips);
    report("guard", 0);
}

int main(void)
{
    static const uint32_t periods[] = {97, 500, 1009, 2000, 4093, 4096};
    static const struct frf_block_layout folded = {32, 32, 1}, shared = {128, 16, 1}, part = {32, 32, 2};
    fill_samples();
    for (unsigned p = 0; p < sizeof periods / sizeof periods[0]; p++) {
        exact_sums(periods[p]);
        quarter_sums(periods[p]);
        two_level_sums(periods[p]);
    }
    block_sums(&folded, 2000, 900, false);
    block_sums(&folded, 1009, 500, true);
    block_sums(&shared, 4096, 80, false);
    block_sums(&part, 4096, 1000, false);
    played_samples(msgen_format_i16);
    played_samples(msgen_format_i32);
    guarded();
    return 0;
}
