/* SPDX-License-Identifier: MIT */
#include "core/bytes.h"
#include "core/crc32.h"
#include "core/fixed.h"
#include "msgen/player.h"

#include "unity.h"

#include <math.h>
#include <string.h>

enum { samples = 100, channels = 3, fade_in = 30, fade_out = 45, abort_ramp = 20, periods = 3 };

static uint8_t bytes[8192];
static struct msgen_table table;
static double values[samples][channels]; /* what the table holds, as numbers */
static const double two_pi = 6.28318530717958647692;

static double peak_of_channel(enum msgen_format format, unsigned channel)
{
    static const double shares[channels] = {1.0, 0.31, 0.77};
    double full = format == msgen_format_i16 ? 32767 : format == msgen_format_i32 ? 2147483647.0 : 3.0;
    return full * shares[channel];
}

static void put_number(uint8_t *at, enum msgen_format format, double value, double *out_stored)
{
    union core_float_bits number;
    *out_stored = rint(value);
    if (format == msgen_format_i16)
        core_put_u16(at, (uint16_t)(int16_t)rint(value));
    else if (format == msgen_format_i32)
        core_put_u32(at, (uint32_t)(int32_t)rint(value));
    else {
        number.value = (float)value;
        *out_stored = (double)number.value;
        core_put_u32(at, number.bits);
    }
}

static void build(enum msgen_format format, uint32_t start_index)
{
    memset(&table, 0, sizeof table);
    table.rate_num_hz = 1000;
    table.rate_den = 1;
    table.period_samples = samples;
    table.bin_count = 1;
    table.start_index = start_index;
    table.channels = channels;
    table.format = format;
    uint8_t *data = bytes + msgen_header_bytes, *at = data + 4;
    core_put_u32(data, 3);
    for (unsigned c = 0; c < channels; c++)
        table.scale_bits[c] = 0x3F800000u;
    for (unsigned n = 0; n < samples; n++)
        for (unsigned c = 0; c < channels; c++, at += msgen_format_bytes(format))
            put_number(at, format, peak_of_channel(format, c) * cos(two_pi * 3 * n / samples + 0.5 * c), &values[n][c]);
    table.data_crc32 = core_crc32(0, data, (size_t)(at - data));
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_encode_header(&table, bytes));
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_open(bytes, (size_t)(at - bytes), &table));
}

static struct msgen_player_config usual(void)
{
    struct msgen_player_config config = {
        .periods = periods, .fade_in_samples = fade_in, .fade_out_samples = fade_out, .abort_samples = abort_ramp};
    return config;
}

static void start(struct msgen_player *player, const struct msgen_player_config *config)
{
    bool is_float = table.format == msgen_format_f32;
    TEST_ASSERT_EQUAL_INT(core_ok, is_float ? msgen_player_init_f32(player, &table, config)
                                            : msgen_player_init(player, &table, config));
}

/* The documented curve, in double. */
static double smooth(double t)
{
    return t * t * (3 - 2 * t);
}

/* Rounding of the factor (three truncations at Q30) times the largest value, and of the product. */
static double tolerance_of(unsigned channel)
{
    return peak_of_channel(table.format, channel) * 4 / 1073741824.0 + 0.5;
}

static double expected_factor(unsigned sample)
{
    unsigned end = fade_in + periods * samples;
    if (sample < fade_in)
        return smooth((double)sample / fade_in);
    if (sample < end)
        return 1;
    return sample < end + fade_out ? 1 - smooth((double)(sample - end + 1) / fade_out) : 0;
}

void setUp(void)
{
    build(msgen_format_i16, 17);
}

void tearDown(void) {}

