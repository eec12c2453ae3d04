/* SPDX-License-Identifier: MIT */
/* What the firmware library refuses or survives beyond its objects' own tests: each argument missing or off by one by
 * itself, counters at their end, fields that only damaged memory can hold. */
#include "frf/block.h"
#include "frf/dft.h"
#include "frf/statistics.h"
#include "msgen/player.h"

#include "unity.h"

#include <math.h>
#include <string.h>

enum { period = 96, bin_count = 4, words_max = 4096 };

static const uint32_t bins[bin_count] = {1, 5, 9, 30};
static int16_t sine_q15[FRF_TWIDDLE_WORDS(96u)];
static int32_t sine_q31[FRF_TWIDDLE_WORDS(96u)];
static float sine_f32[FRF_TWIDDLE_WORDS(96u)];
static struct frf_twiddles_q15 q15;
static struct frf_twiddles_q31 q31;
static struct frf_twiddles_f32 f32;
static union frf_word storage[FRF_STORAGE_WORDS(4u, 4u)];
static struct frf_dft_config config;
static int32_t coefficients[words_max], block_storage[words_max], part[words_max];
static struct frf_block_table block_table;
static struct frf_block_config block_config;
static const struct frf_block_layout folded = {32, 32, 1};

void setUp(void)
{
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_q15(sine_q15, FRF_TWIDDLE_WORDS(96u), period, &q15));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_q31(sine_q31, FRF_TWIDDLE_WORDS(96u), period, &q31));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_f32(sine_f32, FRF_TWIDDLE_WORDS(96u), period, &f32));
    config = (struct frf_dft_config){bins, bin_count, 2, storage, FRF_STORAGE_WORDS(4u, 4u), 0, 0};
    TEST_ASSERT_EQUAL_INT(core_ok,
                          frf_block_build(coefficients, words_max, bins, bin_count, period, &folded, &block_table));
    block_config =
        (struct frf_block_config){&block_table, 1, 1, false, block_storage, words_max, part, words_max, 0, 0};
}

void tearDown(void) {}

static void expect_dft(enum core_status expected, struct frf_dft_config bad)
{
    struct frf_dft dft, untouched;
    memset(&dft, 0x5A, sizeof dft);
    untouched = dft;
    TEST_ASSERT_EQUAL_INT(expected, frf_dft_init_q15(&dft, &bad, &q15));
    TEST_ASSERT_EQUAL_INT(expected, frf_dft_init_q31(&dft, &bad, &q31));
    TEST_ASSERT_EQUAL_INT(expected, frf_dft_init_f32(&dft, &bad, &f32));
    if (expected != core_ok)
        TEST_ASSERT_EQUAL_MEMORY(&untouched, &dft, sizeof dft);
}

static void test_dft_refuses_each_argument_by_itself(void)
{
    struct frf_dft dft;
    struct frf_dft_config bad = config;
    expect_dft(core_ok, config);
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_q15(NULL, &config, &q15));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_q15(&dft, NULL, &q15));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_q15(&dft, &config, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_q31(&dft, &config, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_f32(&dft, &config, NULL));
    bad.bins = NULL;
    expect_dft(core_err_argument, bad);
    bad = config;
    bad.storage = NULL;
    expect_dft(core_err_argument, bad);
    bad = config;
    bad.bin_count = 0;
    expect_dft(core_err_frf_bins, bad);
    bad.bin_count = SERVOSCOPE_FRF_BINS_MAX + 1;
    expect_dft(core_err_frf_bins, bad);
    bad = config;
    bad.channels = 0;
    expect_dft(core_err_frf_channels, bad);
    bad.channels = SERVOSCOPE_FRF_CHANNELS_MAX + 1;
    expect_dft(core_err_frf_channels, bad);
    bad = config;
    bad.storage_words = FRF_STORAGE_WORDS(4u, 2u) - 1u;
    expect_dft(core_err_storage, bad);
    bad = config;
    bad.rail_low = -5;
    bad.rail_high = -5;
    expect_dft(core_err_frf_rails, bad);
    bad.rail_high = 0;
    expect_dft(core_ok, bad);
    bad.rail_low = 0;
    bad.rail_high = 5;
    expect_dft(core_ok, bad);
}

