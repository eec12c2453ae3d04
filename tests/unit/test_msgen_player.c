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

/* CRC-32 of everything that a run with an abort puts out. */
static uint32_t crc_of_run(enum msgen_format format, unsigned abort_at)
{
    build(format, 17);
    struct msgen_player player;
    struct msgen_player_config config = usual();
    config.gain_q16[1] = -3 * msgen_gain_one;
    start(&player, &config);
    uint32_t crc = 0;
    for (unsigned s = 0; s < fade_in + periods * samples + fade_out + 5; s++) {
        int32_t out[channels];
        uint8_t frame[4 * channels];
        if (s == abort_at)
            msgen_player_abort(&player);
        msgen_player_step(&player, out);
        for (unsigned c = 0; c < channels; c++)
            core_put_u32(frame + 4 * c, (uint32_t)out[c]);
        crc = core_crc32(crc, frame, sizeof frame);
    }
    return crc;
}

static void test_player_without_travel_puts_out_the_same_bits_as_ever(void)
{
    /* Made by the player of version 1 tables, before there was travel. */
    TEST_ASSERT_EQUAL_HEX32(0x74634ec1, crc_of_run(msgen_format_i16, UINT32_MAX));
    TEST_ASSERT_EQUAL_HEX32(0x646d4327, crc_of_run(msgen_format_i16, 11));
    TEST_ASSERT_EQUAL_HEX32(0x888cbec3, crc_of_run(msgen_format_i32, 123));
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

/* A build whose position travels: the same samples behind a longer header. */
static void build_travelling(enum msgen_format format, int64_t travel_q30)
{
    build(format, 17);
    size_t data = 4 + (size_t)samples * channels * msgen_format_bytes(format);
    memmove(bytes + msgen_header_travel_bytes, bytes + msgen_header_bytes, data);
    table.travel_q30 = travel_q30;
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_encode_header(&table, bytes));
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_open(bytes, msgen_header_travel_bytes + data, &table));
}

static double travel_counts(void)
{
    return (double)table.travel_q30 / CORE_Q30_ONE;
}

/* Truncation: a unit of 2^-30 for each sample of a ramp. */
static const double travel_rounding = (fade_in + fade_out) / 1073741824.0;

static void check_travelling_run(void)
{
    struct msgen_player player;
    struct msgen_player_config config = usual();
    start(&player, &config);
    double travelled = 0; /* the sum of the faded speed, in double */
    double last_speed = 0;
    for (unsigned s = 0; s < fade_in + periods * samples + fade_out + 10; s++) {
        int32_t out[channels];
        uint32_t index = (table.start_index + samples * 4u - fade_in + s) % samples;
        msgen_player_step(&player, out);
        travelled += last_speed;
        last_speed = expected_factor(s) * travel_counts() / samples;
        /* The factor of a ramp is off by 4 units of Q30, in each of its samples. */
        double within = tolerance_of(2) + travel_rounding + fabs(travel_counts()) * 4 / 1073741824.0;
        TEST_ASSERT_DOUBLE_WITHIN(within, expected_factor(s) * values[index][2] + travelled, out[2]);
        TEST_ASSERT_DOUBLE_WITHIN(tolerance_of(0), expected_factor(s) * values[index][0], out[0]);
        if (s == 0)
            TEST_ASSERT_EACH_EQUAL_INT32(0, out, channels);
        if (s + 1 >= fade_in + periods * samples + fade_out) {
            TEST_ASSERT_EACH_EQUAL_INT32(0, out, 2); /* at rest where it has got to */
            TEST_ASSERT_EQUAL_INT32((int32_t)rint((double)player.travel.position_q30 / CORE_Q30_ONE), out[2]);
        }
    }
    /* Three whole periods and half of each ramp; the sums of s(t) over a ramp's samples are half of it within one. */
    TEST_ASSERT_DOUBLE_WITHIN(1.0, periods + 0.5 * (fade_in + fade_out) / samples,
                              (double)player.travel.position_q30 / (double)table.travel_q30);
    TEST_ASSERT_EQUAL_UINT32(0, player.err.saturated);
}

static void test_player_travels_with_the_faded_speed(void)
{
    build_travelling(msgen_format_i16, (int64_t)(70000.3 * CORE_Q30_ONE));
    check_travelling_run();
    build_travelling(msgen_format_i16, (int64_t)(-0.77 * CORE_Q30_ONE));
    check_travelling_run();
}