static void check_whole_run(void)
{
    struct msgen_player player;
    struct msgen_player_config config = usual();
    start(&player, &config);
    unsigned end = fade_in + periods * samples + fade_out;
    for (unsigned s = 0; s < end + 10; s++) {
        int32_t out[channels + 1] = {0, 0, 0, 0x5A5A5A5A};
        struct msgen_player_state state = msgen_player_step(&player, out);
        uint32_t index = (table.start_index + samples * 4u - fade_in + s) % samples;
        for (unsigned c = 0; c < channels; c++)
            TEST_ASSERT_DOUBLE_WITHIN(tolerance_of(c), expected_factor(s) * values[index][c], out[c]);
        TEST_ASSERT_EQUAL_HEX32(0x5A5A5A5A, (uint32_t)out[channels]);
        if (s == 0 || s >= end - 1) /* the ramps end at zero exactly */
            TEST_ASSERT_EACH_EQUAL_INT32(0, out, channels);
        if (s < fade_in)
            TEST_ASSERT_EQUAL_INT(msgen_phase_fade_in, state.phase);
        else if (s < fade_in + periods * samples) {
            TEST_ASSERT_EQUAL_INT(msgen_phase_playing, state.phase);
            TEST_ASSERT_EQUAL_UINT32((s - fade_in) / samples, state.period);
            TEST_ASSERT_EQUAL_UINT32(index, state.index);
            for (unsigned c = 0; c < channels; c++)
                TEST_ASSERT_TRUE((double)out[c] == values[index][c]);
        } else
            TEST_ASSERT_EQUAL_INT(s < end ? msgen_phase_fade_out : msgen_phase_done, state.phase);
    }
    TEST_ASSERT_EQUAL_UINT32(0, player.err.saturated);
}

static void test_player_plays_fade_periods_fade_i16(void)
{
    check_whole_run();
}

static void test_player_plays_fade_periods_fade_i32(void)
{
    build(msgen_format_i32, 99);
    check_whole_run();
}

static void test_player_without_fades_is_the_table(void)
{
    struct msgen_player player;
    struct msgen_player_config config = {.periods = 2, .abort_samples = 1};
    start(&player, &config);
    for (unsigned s = 0; s < 2 * samples; s++) {
        int32_t out[channels];
        struct msgen_player_state state = msgen_player_step(&player, out);
        TEST_ASSERT_EQUAL_INT(msgen_phase_playing, state.phase);
        TEST_ASSERT_EQUAL_UINT32((17 + s) % samples, state.index);
        TEST_ASSERT_EQUAL_UINT32(s / samples, state.period);
        TEST_ASSERT_TRUE((double)out[0] == values[state.index][0]);
    }
    int32_t out[channels] = {1, 1, 1};
    TEST_ASSERT_EQUAL_INT(msgen_phase_done, msgen_player_step(&player, out).phase);
    TEST_ASSERT_EACH_EQUAL_INT32(0, out, channels);
}

static void test_player_first_sample_of_fade_is_zero_and_long_fades_wrap(void)
{
    struct msgen_player player;
    struct msgen_player_config config = {.periods = 1, .fade_in_samples = 12345, .abort_samples = 1};
    start(&player, &config);
    for (unsigned s = 0; s <= 12345; s++) {
        int32_t out[channels];
        struct msgen_player_state state = msgen_player_step(&player, out);
        if (s == 0)
            TEST_ASSERT_EACH_EQUAL_INT32(0, out, channels);
        if (s == 12345) {
            TEST_ASSERT_EQUAL_INT(msgen_phase_playing, state.phase);
            TEST_ASSERT_EQUAL_UINT32(table.start_index, state.index);
        }
    }
}

/* The bound of player.h for the ramp in use. */
static double step_bound(unsigned channel, unsigned ramp)
{
    double largest = 0;
    for (unsigned n = 0; n < samples; n++)
        largest = fmax(largest, fabs(values[(n + 1) % samples][channel] - values[n][channel]));
    return largest + 1.5 * peak_of_channel(table.format, channel) / ramp + 1;
}

static void play_with_abort_at(unsigned abort_at, bool abort_twice)
{
    struct msgen_player player;
    struct msgen_player_config config = usual();
    start(&player, &config);
    double before[channels] = {0};
    unsigned done_at = 0;
    for (unsigned s = 0; s < fade_in + periods * samples + fade_out + 5; s++) {
        int32_t out[channels];
        if (s == abort_at || (abort_twice && s == abort_at + 3))
            msgen_player_abort(&player);
        struct msgen_player_state state = msgen_player_step(&player, out);
        for (unsigned c = 0; c < channels; c++) {
            TEST_ASSERT_TRUE(fabs(out[c] - before[c]) <= step_bound(c, abort_ramp));
            before[c] = out[c];
        }
        if (state.phase == msgen_phase_done && done_at == 0)
            done_at = s;
        if (done_at)
            TEST_ASSERT_EACH_EQUAL_INT32(0, out, channels);
    }
    TEST_ASSERT_TRUE(done_at > 0 || abort_at == 0);
    if (abort_at < fade_in + periods * samples + fade_out)
        TEST_ASSERT_TRUE(done_at <= abort_at + abort_ramp);
}