static void test_dft_refuses_tables_that_are_not_whole(void)
{
    struct frf_dft dft;
    for (unsigned missing = 0; missing < 2; missing++) {
        struct frf_twiddles_q15 bad_q15 = {missing ? sine_q15 : NULL, missing ? NULL : sine_q15, period};
        struct frf_twiddles_q31 bad_q31 = {missing ? sine_q31 : NULL, missing ? NULL : sine_q31, period};
        struct frf_twiddles_f32 bad_f32 = {missing ? sine_f32 : NULL, missing ? NULL : sine_f32, period};
        TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_q15(&dft, &config, &bad_q15));
        TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_q31(&dft, &config, &bad_q31));
        TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_f32(&dft, &config, &bad_f32));
    }
    for (unsigned i = 0; i < 2; i++) {
        uint32_t wrong = i == 0 ? 3 : SERVOSCOPE_FRF_PERIOD_MAX + 1u;
        struct frf_twiddles_q15 bad = {sine_q15, sine_q15, wrong};
        TEST_ASSERT_EQUAL_INT(core_err_frf_period, frf_dft_init_q15(&dft, &config, &bad));
        TEST_ASSERT_EQUAL_INT(core_err_frf_period, frf_twiddles_build_q15(sine_q15, 1u << 20, wrong, &q15));
    }
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_twiddles_build_q15(NULL, 200, period, &q15));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_twiddles_build_q15(sine_q15, 200, period, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_storage, frf_twiddles_build_q15(sine_q15, 119, period, &q15));
    TEST_ASSERT_EQUAL_INT(core_err_storage, frf_twiddles_build_q31(sine_q31, 119, period, &q31));
    TEST_ASSERT_EQUAL_INT(core_err_storage, frf_twiddles_build_f32(sine_f32, 119, period, &f32));
}

static void test_dft_counts_samples_of_the_wrong_type(void)
{
    static const float floats[8];
    static const int16_t integers[8];
    struct frf_dft dft;
    struct frf_period latched;
    TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_f32(&dft, &config, &f32));
    frf_dft_add_i16(&dft, integers, 4);
    TEST_ASSERT_EQUAL_UINT32(1, dft.err.wrong_type);
    frf_dft_skip(&dft, period);
    TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
    TEST_ASSERT_EQUAL_UINT32(frf_reason_wrong_type | frf_reason_gap, latched.reasons);
    for (uint32_t i = 0; i < bin_count * 2u; i++)
        TEST_ASSERT_TRUE(latched.sums[i].pair[0] == 0 && latched.sums[i].pair[1] == 0);
    TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_q31(&dft, &config, &q31));
    frf_dft_add_f32(&dft, floats, 4);
    TEST_ASSERT_EQUAL_UINT32(1, dft.err.wrong_type);
}

/* Four channels at once, the way without constants for the count. */
static void test_dft_of_four_channels_is_four_of_one(void)
{
    static int16_t all[period * 4], one[period];
    static union frf_word single[FRF_STORAGE_WORDS(4u, 1u)];
    struct frf_dft dft, alone;
    struct frf_period latched, expected;
    struct frf_dft_config four = config, by_itself = config;
    four.channels = 4;
    by_itself.channels = 1;
    by_itself.storage = single;
    for (unsigned i = 0; i < period * 4u; i++)
        all[i] = (int16_t)(i * i * 37u % 65521u - 32768u);
    for (unsigned number = 0; number < 2; number++) {
        TEST_ASSERT_EQUAL_INT(core_ok,
                              number ? frf_dft_init_q31(&dft, &four, &q31) : frf_dft_init_q15(&dft, &four, &q15));
        frf_dft_add_i16(&dft, all, period);
        TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
        for (uint32_t c = 0; c < 4; c++) {
            for (unsigned n = 0; n < period; n++)
                one[n] = all[4u * n + c];
            TEST_ASSERT_EQUAL_INT(core_ok, number ? frf_dft_init_q31(&alone, &by_itself, &q31)
                                                  : frf_dft_init_q15(&alone, &by_itself, &q15));
            frf_dft_add_i16(&alone, one, period);
            TEST_ASSERT_TRUE(frf_dft_latest(&alone, &expected));
            for (uint32_t b = 0; b < bin_count; b++) {
                TEST_ASSERT_EQUAL_INT64(frf_period_real(&alone, &expected, b, 0),
                                        frf_period_real(&dft, &latched, b, c));
                TEST_ASSERT_EQUAL_INT64(frf_period_imaginary(&alone, &expected, b, 0),
                                        frf_period_imaginary(&dft, &latched, b, c));
            }
        }
    }
}

