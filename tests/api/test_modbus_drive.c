/* SPDX-License-Identifier: MIT */
/// Through the host's side of the registers: a table goes into the simulated drive, which measures by itself; its
/// response against the streamed measurement of the same model, and what is kept.
#include "lab/estimate/frf_mean.h"
#include "lab/estimate/periodic.h"
#include "lab/measure/measure.h"
#include "sim/node/direct_drive.h"
#include "tests/support/modbus_bench.h"

#include <complex.h>
#include <stdio.h>

enum { periods = 10, settle = 1 };
/// The drive transforms in single precision: 125 dB at this length (lib/frf/dft.h); here against means of its own.
static const double float_share = 2e-6;

static struct modbus_host host;
static struct modbus_host_state state;
static struct modbus_record records[bench_lines], mean[bench_lines];
static struct modbus_host_spectrum spectrum;

void setUp(void)
{
    bench_begin();
}

void tearDown(void)
{
    bench_end();
}

static double complex number(const float pair[2])
{
    return (double)pair[0] + I * (double)pair[1];
}

static void stream(struct frf *out_frf)
{
    static struct direct_drive direct;
    const struct drive drive = direct_drive_init(&direct, &bench_model);
    const struct measure_plan plan = {
        .table = &bench_view, .settle_periods = settle, .periods = periods, .limits = GUARD_REAL_LIMITS_NONE};
    const struct periodic_options options = {.settle = periodic_settle_default};
    struct measure_report report;
    struct run run;
    struct periodic recording;
    struct error error = {0, ""};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure_run(&drive, &plan, &run, &report, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &options, &recording, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_mean_estimate(&recording, NULL, out_frf, &error), error.message);
    periodic_free(&recording);
    run_free(&run);
}

static void test_modbus_drive_measures_the_streamed_response(void)
{
    const struct modbus_host_setup setup = bench_setup(settle, periods);
    struct frf streamed;
    bench_start(&host, &setup);
    bench_follow(&host, &state);
    TEST_ASSERT_EQUAL_INT(modbus_end_complete, state.end);
    TEST_ASSERT_EQUAL_UINT32(periods, state.periods_valid);
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_spectrum(&host, MODBUS_MEAN, bench_lines, mean, &spectrum));
    TEST_ASSERT_EQUAL_UINT32(periods, spectrum.count);
    stream(&streamed);
    unsigned close = 0;
    for (unsigned b = 0; b < bench_lines; b++) {
        double complex input = number(mean[b].input), response = number(mean[b].output) / input;
        double gain = cabs(response);
        double variance = ((double)mean[b].output_variance + gain * gain * (double)mean[b].input_variance -
                           2.0 * creal(conj(response) * number(mean[b].covariance))) /
                          (periods * creal(input * conj(input)));
        double off = cabs(response - (streamed.real[b] + I * streamed.imag[b]));
        close += off <= 2.0 * sqrt(variance + streamed.std[b] * streamed.std[b]);
    }
    printf("in the drive and streamed: %u of %d lines within 2 sigma\n", close, bench_lines);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(0.95 * bench_lines, close);
    frf_free(&streamed);
}

static void test_modbus_drive_means_are_those_of_its_periods(void)
{
    const struct modbus_host_setup setup = bench_setup(settle, periods);
    double complex input[bench_lines] = {0}, output[bench_lines] = {0}, cross[bench_lines] = {0};
    static struct modbus_record single[periods][bench_lines];
    bench_start(&host, &setup);
    bench_follow(&host, &state);
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_spectrum(&host, MODBUS_MEAN, bench_lines, mean, &spectrum));
    for (uint32_t p = 0; p < periods; p++) {
        TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_spectrum(&host, p, bench_lines, single[p], &spectrum));
        TEST_ASSERT_EQUAL_UINT32(modbus_spectrum_valid, spectrum.validity);
        for (unsigned b = 0; b < bench_lines; b++) {
            input[b] += number(single[p][b].input) / periods;
            output[b] += number(single[p][b].output) / periods;
        }
    }
    for (unsigned b = 0; b < bench_lines; b++) {
        double variance = 0.0;
        for (uint32_t p = 0; p < periods; p++) {
            double complex u = number(single[p][b].input) - input[b], y = number(single[p][b].output) - output[b];
            variance += creal(y * conj(y)) / (periods - 1);
            cross[b] += y * conj(u) / (periods - 1);
        }
        TEST_ASSERT_DOUBLE_WITHIN(float_share * cabs(input[b]), 0.0, cabs(input[b] - number(mean[b].input)));
        TEST_ASSERT_DOUBLE_WITHIN(float_share * cabs(output[b]), 0.0, cabs(output[b] - number(mean[b].output)));
        // The deviations are hundreds of times smaller than what they deviate from, and so have fewer digits.
        TEST_ASSERT_DOUBLE_WITHIN(1e-3 * variance, variance, (double)mean[b].output_variance);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3 * sqrt(variance * (double)mean[b].input_variance), 0.0,
                                  cabs(cross[b] - number(mean[b].covariance)));
    }
}

static void test_modbus_drive_keeps_the_last_periods(void)
{
    const struct modbus_host_setup setup = bench_setup(0, modbus_drive_periods_kept + 5);
    bench_start(&host, &setup);
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_spectrum(&host, 0, bench_lines, records, &spectrum));
    TEST_ASSERT_EQUAL_UINT32(modbus_spectrum_not_yet, spectrum.validity);
    bench_follow(&host, &state);
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_spectrum(&host, 4, bench_lines, records, &spectrum));
    TEST_ASSERT_EQUAL_UINT32(modbus_spectrum_not_kept, spectrum.validity);
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_spectrum(&host, 5, bench_lines, records, &spectrum));
    TEST_ASSERT_EQUAL_UINT32(modbus_spectrum_valid, spectrum.validity);
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_spectrum(&host, MODBUS_MEAN, bench_lines, mean, &spectrum));
    TEST_ASSERT_EQUAL_UINT32(modbus_drive_periods_kept + 5, spectrum.count);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_modbus_drive_measures_the_streamed_response);
    RUN_TEST(test_modbus_drive_means_are_those_of_its_periods);
    RUN_TEST(test_modbus_drive_keeps_the_last_periods);
    return UNITY_END();
}
