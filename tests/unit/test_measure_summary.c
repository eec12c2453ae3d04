/* SPDX-License-Identifier: MIT */
#include "lab/measure/summary.h"

#include "core/bytes.h"
#include "core/crc32.h"
#include "lab/measure/live.h"
#include "lab/measure/report.h"
#include "unity.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;
/// Tables are float32: 24 bits of a value of at most 2.
static const double float_rounding = 1e-6;

enum { samples = 40, settle = 1, periods = 4, rows = (settle + periods) * samples + 7, bin_count = 2 };
static const uint32_t bins[bin_count] = {2, 5};
static const double table_amplitude[2][bin_count] = {{0.75, 0.25}, {1.5, 0.125}};
static const double measured_over_table[2] = {2.0, 0.5};
/// What the first counted period is off, as a share of the last one.
static const double transient = 0.125;

static uint8_t table_storage[msgen_header_bytes + 4 * bin_count + 12 * samples];
static struct msgen_table table;
static struct run run;
static struct measure_summary summary;

static double wave(size_t channel, size_t n)
{
    double value = 0.0;
    for (size_t b = 0; b < bin_count; b++) {
        value += table_amplitude[channel][b] * cos(two_pi * bins[b] * (double)n / samples + (double)(b + channel));
    }
    return value;
}

static void make_table(void)
{
    struct msgen_table header = {.rate_num_hz = 1000,
                                 .rate_den = 1,
                                 .period_samples = samples,
                                 .bin_count = bin_count,
                                 .channels = 3,
                                 .format = msgen_format_f32};
    union core_float_bits number = {.value = 1.0f};
    for (uint32_t c = 0; c < 3; c++) {
        header.scale_bits[c] = number.bits;
    }
    uint8_t *data = table_storage + msgen_header_bytes;
    for (size_t b = 0; b < bin_count; b++) {
        core_put_u32(data + 4 * b, bins[b]);
    }
    for (size_t n = 0; n < samples; n++) {
        for (size_t c = 0; c < 3; c++) {
            number.value = c < 2 ? (float)wave(c, n) : 0.25f;
            core_put_u32(data + 4 * bin_count + 4 * (3 * n + c), number.bits);
        }
    }
    header.data_crc32 = core_crc32(0, data, sizeof table_storage - msgen_header_bytes);
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_encode_header(&header, table_storage));
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_open(table_storage, sizeof table_storage, &table));
}

/// Measured multiples of the table; the velocity's first counted period is stronger.
static void make_run(void)
{
    run = (struct run){.rows = rows,
                       .sample_rate_hz = 1000.0,
                       .period_samples = samples,
                       .settle_periods = settle,
                       .periods = periods};
    double *torque = run_add_column(&run, "torque_Nm");
    double *velocity = run_add_column(&run, "velocity_rad_per_s");
    double *position = run_add_column(&run, "position_rad");
    for (size_t n = 0; n < rows; n++) {
        const bool first = n / samples == settle;
        torque[n] = measured_over_table[0] * wave(0, n);
        velocity[n] = measured_over_table[1] * wave(1, n) * (first ? 1.0 + transient : 1.0);
        position[n] = -0.5;
    }
    TEST_ASSERT_TRUE(run_set_key(&run, "mode", "cascade"));
}

static void lose(size_t first, size_t count)
{
    double *valid = run_add_column(&run, "valid");
    for (size_t n = 0; n < rows; n++) {
        valid[n] = n >= first && n < first + count ? 0.0 : 1.0;
        if (valid[n] == 0.0) {
            run.columns[0].data[n] = 1000.0; // what stands in a lost row counts nowhere
            run.columns[1].data[n] = 1000.0;
        }
    }
}

static void summarise(void)
{
    struct guard_real_limits limits = GUARD_REAL_LIMITS_NONE;
    limits.torque_max_Nm = 4.0;
    limits.position_min_rad = -1.0;
    limits.position_max_rad = 3.0;
    measure_summary_free(&summary);
    TEST_ASSERT_TRUE(measure_summary_make(&run, &table, &limits, rows, &summary));
}

void setUp(void)
{
    make_table();
    make_run();
}

void tearDown(void)
{
    measure_summary_free(&summary);
    run_free(&run);
}

