/* SPDX-License-Identifier: MIT */
/* Needs math.h; firmware whose tables are in flash leaves this file out. */
#include "frf/kernel.h"
#include "frf/two_level.h"

#include <math.h>

/* Of the fine factors: Q34, and Q18 for products of 16 bits. */
static const double turn_one = 17179869184.0, turn_one_q15 = 262144.0;

/* |b| <= pi / 32, of which the kernels' words make use. */
CORE_STATIC_ASSERT(FRF_COARSE_POINTS(64u) >= 32u && FRF_COARSE_POINTS(512u) >= 32u && FRF_COARSE_POINTS(1024u) >= 32u,
                   a_group_is_a_32nd_at_most);
CORE_STATIC_ASSERT(FRF_COARSE_POINTS(2048u) >= 32u && FRF_COARSE_POINTS(8192u) >= 32u &&
                       FRF_COARSE_POINTS(32768u) >= 32u,
                   a_group_is_a_32nd_at_most_of_longer_periods);

static uint32_t turns_of(uint32_t period)
{
    return 1u << frf_group_bits(period);
}

static uint32_t points_of(uint32_t period)
{
    return (period + turns_of(period) - 1u) >> frf_group_bits(period);
}

static enum core_status check(const void *coarse, uint32_t coarse_points, const void *fine, uint32_t fine_turns,
                              uint32_t period, const void *out_table)
{
    enum core_status status = fine ? frf_check_table(coarse, period, out_table) : core_err_argument;
    if (status != core_ok) {
        return status;
    }
    return coarse_points < points_of(period) || fine_turns < turns_of(period) ? core_err_storage : core_ok;
}

/* Of an index that may be less than N below 0 or beyond the last, in eighths of a sample. */
static uint32_t eighths_of(int32_t index, uint32_t period)
{
    uint32_t within = index < 0 ? (uint32_t)(index + (int32_t)period) : (uint32_t)index;
    return 8u * (within >= period ? within - period : within);
}

static double sine_of(int32_t index, uint32_t period)
{
    return frf_sine_of_eighths(eighths_of(index, period), period);
}

static double cosine_of(int32_t index, uint32_t period)
{
    uint32_t eighths = eighths_of(index, period) + 2u * period;
    return frf_sine_of_eighths(eighths >= 8u * period ? eighths - 8u * period : eighths, period);
}

/* 1 - cos b without the cancellation: 2 sin^2(b/2), half a sample being four eighths. */
static double less_of(int32_t index, uint32_t period)
{
    double half = frf_sine_of_eighths(4u * (uint32_t)(index < 0 ? -index : index), period);
    return 2.0 * half * half;
}

/* Index of a group's middle, which the fine angles are counted from. */
static uint32_t middle_of(uint32_t group, uint32_t period)
{
    return (group << frf_group_bits(period)) + turns_of(period) / 2u;
}

static int32_t turn_index(uint32_t turn, uint32_t period)
{
    return (int32_t)turn - (int32_t)(turns_of(period) / 2u);
}

static void build_coarse(struct frf_point *coarse, double one, uint32_t period)
{
    for (uint32_t g = 0; g < points_of(period); ++g) {
        int32_t index = (int32_t)middle_of(g, period);
        coarse[g].cosine = (int32_t)round(one * cosine_of(index, period));
        coarse[g].sine = (int32_t)round(one * sine_of(index, period));
    }
}

static void build_fine(struct frf_turn *fine, uint32_t period)
{
    for (uint32_t t = 0; t < turns_of(period); ++t) {
        int32_t index = turn_index(t, period);
        fine[t].less = (int32_t)round(turn_one * less_of(index, period));
        fine[t].sine = (int32_t)round(turn_one * sine_of(index, period));
    }
}

/* A factor on an axis is 1 or -1, and the roundings of its parts may make it a step more, which wraps or is beyond the
 * largest factor: a step off the coarse value then. All others are nine steps and more below for N up to 65536. */