static void test_player_travel_of_a_period_is_exact_however_many(void)
{
    static const int64_t travels[] = {1, -99, 12345678901, -98765432109876};
    for (unsigned i = 0; i < sizeof travels / sizeof travels[0]; i++) {
        build_travelling(msgen_format_i16, travels[i]);
        struct msgen_player player;
        struct msgen_player_config config = {.periods = 1000, .abort_samples = 1};
        start(&player, &config);
        int32_t out[channels];
        for (unsigned s = 0; s <= 1000 * samples; s++) {
            msgen_player_step(&player, out);
            if (s % samples == 0)
                TEST_ASSERT_EQUAL_INT64((int64_t)(s / samples) * travels[i], player.travel.position_q30);
        }
        TEST_ASSERT_EQUAL_INT(msgen_phase_done, player.phase);
        TEST_ASSERT_EACH_EQUAL_INT32(0, out, 2);
    }
}

static void test_player_abort_at_every_sample_rests_where_it_is(void)
{
    build_travelling(msgen_format_i16, (int64_t)50000 * CORE_Q30_ONE);
    for (unsigned abort_at = 1; abort_at < fade_in + periods * samples + fade_out + 2; abort_at++) {
        struct msgen_player player;
        struct msgen_player_config config = usual();
        start(&player, &config);
        int32_t out[channels], before = 0;
        int64_t travelled = 0;
        for (unsigned s = 0; s < fade_in + periods * samples + fade_out + 5; s++) {
            if (s == abort_at)
                msgen_player_abort(&player);
            struct msgen_player_state state = msgen_player_step(&player, out);
            TEST_ASSERT_TRUE(fabs((double)out[2] - before) <= step_bound(2, abort_ramp) + travel_counts() / samples);
            TEST_ASSERT_TRUE(player.travel.position_q30 >= travelled); /* never back */
            /* What the travel may still gain is the ramp's half at full speed. */
            if (s >= abort_at && state.phase == msgen_phase_done)
                TEST_ASSERT_EQUAL_INT32((int32_t)rint((double)player.travel.position_q30 / CORE_Q30_ONE), out[2]);
            before = out[2];
            travelled = player.travel.position_q30;
        }
        TEST_ASSERT_EQUAL_INT(msgen_phase_done, player.phase);
        TEST_ASSERT_EACH_EQUAL_INT32(0, out, 2);
    }
}

static void test_player_travel_turns_with_the_gain(void)
{
    build_travelling(msgen_format_i16, (int64_t)1000 * CORE_Q30_ONE);
    struct msgen_player player;
    struct msgen_player_config config = {.periods = 4, .abort_samples = 1};
    config.gain_q16[2] = -2 * msgen_gain_one;
    start(&player, &config);
    int32_t out[channels];
    for (unsigned s = 0; s <= 4 * samples; s++)
        msgen_player_step(&player, out);
    TEST_ASSERT_EQUAL_INT32(-8000, out[2]);
}

static void test_player_f32_travels_alike(void)
{
    static const double travel = 2.5;
    build_travelling(msgen_format_f32, (int64_t)(travel * CORE_Q30_ONE));
    struct msgen_player player;
    struct msgen_player_config config = usual();
    start(&player, &config);
    double travelled = 0, last_speed = 0;
    float out[channels];
    for (unsigned s = 0; s < fade_in + periods * samples + fade_out + 5; s++) {
        struct msgen_player_state state = msgen_player_step_f32(&player, out);
        travelled += last_speed;
        last_speed = expected_factor(s) * travel / samples;
        double expected = expected_factor(s) * values[state.index][2] + travelled;
        TEST_ASSERT_DOUBLE_WITHIN(3e-7 * (3 + travelled), expected, (double)out[2]); /* 24 bits */
    }
    TEST_ASSERT_TRUE(out[0] == 0 && out[1] == 0);
    TEST_ASSERT_TRUE((double)out[2] > periods * travel);
}