static void test_summary_amplitudes_are_those_of_the_mean_period(void)
{
    summarise();
    TEST_ASSERT_EQUAL_size_t(periods, summary.averaged);
    const double mean[2] = {1.0, 1.0 + transient / periods};
    for (size_t q = 0; q < 2; q++) {
        for (size_t b = 0; b < bin_count; b++) {
            const double expected = table_amplitude[q][b];
            TEST_ASSERT_DOUBLE_WITHIN(float_rounding, 25.0 * bins[b], summary.frequency_hz[b]);
            TEST_ASSERT_DOUBLE_WITHIN(float_rounding, expected, summary.table_amplitude[q][b]);
            TEST_ASSERT_DOUBLE_WITHIN(float_rounding, measured_over_table[q] * mean[q] * expected,
                                      summary.amplitude[q][b]);
        }
    }
}

static void test_summary_distance_shows_the_transient_and_nothing_else(void)
{
    summarise();
    TEST_ASSERT_EQUAL_size_t(settle + periods, summary.whole);
    TEST_ASSERT_EQUAL_size_t(settle + periods - 1, summary.reference);
    TEST_ASSERT_DOUBLE_WITHIN(float_rounding, transient, measure_summary_first(&summary, measure_velocity));
    TEST_ASSERT_DOUBLE_WITHIN(float_rounding, 0.0, measure_summary_first(&summary, measure_torque));
    TEST_ASSERT_DOUBLE_WITHIN(float_rounding, 0.0, measure_summary_usual(&summary, measure_velocity));
    TEST_ASSERT_TRUE(isnan(summary.distance[measure_velocity][summary.reference]));
}

static void test_summary_level_counts_each_limit_its_own_way(void)
{
    summarise();
    double peak = 0.0;
    for (size_t n = 0; n < samples; n++) {
        peak = fmax(peak, measured_over_table[0] * fabs(wave(0, n)));
    }
    TEST_ASSERT_DOUBLE_WITHIN(float_rounding, peak, summary.level[measure_torque].peak);
    TEST_ASSERT_DOUBLE_WITHIN(float_rounding, peak / 4.0, summary.level[measure_torque].used);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, summary.level[measure_velocity].limit);
    // Half way to the limit on its own side, not a sixth of the way to the other.
    TEST_ASSERT_DOUBLE_WITHIN(float_rounding, 0.5, summary.level[measure_position].used);
}

static void test_summary_lost_samples_cost_their_period_only(void)
{
    lose((settle + periods - 1) * samples + 3, 2);
    summarise();
    TEST_ASSERT_EQUAL_size_t(2, summary.lost);
    TEST_ASSERT_EQUAL_size_t(1, summary.periods_with_lost);
    TEST_ASSERT_EQUAL_size_t(periods - 1, summary.averaged);
    TEST_ASSERT_EQUAL_size_t(settle + periods - 2, summary.reference);
    TEST_ASSERT_TRUE(summary.level[measure_torque].peak < 10.0);
    const size_t part = measure_part_of((settle + periods - 1) * samples + 3, rows);
    TEST_ASSERT_TRUE(part < measure_parts);
    TEST_ASSERT_EQUAL_UINT32(2, summary.lost_in_part[part] + summary.lost_in_part[part + 1]);
}

static void test_summary_of_less_than_a_period_says_what_there_is(void)
{
    run.rows = samples - 1;
    run.settle_periods = run.periods = 0;
    summarise();
    TEST_ASSERT_EQUAL_size_t(0, summary.whole);
    TEST_ASSERT_EQUAL_size_t(0, summary.averaged);
    TEST_ASSERT_TRUE(isnan(summary.amplitude[measure_torque][0]));
    TEST_ASSERT_TRUE(isnan(measure_summary_first(&summary, measure_velocity)));
    TEST_ASSERT_TRUE(summary.level[measure_torque].peak > 0.0);
}

/// Whether the page of a summary holds a text.
static bool page_holds(const struct measure_report *report, const char *text)
{
    static char buffer[400000];
    FILE *out = tmpfile();
    struct page page;
    TEST_ASSERT_NOT_NULL(out);
    page_start(&page, out, "test", NULL);
    measure_page_sections(&page, &summary, report);
    TEST_ASSERT_EQUAL_INT(0, page_end(&page, NULL));
    rewind(out);
    buffer[fread(buffer, 1, sizeof buffer - 1, out)] = '\0';
    fclose(out);
    return strstr(buffer, text) != NULL;
}