static void test_player_abort_at_every_sample_never_jumps(void)
{
    for (unsigned abort_at = 0; abort_at < fade_in + periods * samples + fade_out + 2; abort_at++) {
        play_with_abort_at(abort_at, false);
        play_with_abort_at(abort_at, true);
    }
}

static void test_player_abort_ramps_from_present_amplitude(void)
{
    struct msgen_player player;
    struct msgen_player_config config = usual();
    int32_t out[channels];
    start(&player, &config);
    for (unsigned s = 0; s <= fade_in / 2; s++)
        msgen_player_step(&player, out);
    TEST_ASSERT_INT32_WITHIN(4, CORE_Q30_ONE / 2, player.factor_q30);
    msgen_player_abort(&player);
    for (unsigned s = 1; s <= abort_ramp; s++) {
        struct msgen_player_state state = msgen_player_step(&player, out);
        TEST_ASSERT_EQUAL_INT(msgen_phase_aborting, state.phase);
        TEST_ASSERT_EQUAL_UINT32((table.start_index + samples - fade_in + fade_in / 2 + s) % samples, state.index);
        double factor = 0.5 * (1 - smooth((double)s / abort_ramp));
        TEST_ASSERT_DOUBLE_WITHIN(tolerance_of(0), factor * values[state.index][0], out[0]);
    }
    TEST_ASSERT_EQUAL_INT(msgen_phase_done, msgen_player_step(&player, out).phase);
}

static void test_player_gain_turns_scales_and_limit_counts(void)
{
    struct msgen_player player;
    struct msgen_player_config config = {.periods = 1, .abort_samples = 1};
    config.gain_q16[0] = -msgen_gain_one / 2;
    config.gain_q16[1] = 4 * msgen_gain_one;
    config.limit[1] = 30000;
    config.gain_q16[2] = INT32_MAX;
    start(&player, &config);
    unsigned clipped = 0;
    for (unsigned s = 0; s < samples; s++) {
        int32_t out[channels];
        struct msgen_player_state state = msgen_player_step(&player, out);
        const double *value = values[state.index];
        TEST_ASSERT_DOUBLE_WITHIN(0.5, -value[0] / 2, out[0]);
        TEST_ASSERT_TRUE((double)out[1] == fmax(-30000, fmin(30000, 4 * value[1])));
        clipped += fabs(4 * value[1]) > 30000;
        TEST_ASSERT_DOUBLE_WITHIN(1, fmax(-2147483647.0, fmin(2147483647.0, value[2] * 2147483647.0 / 65536)), out[2]);
    }
    TEST_ASSERT_GREATER_THAN_UINT(10, clipped);
    TEST_ASSERT_EQUAL_UINT32(clipped, player.err.saturated);
}

static void test_player_clips_int32_minimum_without_overflow(void)
{
    build(msgen_format_i32, 0);
    core_put_u32(bytes + msgen_header_bytes + 4, 0x80000000u);
    struct msgen_player player;
    struct msgen_player_config config = {.periods = 1, .abort_samples = 1};
    int32_t out[channels];
    config.gain_q16[0] = INT32_MIN;
    start(&player, &config);
    msgen_player_step(&player, out);
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, out[0]);
    config.gain_q16[0] = INT32_MAX;
    start(&player, &config);
    msgen_player_step(&player, out);
    TEST_ASSERT_EQUAL_INT32(-INT32_MAX, out[0]);
    TEST_ASSERT_EQUAL_UINT32(1, player.err.saturated);
}

static void test_player_resumes_from_a_copy(void)
{
    struct msgen_player player;
    struct msgen_player_config config = usual();
    start(&player, &config);
    for (unsigned s = 0; s < fade_in + periods * samples + fade_out + 2; s++) {
        struct msgen_player copy = player;
        int32_t out[channels], again[channels];
        msgen_player_step(&player, out);
        msgen_player_step(&copy, again);
        TEST_ASSERT_EQUAL_INT32_ARRAY(out, again, channels);
    }
}