static void test_player_refuses_travel_that_does_not_fit(void)
{
    struct msgen_player player;
    struct msgen_player_config config = {.periods = 1000, .abort_samples = 1};
    build_travelling(msgen_format_i16, (int64_t)2147000 * CORE_Q30_ONE);
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_player_init(&player, &table, &config));
    config.gain_q16[2] = 2 * msgen_gain_one;
    TEST_ASSERT_EQUAL_INT(core_err_player_travel, msgen_player_init(&player, &table, &config));
    config.gain_q16[2] = 0;
    config.limit[2] = 1000000000;
    TEST_ASSERT_EQUAL_INT(core_err_player_travel, msgen_player_init(&player, &table, &config));
    config.limit[2] = 0;
    config.periods = 1001;
    TEST_ASSERT_EQUAL_INT(core_err_player_travel, msgen_player_init(&player, &table, &config));
    config.periods = UINT32_MAX;
    config.fade_in_samples = config.fade_out_samples = msgen_ramp_samples_max;
    TEST_ASSERT_EQUAL_INT(core_err_player_travel, msgen_player_init(&player, &table, &config));
    build_travelling(msgen_format_i16, -((int64_t)1 << 61));
    config = (struct msgen_player_config){.periods = 2, .abort_samples = 1};
    TEST_ASSERT_EQUAL_INT(core_err_player_travel, msgen_player_init(&player, &table, &config));
}

enum { approach = 40, dwell = 25, lead = approach + dwell };

static struct msgen_player_config with_approach(void)
{
    struct msgen_player_config config = usual();
    config.fade_in_samples = 0;
    config.approach_samples = approach;
    config.dwell_samples = dwell;
    return config;
}

static double approach_factor(unsigned sample)
{
    return sample < approach ? smooth((double)sample / approach) : 1;
}

/* One sample of either format, as numbers. */
static struct msgen_player_state step_any(struct msgen_player *player, double *out)
{
    float real[channels];
    int32_t counts[channels];
    bool is_float = table.format == msgen_format_f32;
    struct msgen_player_state state =
        is_float ? msgen_player_step_f32(player, real) : msgen_player_step(player, counts);
    for (unsigned c = 0; c < channels; c++)
        out[c] = is_float ? (double)real[c] : (double)counts[c];
    return state;
}

static void test_player_approaches_stands_and_begins_at_the_start(void)
{
    for (int format = msgen_format_i16; format <= msgen_format_f32; format++) {
        build((enum msgen_format)format, 17);
        struct msgen_player player;
        struct msgen_player_config config = with_approach();
        double out[channels];
        start(&player, &config);
        double within = format == msgen_format_f32 ? 3e-7 * 3 : tolerance_of(2);
        for (unsigned s = 0; s < lead; s++) {
            struct msgen_player_state state = step_any(&player, out);
            TEST_ASSERT_EQUAL_INT(msgen_phase_approach, state.phase);
            TEST_ASSERT_EQUAL_UINT32(17, state.index);
            TEST_ASSERT_TRUE(out[0] == 0 && out[1] == 0);
            TEST_ASSERT_DOUBLE_WITHIN(within, approach_factor(s) * values[17][2], out[2]);
        }
        TEST_ASSERT_TRUE(out[2] == values[17][2]);
        for (unsigned s = 0; s < periods * samples; s++) {
            struct msgen_player_state state = step_any(&player, out);
            TEST_ASSERT_EQUAL_INT(msgen_phase_playing, state.phase);
            TEST_ASSERT_EQUAL_UINT32(s / samples, state.period);
            for (unsigned c = 0; c < channels; c++)
                TEST_ASSERT_TRUE(out[c] == values[(17 + s) % samples][c]);
        }
        TEST_ASSERT_EQUAL_INT(msgen_phase_fade_out, step_any(&player, out).phase);
    }
}

static void test_player_abort_of_an_approach_runs_back_without_a_jump(void)
{
    for (unsigned abort_at = 0; abort_at <= lead; abort_at++) {
        struct msgen_player player;
        struct msgen_player_config config = with_approach();
        int32_t out[channels], before = 0;
        start(&player, &config);
        double bound = 1.5 * fabs(values[17][2]) / abort_ramp + 1;
        for (unsigned s = 0; s <= abort_at + abort_ramp; s++) {
            if (s == abort_at)
                msgen_player_abort(&player);
            msgen_player_step(&player, out);
            TEST_ASSERT_EACH_EQUAL_INT32(0, out, 2);
            TEST_ASSERT_TRUE(fabs((double)out[2] - before) <= bound);
            before = out[2];
        }
        TEST_ASSERT_EQUAL_INT(msgen_phase_done, player.phase);
        TEST_ASSERT_EQUAL_INT32(0, out[2]);
    }
}