static void keep_axes(struct frf_point *coarse, const struct frf_turn *fine, uint32_t period)
{
    uint32_t quarters = period % 4u == 0u ? 1u : period % 2u == 0u ? 2u : 4u; /* that are apart a whole index */
    for (uint32_t quarter = 0; quarter < 4u; quarter += quarters) {
        uint32_t index = quarter * period / 4u, turn = index % turns_of(period);
        struct frf_point *point = &coarse[index / turns_of(period)];
        struct frf_point factor = frf_two_level_factor_q31(point, &fine[turn]);
        int32_t value = quarter % 2u == 0u ? factor.cosine : factor.sine;
        int32_t *part = quarter % 2u == 0u ? &point->cosine : &point->sine;
        if (quarter < 2u && value < 0) {
            *part -= 1;
        }
        if (quarter >= 2u && value < -FRF_Q31_ONE) {
            *part += 1;
        }
    }
}

enum core_status frf_two_level_build_q15(struct frf_point *coarse, uint32_t coarse_points, struct frf_turn_q15 *fine,
                                         uint32_t fine_turns, uint32_t period_samples,
                                         struct frf_two_level_q15 *out_table)
{
    enum core_status status = check(coarse, coarse_points, fine, fine_turns, period_samples, out_table);
    if (status != core_ok) {
        return status;
    }
    build_coarse(coarse, FRF_Q15_ONE * 65536.0, period_samples);
    for (uint32_t t = 0; t < turns_of(period_samples); ++t) {
        int32_t index = turn_index(t, period_samples);
        fine[t].less = (int16_t)round(turn_one_q15 * less_of(index, period_samples));
        fine[t].sine = (int16_t)round(turn_one_q15 * sine_of(index, period_samples));
    }
    out_table->coarse = coarse;
    out_table->fine = fine;
    out_table->period_samples = period_samples;
    out_table->group_bits = frf_group_bits(period_samples);
    return core_ok;
}

enum core_status frf_two_level_build_q23(struct frf_point *coarse, uint32_t coarse_points, struct frf_turn *fine,
                                         uint32_t fine_turns, uint32_t period_samples,
                                         struct frf_two_level_q23 *out_table)
{
    enum core_status status = check(coarse, coarse_points, fine, fine_turns, period_samples, out_table);
    if (status != core_ok) {
        return status;
    }
    build_coarse(coarse, FRF_Q23_ONE * 256.0, period_samples);
    build_fine(fine, period_samples);
    out_table->coarse = coarse;
    out_table->fine = fine;
    out_table->period_samples = period_samples;
    out_table->group_bits = frf_group_bits(period_samples);
    return core_ok;
}

enum core_status frf_two_level_build_q31(struct frf_point *coarse, uint32_t coarse_points, struct frf_turn *fine,
                                         uint32_t fine_turns, uint32_t period_samples,
                                         struct frf_two_level_q31 *out_table)
{
    enum core_status status = check(coarse, coarse_points, fine, fine_turns, period_samples, out_table);
    if (status != core_ok) {
        return status;
    }
    build_coarse(coarse, FRF_Q31_ONE, period_samples);
    build_fine(fine, period_samples);
    keep_axes(coarse, fine, period_samples);
    out_table->coarse = coarse;
    out_table->fine = fine;
    out_table->period_samples = period_samples;
    out_table->group_bits = frf_group_bits(period_samples);
    return core_ok;
}

enum core_status frf_two_level_build_f32(struct frf_point_f32 *coarse, uint32_t coarse_points,
                                         struct frf_turn_f32 *fine, uint32_t fine_turns, uint32_t period_samples,
                                         struct frf_two_level_f32 *out_table)
{
    enum core_status status = check(coarse, coarse_points, fine, fine_turns, period_samples, out_table);
    if (status != core_ok) {
        return status;
    }
    for (uint32_t g = 0; g < points_of(period_samples); ++g) {
        int32_t index = (int32_t)middle_of(g, period_samples);
        coarse[g].cosine = (float)cosine_of(index, period_samples);
        coarse[g].sine = (float)sine_of(index, period_samples);
    }
    for (uint32_t t = 0; t < turns_of(period_samples); ++t) {
        int32_t index = turn_index(t, period_samples);
        fine[t].less = (float)less_of(index, period_samples);
        fine[t].sine = (float)sine_of(index, period_samples);
    }
    out_table->coarse = coarse;
    out_table->fine = fine;
    out_table->period_samples = period_samples;
    out_table->group_bits = frf_group_bits(period_samples);
    return core_ok;
}