static void test_player_f32_plays_the_same_curve(void)
{
    build(msgen_format_f32, 17);
    struct msgen_player player;
    struct msgen_player_config config = usual();
    start(&player, &config);
    for (unsigned s = 0; s < fade_in + periods * samples + fade_out + 5; s++) {
        float out[channels];
        struct msgen_player_state state = msgen_player_step_f32(&player, out);
        for (unsigned c = 0; c < channels; c++) /* factor and product each rounded to 24 bits */
            TEST_ASSERT_DOUBLE_WITHIN(3e-7 * 3, expected_factor(s) * values[state.index][c], (double)out[c]);
        if (state.phase == msgen_phase_playing)
            TEST_ASSERT_TRUE((double)out[1] == values[state.index][1]);
    }
}

static void test_player_puts_out_zero_for_the_other_format(void)
{
    struct msgen_player player;
    struct msgen_player_config config = usual();
    float real_out[channels] = {1, 1, 1};
    start(&player, &config);
    TEST_ASSERT_EQUAL_INT(msgen_phase_done, msgen_player_step_f32(&player, real_out).phase);
    for (unsigned c = 0; c < channels; c++)
        TEST_ASSERT_TRUE(real_out[c] == 0);
    build(msgen_format_f32, 0);
    int32_t out[channels] = {1, 1, 1};
    start(&player, &config);
    TEST_ASSERT_EQUAL_INT(msgen_phase_done, msgen_player_step(&player, out).phase);
    TEST_ASSERT_EACH_EQUAL_INT32(0, out, channels);
}

static void test_player_init_refuses_impossible_settings(void)
{
    struct msgen_player player;
    struct msgen_player_config config = usual();
    TEST_ASSERT_EQUAL_INT(core_err_argument, msgen_player_init(NULL, &table, &config));
    TEST_ASSERT_EQUAL_INT(core_err_argument, msgen_player_init(&player, NULL, &config));
    TEST_ASSERT_EQUAL_INT(core_err_argument, msgen_player_init(&player, &table, NULL));
    config.periods = 0;
    TEST_ASSERT_EQUAL_INT(core_err_player_periods, msgen_player_init(&player, &table, &config));
    config = usual();
    config.abort_samples = 0;
    TEST_ASSERT_EQUAL_INT(core_err_player_fade, msgen_player_init(&player, &table, &config));
    config.abort_samples = msgen_ramp_samples_max + 1;
    TEST_ASSERT_EQUAL_INT(core_err_player_fade, msgen_player_init(&player, &table, &config));
    config = usual();
    config.fade_in_samples = msgen_ramp_samples_max + 1;
    TEST_ASSERT_EQUAL_INT(core_err_player_fade, msgen_player_init(&player, &table, &config));
    config = usual();
    config.fade_out_samples = msgen_ramp_samples_max + 1;
    TEST_ASSERT_EQUAL_INT(core_err_player_fade, msgen_player_init(&player, &table, &config));
    config = usual();
    config.limit[2] = -1;
    TEST_ASSERT_EQUAL_INT(core_err_player_limit, msgen_player_init(&player, &table, &config));
    config = usual();
    TEST_ASSERT_EQUAL_INT(core_err_player_format, msgen_player_init_f32(&player, &table, &config));
    build(msgen_format_f32, 0);
    TEST_ASSERT_EQUAL_INT(core_err_player_format, msgen_player_init(&player, &table, &config));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_player_plays_fade_periods_fade_i16);
    RUN_TEST(test_player_plays_fade_periods_fade_i32);
    RUN_TEST(test_player_without_fades_is_the_table);
    RUN_TEST(test_player_first_sample_of_fade_is_zero_and_long_fades_wrap);
    RUN_TEST(test_player_abort_at_every_sample_never_jumps);
    RUN_TEST(test_player_abort_ramps_from_present_amplitude);
    RUN_TEST(test_player_gain_turns_scales_and_limit_counts);
    RUN_TEST(test_player_clips_int32_minimum_without_overflow);
    RUN_TEST(test_player_resumes_from_a_copy);
    RUN_TEST(test_player_f32_plays_the_same_curve);
    RUN_TEST(test_player_puts_out_zero_for_the_other_format);
    RUN_TEST(test_player_init_refuses_impossible_settings);
    return UNITY_END();
}