static void test_counters_stop_at_their_end(void)
{
    struct frf_dft dft;
    struct frf_block block;
    static int16_t rails[period * 2];
    for (unsigned i = 0; i < period * 2; i++)
        rails[i] = INT16_MIN;
    TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_q15(&dft, &config, &q15));
    dft.err.lost = UINT32_MAX - 5u;
    frf_dft_skip(&dft, 6);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, dft.err.lost);
    TEST_ASSERT_EQUAL_INT(core_ok, frf_block_init(&block, &block_config));
    frf_block_skip(&block, 0);
    TEST_ASSERT_EQUAL_UINT32(0, block.err.lost);
    TEST_ASSERT_EQUAL_UINT32(0, block.reasons);
    block.err.lost = UINT32_MAX - 5u;
    frf_block_skip(&block, 6);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, block.err.lost);
    block.err.saturated = UINT32_MAX - 5u;
    frf_block_add_i16(&block, rails, period);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, block.err.saturated);
}

static void expect_block(enum core_status expected, struct frf_block_config bad)
{
    struct frf_block block, untouched;
    memset(&block, 0x5A, sizeof block);
    untouched = block;
    TEST_ASSERT_EQUAL_INT(expected, frf_block_init(&block, &bad));
    if (expected != core_ok)
        TEST_ASSERT_EQUAL_MEMORY(&untouched, &block, sizeof block);
}

static void test_block_refuses_each_argument_by_itself(void)
{
    struct frf_block block;
    struct frf_block_config bad = block_config;
    expect_block(core_ok, block_config);
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_block_init(NULL, &block_config));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_block_init(&block, NULL));
    bad.table = NULL;
    expect_block(core_err_argument, bad);
    bad = block_config;
    bad.storage = NULL;
    expect_block(core_err_argument, bad);
    bad = block_config;
    bad.banks = 0;
    expect_block(core_err_argument, bad);
    bad.banks = 3;
    expect_block(core_err_argument, bad);
    bad = block_config;
    bad.channels = 0;
    expect_block(core_err_frf_channels, bad);
    bad = block_config;
    uint32_t words = FRF_BLOCK_STORAGE_WORDS(4u, 1u, 1u, 32u, 32u);
    bad.storage_words = words;
    expect_block(core_ok, bad);
    bad.storage_words = words - 1u;
    expect_block(core_err_storage, bad);
    bad.spread = true;
    bad.storage_words = words + FRF_BLOCK_SPREAD_WORDS(1u, 32u);
    expect_block(core_ok, bad);
    --bad.storage_words;
    expect_block(core_err_storage, bad);
    bad = block_config;
    bad.rail_low = -5;
    expect_block(core_ok, bad);
    bad.rail_high = -5;
    expect_block(core_err_frf_rails, bad);
    bad.rail_low = 0;
    bad.rail_high = 5;
    expect_block(core_ok, bad);
}

static void test_block_folded_refuses_its_part_by_itself(void)
{
    static const uint32_t odd[] = {1, 3, 5};
    const struct frf_block_layout layout = {32, 32, 2};
    TEST_ASSERT_EQUAL_INT(core_ok, frf_block_build(coefficients, words_max, odd, 3, period, &layout, &block_table));
    uint32_t words = FRF_BLOCK_PART_WORDS(1u, 96u, 2u);
    struct frf_block_config bad = block_config;
    bad.part_words = words;
    expect_block(core_ok, bad);
    bad.part_words = words - 1u;
    expect_block(core_err_storage, bad);
    bad.part_words = words;
    bad.part = NULL;
    expect_block(core_err_storage, bad);
}