static void test_page_says_what_is_wrong_and_only_then(void)
{
    struct measure_report report = {.end = measure_complete, .rows_planned = rows};
    summarise();
    TEST_ASSERT_TRUE(page_holds(&report, "No sample was lost"));
    TEST_ASSERT_TRUE(page_holds(&report, "Not settled"));
    TEST_ASSERT_FALSE(page_holds(&report, "SYNC is"));
    report.late_in_part[3] = 2; // of 207
    TEST_ASSERT_FALSE(page_holds(&report, "Samples came late"));
    report.late_in_part[4] = 1;
    TEST_ASSERT_TRUE(page_holds(&report, "Samples came late"));
    TEST_ASSERT_TRUE(run_set_key(&run, "real_time", "SCHED_FIFO"));
    TEST_ASSERT_TRUE(run_set_key(&run, "sync_jitter_us", "mean 10.0, std 5.0, p99 50, max 99"));
    TEST_ASSERT_TRUE(page_holds(&report, "SYNC is even"));
    TEST_ASSERT_TRUE(run_set_key(&run, "sync_jitter_us", "mean 10.0, std 5.0, p99 50, max 101"));
    TEST_ASSERT_TRUE(page_holds(&report, "SYNC is uneven"));
    lose(samples, 1);
    summarise();
    TEST_ASSERT_TRUE(page_holds(&report, "frf leaves out the 1 of 4 counted periods"));
}

static void test_page_of_a_run_that_ended_within_a_period(void)
{
    struct measure_report report = {
        .end = measure_interrupted, .stopped_by = "interrupted by the user", .rows_planned = rows};
    run.rows = samples - 1;
    run.settle_periods = run.periods = 0;
    summarise();
    TEST_ASSERT_TRUE(page_holds(&report, "interrupted by the user. Kept are 39 of 207 rows"));
    TEST_ASSERT_TRUE(page_holds(&report, "No period came whole"));
}

static void feed(struct measure_live *live, size_t from, size_t count, bool valid)
{
    for (size_t n = from; n < from + count; n++) {
        const struct drive_sample sample = {0.0, (double)n, -0.5 * (double)n, 2.0 * (double)n, valid};
        measure_live_add(live, &sample, true, (uint32_t)(n / 10));
    }
}

static void test_live_gives_the_last_whole_period(void)
{
    struct measure_live live;
    double torque[samples], velocity[samples];
    TEST_ASSERT_TRUE(measure_live_alloc(&live, samples));
    feed(&live, 0, samples - 1, true);
    TEST_ASSERT_EQUAL_size_t(0, measure_live_read_period(&live, torque, velocity));
    feed(&live, samples - 1, samples + 1, true);
    TEST_ASSERT_EQUAL_size_t(2, measure_live_read_period(&live, torque, velocity));
    TEST_ASSERT_EQUAL_DOUBLE(samples, torque[0]);
    TEST_ASSERT_EQUAL_DOUBLE(2.0 * (2 * samples - 1), velocity[samples - 1]);
    feed(&live, 2 * samples, 1, false);
    feed(&live, 2 * samples + 1, samples - 2, true);
    TEST_ASSERT_EQUAL_size_t(2, measure_live_read_period(&live, torque, velocity));
    // The loop goes on to the half that the second period stands in: it must not be given out in pieces.
    feed(&live, 3 * samples - 1, 2, true);
    TEST_ASSERT_EQUAL_size_t(0, measure_live_read_period(&live, torque, velocity));
    TEST_ASSERT_EQUAL_size_t(1, atomic_load(&live.lost));
    TEST_ASSERT_EQUAL_FLOAT(3.0f * samples, atomic_load(&live.torque_peak_Nm));
    TEST_ASSERT_EQUAL_FLOAT(-1.5f * samples, atomic_load(&live.position_low_rad));
    TEST_ASSERT_EQUAL_UINT(3 * samples / 10, atomic_load(&live.late));
    measure_live_free(&live);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_summary_amplitudes_are_those_of_the_mean_period);
    RUN_TEST(test_summary_distance_shows_the_transient_and_nothing_else);
    RUN_TEST(test_summary_level_counts_each_limit_its_own_way);
    RUN_TEST(test_summary_lost_samples_cost_their_period_only);
    RUN_TEST(test_summary_of_less_than_a_period_says_what_there_is);
    RUN_TEST(test_page_says_what_is_wrong_and_only_then);
    RUN_TEST(test_page_of_a_run_that_ended_within_a_period);
    RUN_TEST(test_live_gives_the_last_whole_period);
    return UNITY_END();
}