static void test_player_approach_sets_off_with_the_speed_of_travel(void)
{
    build_travelling(msgen_format_i16, (int64_t)(-20000.4 * CORE_Q30_ONE));
    for (unsigned n = 0; n < samples; n++) /* -200 on top: what the mean has to find */
        core_put_u16(bytes + msgen_header_travel_bytes + 4 + 2 * (channels * n + 1),
                     (uint16_t)(int16_t)(values[n][1] - 200));
    struct msgen_player player;
    struct msgen_player_config config = with_approach();
    start(&player, &config);
    double travelled = 0, last_factor = 0;
    for (unsigned s = 0; s < lead + samples; s++) {
        int32_t out[channels];
        double factor = approach_factor(s);
        unsigned index = s < lead ? 17 : (17 + s - lead) % samples;
        double velocity = s < lead ? factor * -200 : values[index][1] - 200;
        msgen_player_step(&player, out);
        travelled += last_factor * travel_counts() / samples;
        last_factor = factor;
        TEST_ASSERT_DOUBLE_WITHIN(1.5, velocity, out[1]); /* the mean in whole counts */
        TEST_ASSERT_DOUBLE_WITHIN(tolerance_of(2) + travel_rounding, factor * values[index][2] + travelled, out[2]);
        TEST_ASSERT_TRUE(out[0] == (s < lead ? 0 : (int32_t)values[index][0]));
    }
}

static void test_player_f32_approach_sets_off_with_the_speed_of_travel(void)
{
    build_travelling(msgen_format_f32, (int64_t)(2.5 * CORE_Q30_ONE));
    struct msgen_player player;
    struct msgen_player_config config = with_approach();
    float out[channels];
    start(&player, &config);
    for (unsigned s = 0; s < lead; s++) {
        msgen_player_step_f32(&player, out);
        /* 2.5 in 100 samples at 1 kHz, both scales 1; 24 bits of it */
        TEST_ASSERT_DOUBLE_WITHIN(25 * 3e-7, 25 * approach_factor(s), (double)out[1]);
    }
}

static void test_player_refuses_an_approach_that_is_none(void)
{
    struct msgen_player player;
    struct msgen_player_config config = with_approach();
    config.fade_in_samples = 1;
    TEST_ASSERT_EQUAL_INT(core_err_player_fade, msgen_player_init(&player, &table, &config));
    config = with_approach();
    config.approach_samples = msgen_ramp_samples_max + 1;
    TEST_ASSERT_EQUAL_INT(core_err_player_fade, msgen_player_init(&player, &table, &config));
    config = with_approach();
    config.dwell_samples = msgen_ramp_samples_max + 1;
    TEST_ASSERT_EQUAL_INT(core_err_player_fade, msgen_player_init(&player, &table, &config));
    build_travelling(msgen_format_i16, (int64_t)2147000 * CORE_Q30_ONE);
    config = (struct msgen_player_config){.periods = 1000, .abort_samples = 1, .approach_samples = 1};
    config.dwell_samples = 2 * samples; /* a thousand periods fit without it */
    TEST_ASSERT_EQUAL_INT(core_err_player_travel, msgen_player_init(&player, &table, &config));
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
    RUN_TEST(test_player_without_travel_puts_out_the_same_bits_as_ever);
    RUN_TEST(test_player_travels_with_the_faded_speed);
    RUN_TEST(test_player_travel_of_a_period_is_exact_however_many);
    RUN_TEST(test_player_abort_at_every_sample_rests_where_it_is);
    RUN_TEST(test_player_travel_turns_with_the_gain);
    RUN_TEST(test_player_f32_travels_alike);
    RUN_TEST(test_player_refuses_travel_that_does_not_fit);
    RUN_TEST(test_player_approaches_stands_and_begins_at_the_start);
    RUN_TEST(test_player_abort_of_an_approach_runs_back_without_a_jump);
    RUN_TEST(test_player_approach_sets_off_with_the_speed_of_travel);
    RUN_TEST(test_player_f32_approach_sets_off_with_the_speed_of_travel);
    RUN_TEST(test_player_refuses_an_approach_that_is_none);
    return UNITY_END();
}