static enum core_status build(const uint32_t *lines, uint32_t count, uint32_t samples, struct frf_block_layout layout)
{
    struct frf_block_table table;
    return frf_block_build(coefficients, words_max, lines, count, samples, &layout, &table);
}

static void test_block_table_refuses_each_argument_by_itself(void)
{
    static const uint32_t multiples[] = {512, 1024}, thirds[] = {1, 4};
    struct frf_block_table table;
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_block_build(NULL, 9999, bins, 4, period, &folded, &table));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_block_build(coefficients, 9999, NULL, 4, period, &folded, &table));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_block_build(coefficients, 9999, bins, 4, period, NULL, &table));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_block_build(coefficients, 9999, bins, 4, period, &folded, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_frf_bins, build(bins, 0, period, folded));
    TEST_ASSERT_EQUAL_INT(core_err_frf_block, build(bins, 1, 20, folded)); /* a block longer than the period */
    /* 512 parts of blocks of 32: the sum of a block does not fit its word */
    TEST_ASSERT_EQUAL_INT(core_err_frf_block, build(multiples, 2, 65536, (struct frf_block_layout){32, 32, 512}));
    TEST_ASSERT_EQUAL_INT(core_ok, build(multiples, 2, 65536, (struct frf_block_layout){32, 32, 256}));
    /* an odd number of parts cannot alternate */
    TEST_ASSERT_EQUAL_INT(core_err_frf_block, build(thirds, 2, period, (struct frf_block_layout){32, 32, 3}));
}

static void test_block_choice_folds_no_further_than_it_can(void)
{
    static const uint32_t of_512[] = {512, 1024}, of_200[] = {200, 400}, of_4[] = {4, 8, 12};
    static uint32_t many[200];
    struct frf_block_layout layout;
    frf_block_choose(of_512, 2, 65536, 65536, &layout);
    TEST_ASSERT_EQUAL_UINT32(1, layout.repeats);
    frf_block_choose(of_200, 2, 6400, 6400, &layout); /* parts of 32 are no two blocks */
    TEST_ASSERT_EQUAL_UINT32(1, layout.repeats);
    frf_block_choose(of_4, 3, 4096, 1023, &layout); /* no room for a part */
    TEST_ASSERT_EQUAL_UINT32(1, layout.repeats);
    for (unsigned b = 0; b < 200; b++)
        many[b] = 4u * (b + 1u);
    frf_block_choose(many, 200, 65536, 65536, &layout); /* low lines, four parts: blocks up to 64 */
    TEST_ASSERT_EQUAL_UINT32(4, layout.repeats);
    TEST_ASSERT_EQUAL_UINT32(64, layout.block_samples);
    TEST_ASSERT_TRUE(layout.terms < 64);
    frf_block_choose(bins, 1, 96, 0, &layout); /* one block of 64 is no two */
    TEST_ASSERT_EQUAL_UINT32(32, layout.block_samples);
    frf_block_choose(many, 0, 65536, 65536, &layout);
    TEST_ASSERT_EQUAL_UINT32(0, layout.block_samples);
}

static void test_statistics_refuse_a_dft_without_a_period_or_channel(void)
{
    static struct frf_pair pairs[bin_count + 1];
    struct frf_statistics statistics;
    struct frf_dft dft;
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_statistics_init(NULL, pairs, bin_count));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_statistics_init(&statistics, NULL, bin_count));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_statistics_init(&statistics, pairs, 0));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_statistics_init(&statistics, pairs, bin_count));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_q15(&dft, &config, &q15));
    TEST_ASSERT_FALSE(frf_statistics_add_period(&statistics, &dft, 0, 1));
    frf_dft_skip(&dft, period);
    TEST_ASSERT_FALSE(frf_statistics_add_period(&statistics, &dft, 2, 1));
    TEST_ASSERT_FALSE(frf_statistics_add_period(&statistics, &dft, 0, 2));
    TEST_ASSERT_EQUAL_UINT32(0, statistics.last_sequence);
    TEST_ASSERT_FALSE(frf_statistics_add_period(&statistics, &dft, 0, 1));
    TEST_ASSERT_EQUAL_UINT32(1, statistics.excluded.invalid);
    TEST_ASSERT_FALSE(frf_statistics_add_period(&statistics, &dft, 0, 1)); /* looked at already */
    TEST_ASSERT_EQUAL_UINT32(1, statistics.excluded.invalid);
}

