/* SPDX-License-Identifier: MIT */
/// Whether the end of a measurement is told from its beginning: lab/measure/drift.h.
#include "lab/measure/drift.h"

#include "core/bytes.h"
#include "core/crc32.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;
static const double noise = 0.05;
/// Three standard deviations of the share among the 400 lines of all trials.
static const double share_tolerance = 0.03;

enum { samples = 64, settle = 1, periods = 10, rows = (settle + periods) * samples, bin_count = 10, trials = 40 };

static uint8_t table_storage[msgen_header_bytes + 4 * bin_count + 12 * samples];
static struct msgen_table table;
static struct run run;
static struct measure_summary summary;
static struct measure_drift drift;
static struct random random_numbers;

static void make_table(void)
{
    struct msgen_table header = {.rate_num_hz = 1000,
                                 .rate_den = 1,
                                 .period_samples = samples,
                                 .bin_count = bin_count,
                                 .channels = 3,
                                 .format = msgen_format_f32};
    union core_float_bits one = {.value = 1.0f};
    uint8_t *data = table_storage + msgen_header_bytes;
    memset(table_storage, 0, sizeof table_storage);
    for (uint32_t c = 0; c < 3; c++) {
        header.scale_bits[c] = one.bits;
    }
    for (uint32_t b = 0; b < bin_count; b++) {
        core_put_u32(data + 4 * b, b + 1);
    }
    header.data_crc32 = core_crc32(0, data, sizeof table_storage - msgen_header_bytes);
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_encode_header(&header, table_storage));
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_open(table_storage, sizeof table_storage, &table));
}

/// Line 3 of the velocity is `change` larger in the later half of the counted periods.
static void make_run(double change, size_t counted)
{
    run = (struct run){.rows = rows,
                       .sample_rate_hz = 1000.0,
                       .period_samples = samples,
                       .settle_periods = settle,
                       .periods = counted};
    double *torque = run_add_column(&run, "torque_Nm");
    double *velocity = run_add_column(&run, "velocity_rad_per_s");
    double *position = run_add_column(&run, "position_rad");
    for (size_t n = 0; n < rows; n++) {
        const bool later = n >= (settle + periods / 2) * samples;
        torque[n] = noise * random_normal(&random_numbers);
        velocity[n] = (later ? change : 0.0) * cos(two_pi * 3.0 * (double)n / samples + 1.0) +
                      noise * random_normal(&random_numbers);
        position[n] = 0.0;
    }
}

static void find(void)
{
    const struct guard_real_limits limits = GUARD_REAL_LIMITS_NONE;
    measure_drift_free(&drift);
    measure_summary_free(&summary);
    TEST_ASSERT_TRUE(measure_summary_make(&run, &table, &limits, rows, &summary));
    TEST_ASSERT_TRUE(measure_drift_find(&summary, &drift));
}

void setUp(void)
{
    random_seed(&random_numbers, 17);
    make_table();
}

void tearDown(void)
{
    measure_drift_free(&drift);
    measure_summary_free(&summary);
    run_free(&run);
}

/* 2 std of the difference are 2 noise sqrt(2 / 64) sqrt(1/5 + 1/5) sqrt(2) / sqrt(2) = 0.0112 in amplitude: 0.1 is nine
   of them, give or take what noise does to both. */
static void test_drift_shows_at_the_line_that_changed(void)
{
    make_run(0.1, periods);
    find();
    TEST_ASSERT_EQUAL_size_t(5, drift.periods[0]);
    TEST_ASSERT_EQUAL_size_t(5, drift.periods[1]);
    TEST_ASSERT_TRUE(drift.over_two_std[measure_velocity][2] > 5.0 && drift.over_two_std[measure_velocity][2] < 18.0);
    TEST_ASSERT_TRUE(drift.over_two_std[measure_velocity][5] < 3.0);
    TEST_ASSERT_TRUE(drift.over_two_std[measure_torque][2] < 3.0);
}

static void test_drift_of_noise_is_as_rare_as_said(void)
{
    size_t beyond = 0;
    for (int trial = 0; trial < trials; trial++) {
        run_free(&run);
        make_run(0.0, periods);
        find();
        beyond += drift.beyond[measure_velocity];
    }
    TEST_ASSERT_DOUBLE_WITHIN(share_tolerance, drift.chance, (double)beyond / (trials * bin_count));
}

static void test_drift_needs_two_periods_in_each_half(void)
{
    make_run(0.0, periods);
    double *valid = run_add_column(&run, "valid");
    for (size_t n = 0; n < rows; n++) {
        valid[n] = n / samples <= 3 ? 1.0 : 0.0; // three counted periods are whole
    }
    find();
    TEST_ASSERT_NULL(drift.over_two_std[0]);
    TEST_ASSERT_EQUAL_size_t(3, drift.periods[0] + drift.periods[1]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_drift_shows_at_the_line_that_changed);
    RUN_TEST(test_drift_of_noise_is_as_rare_as_said);
    RUN_TEST(test_drift_needs_two_periods_in_each_half);
    return UNITY_END();
}