/* Each of the four numbers of a coefficient, at either end. */
static void test_statistics_leave_out_each_number_that_is_not_finite(void)
{
    static const core_real wrong[3] = {(core_real)INFINITY, (core_real)-INFINITY, (core_real)NAN};
    struct frf_pair pair;
    struct frf_statistics statistics;
    TEST_ASSERT_EQUAL_INT(core_ok, frf_statistics_init(&statistics, &pair, 1));
    for (unsigned i = 0; i < 12; i++) {
        struct frf_complex input = {1, 1}, output = {1, 1};
        core_real *const numbers[4] = {&input.real, &input.imaginary, &output.real, &output.imaginary};
        *numbers[i % 4] = wrong[i / 4];
        TEST_ASSERT_FALSE(frf_statistics_add(&statistics, &input, &output));
        TEST_ASSERT_EQUAL_UINT32(i + 1, statistics.excluded.not_finite);
    }
    TEST_ASSERT_EQUAL_UINT32(0, statistics.periods);
}

/* Output exactly in proportion: what rounding leaves of the scatter is negative as often as not, and a root of it would
 * be NaN. */
static void test_statistics_of_a_plant_without_noise_have_a_standard_deviation(void)
{
    uint32_t state = 1;
    unsigned zeros = 0;
    for (unsigned run = 0; run < 100; run++) {
        struct frf_pair pair;
        struct frf_statistics statistics;
        struct frf_estimate estimate;
        TEST_ASSERT_EQUAL_INT(core_ok, frf_statistics_init(&statistics, &pair, 1));
        for (unsigned p = 0; p < 5; p++) {
            core_real number[2];
            for (unsigned i = 0; i < 2; i++) {
                state = state * 1664525u + 1013904223u;
                number[i] = (core_real)1 + (core_real)(state >> 8) / (core_real)16777216;
            }
            struct frf_complex input = {number[0], number[1]};
            struct frf_complex output = {number[0] * (core_real)0.3 - number[1] * (core_real)0.7,
                                         number[0] * (core_real)0.7 + number[1] * (core_real)0.3};
            TEST_ASSERT_TRUE(frf_statistics_add(&statistics, &input, &output));
        }
        frf_statistics_estimate(&statistics, 0, 0, &estimate);
        TEST_ASSERT_EQUAL_INT(frf_valid, estimate.validity);
        TEST_ASSERT_TRUE(estimate.std >= 0 && estimate.std < (core_real)1e-3);
        zeros += estimate.std <= 0;
    }
    TEST_ASSERT_GREATER_THAN_UINT(0, zeros);
}

/* A table as nobody can open it, for what the player checks by itself. */
static uint8_t samples_bytes[8 * 3 * 4];
static struct msgen_table table;
static struct msgen_player_config playing;

static void fill_table(enum msgen_format format, int32_t count, int64_t travel_q30)
{
    memset(&table, 0, sizeof table);
    table.samples = samples_bytes;
    table.rate_num_hz = 1000;
    table.rate_den = 1;
    table.period_samples = 8;
    table.channels = 3;
    table.format = format;
    table.travel_q30 = travel_q30;
    for (unsigned c = 0; c < 3; c++)
        table.scale_bits[c] = 0x3F800000u;
    for (unsigned i = 0; i < 24; i++)
        for (unsigned byte = 0; byte < 4; byte++)
            samples_bytes[4 * i + byte] = (uint8_t)((uint32_t)count >> (8 * byte));
    memset(&playing, 0, sizeof playing);
    playing.periods = 2;
    playing.abort_samples = 1;
}

static void test_player_refuses_what_no_table_can_be(void)
{
    struct msgen_player player;
    fill_table(msgen_format_i32, 1, 0);
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_player_init(&player, &table, &playing));
    TEST_ASSERT_EQUAL_INT(core_err_argument, msgen_player_init(NULL, &table, &playing));
    TEST_ASSERT_EQUAL_INT(core_err_argument, msgen_player_init(&player, NULL, &playing));
    TEST_ASSERT_EQUAL_INT(core_err_argument, msgen_player_init(&player, &table, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_argument, msgen_player_init_f32(&player, NULL, &playing));
    table.period_samples = 0;
    TEST_ASSERT_EQUAL_INT(core_err_argument, msgen_player_init(&player, &table, &playing));
    fill_table(msgen_format_i32, 1, 1000);
    table.channels = 2;
    TEST_ASSERT_EQUAL_INT(core_err_player_travel, msgen_player_init(&player, &table, &playing));
}

static void test_player_with_a_damaged_phase_is_silent_and_done(void)
{
    struct msgen_player player;
    int32_t out[3] = {7, 7, 7};
    fill_table(msgen_format_i32, 1000, 0);
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_player_init(&player, &table, &playing));
    msgen_player_step(&player, out);
    TEST_ASSERT_EQUAL_INT32(1000, out[0]);
    player.phase = (enum msgen_phase)77;
    msgen_player_step(&player, out);
    TEST_ASSERT_EQUAL_INT(msgen_phase_done, player.phase);
    for (unsigned c = 0; c < 3; c++)
        TEST_ASSERT_EQUAL_INT32(0, out[c]);
}

static void test_player_saturates_position_and_travel_together(void)
{
    struct msgen_player player;
    int32_t out[3];
    fill_table(msgen_format_i32, INT32_MAX, (int64_t)1000 << 30);
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_player_init(&player, &table, &playing));
    for (unsigned n = 0; n < 16; n++) {
        msgen_player_step(&player, out);
        TEST_ASSERT_EQUAL_INT32(INT32_MAX, out[msgen_channel_position]);
    }
    TEST_ASSERT_EQUAL_UINT32(15, player.err.saturated); /* all but the first, which has not travelled yet */
}

static void test_player_of_floats_puts_out_zeros_for_integers(void)
{
    struct msgen_player player;
    float out[3] = {7, 7, 7};
    fill_table(msgen_format_i32, 1000, (int64_t)8 << 30);
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_player_init(&player, &table, &playing));
    for (unsigned n = 0; n < 3; n++) {
        msgen_player_step_f32(&player, out);
        for (unsigned c = 0; c < 3; c++)
            TEST_ASSERT_TRUE(out[c] == 0);
    }
    TEST_ASSERT_EQUAL_INT(msgen_phase_done, player.phase);
}

static void test_table_of_a_linear_axis_reads_back(void)
{
    uint8_t bytes[msgen_header_bytes];
    fill_table(msgen_format_i32, 0, 0);
    table.bin_count = 1;
    table.linear = true;
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_encode_header(&table, bytes));
    TEST_ASSERT_EQUAL_HEX8(1, bytes[28]);
    table.linear = false;
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_encode_header(&table, bytes));
    TEST_ASSERT_EQUAL_HEX8(0, bytes[28]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_dft_refuses_each_argument_by_itself);
    RUN_TEST(test_dft_refuses_tables_that_are_not_whole);
    RUN_TEST(test_dft_counts_samples_of_the_wrong_type);
    RUN_TEST(test_dft_of_four_channels_is_four_of_one);
    RUN_TEST(test_counters_stop_at_their_end);
    RUN_TEST(test_block_refuses_each_argument_by_itself);
    RUN_TEST(test_block_folded_refuses_its_part_by_itself);
    RUN_TEST(test_block_table_refuses_each_argument_by_itself);
    RUN_TEST(test_block_choice_folds_no_further_than_it_can);
    RUN_TEST(test_statistics_refuse_a_dft_without_a_period_or_channel);
    RUN_TEST(test_statistics_leave_out_each_number_that_is_not_finite);
    RUN_TEST(test_statistics_of_a_plant_without_noise_have_a_standard_deviation);
    RUN_TEST(test_player_refuses_what_no_table_can_be);
    RUN_TEST(test_player_with_a_damaged_phase_is_silent_and_done);
    RUN_TEST(test_player_saturates_position_and_travel_together);
    RUN_TEST(test_player_of_floats_puts_out_zeros_for_integers);
    RUN_TEST(test_table_of_a_linear_axis_reads_back);
    return UNITY_END();
}
