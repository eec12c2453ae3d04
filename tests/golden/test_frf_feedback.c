/* SPDX-License-Identifier: MIT */
/// Third paper, 2.15.3: which estimators find the response in a closed loop.
///
/// Reading: y = G u + v, u = r - y, G = .3 q / (1 - .8 q), v white with standard deviation 1, r a flat multisine of RMS
///          1
/// (2.13) or white with standard deviation 1 (2.14), (2.15); N = 256, M = 10000 periods or as many samples, 100 where
/// the test is short. Error: mean of |Ghat - G| / |G| over bins 5, 20, 45, 70, 95 and 120, in dB. Ours of (2.14),
/// (2.15) overlap their segments, which the paper's do not.
#include "lab/estimate/frf_h1.h"
#include "lab/estimate/frf_indirect.h"
#include "lab/estimate/frf_mean.h"
#include "lab/numeric/statistics.h"
#include "tests/support/claim.h"

#include <complex.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

enum { length = 256, lines = length / 2 - 1, judged = 6 };

static const size_t judged_bins[judged] = {5, 20, 45, 70, 95, 120};

void setUp(void) {}

void tearDown(void) {}

static double complex truth(size_t bin)
{
    double complex q = cexp(-I * two_pi * (double)bin / length);
    return 0.3 * q / (1.0 - 0.8 * q);
}

/// What (2.14) tends to: (G sr^2 - sv^2) / (sr^2 + sv^2) with both 1.
static double complex printed_limit(size_t bin)
{
    return (truth(bin) - 1.0) / 2.0;
}

static void make_run(size_t periods, struct run *out_run)
{
    static char path[] = "loop";
    *out_run = (struct run){.path = path, .sample_rate_hz = length, .rows = periods * length};
    TEST_ASSERT_NOT_NULL(run_add_column(out_run, "torque_Nm"));
    TEST_ASSERT_NOT_NULL(run_add_column(out_run, "velocity_rad_per_s"));
    TEST_ASSERT_NOT_NULL(run_add_column(out_run, "velocity_ref_rad_per_s"));
}

static void free_run(struct run *run)
{
    run->path = NULL;
    run_free(run);
}

static void close_loop(struct run *run, struct random *random)
{
    double state = 0.0;
    for (size_t n = 0; n < run->rows; n++) {
        double y = state + random_normal(random);
        double u = run->columns[2].data[n] - y;
        run->columns[0].data[n] = u;
        run->columns[1].data[n] = y;
        state = 0.8 * state + 0.3 * u;
    }
}

static void fill_with_noise(struct run *run, struct random *random)
{
    for (size_t n = 0; n < run->rows; n++) {
        run->columns[2].data[n] = random_normal(random);
    }
}

static void fill_with_multisine(struct run *run, struct random *random)
{
    double *reference = run->columns[2].data;
    for (size_t k = 1; k <= lines; k++) {
        double phase = two_pi * random_uniform(random);
        for (size_t n = 0; n < length; n++) {
            reference[n] += sqrt(2.0 / lines) * cos(two_pi * (double)(k * n % length) / length + phase);
        }
    }
    for (size_t n = length; n < run->rows; n++) {
        reference[n] = reference[n - length];
    }
}

static double error_db(const struct frf *frf, double complex (*wanted)(size_t bin))
{
    double sum = 0.0;
    for (size_t i = 0; i < judged; i++) {
        size_t line = judged_bins[i] - 1;
        double complex exact = wanted(judged_bins[i]);
        TEST_ASSERT_TRUE(frf->valid[line]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, (double)judged_bins[i], frf->frequency_hz[line]);
        sum += cabs(frf->real[line] + frf->imag[line] * I - exact) / cabs(exact) / judged;
    }
    return 20.0 * log10(sum);
}

/// M = 10000, or a hundredth of it with 20 dB less to ask for.
static size_t period_count(void)
{
    return claim_long() ? 10000 : 100;
}

static double asked_db(double at_10000)
{
    return claim_long() ? at_10000 : at_10000 + 20.0;
}

static void test_ratio_of_means_is_consistent_with_a_multisine(void)
{
    struct run run;
    struct random random;
    struct periodic recording;
    struct frf frf;
    struct error error = {0};
    uint32_t bins[lines];
    for (uint32_t k = 0; k < lines; k++) {
        bins[k] = k + 1;
    }
    const struct periodic_options options = {.period_samples = length,
                                             .bins = bins,
                                             .bin_count = lines,
                                             .settle = periodic_settle_given,
                                             .settle_periods = 1};
    random_seed(&random, 213);
    make_run(period_count() + 1, &run);
    fill_with_multisine(&run, &random);
    close_loop(&run, &random);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &options, &recording, &error), error.message);
    TEST_ASSERT_EQUAL_STRING("velocity_ref_rad_per_s", recording.reference);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_mean_estimate(&recording, NULL, &frf, &error), error.message);
    claim_within("(2.13) mean, multisine in closed loop, error [dB]", "consistent", error_db(&frf, truth), -INFINITY,
                 asked_db(-28.0));
    frf_free(&frf);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_indirect_estimate(&recording, NULL, &frf, &error), error.message);
    claim_within("(2.15) indirect over periods, error [dB]", "consistent", error_db(&frf, truth), -INFINITY,
                 asked_db(-28.0));
    frf_free(&frf);
    periodic_free(&recording);
    free_run(&run);
}

static void test_only_the_indirect_method_is_consistent_with_random_signals(void)
{
    const struct estimate_options options = {.order = estimate_order_auto, .segment_samples = length};
    struct run run;
    struct random random;
    struct arbitrary recording;
    struct frf frf;
    struct error error = {0};
    random_seed(&random, 214);
    make_run(period_count(), &run);
    fill_with_noise(&run, &random);
    close_loop(&run, &random);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, arbitrary_cut(&run, &(struct arbitrary_options){0}, &recording, &error),
                                  error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_indirect_estimate_arbitrary(&recording, &options, &frf, &error),
                                  error.message);
    claim_within("(2.15) indirect, random reference, error [dB]", "consistent", error_db(&frf, truth), -INFINITY,
                 asked_db(-28.0));
    frf_free(&frf);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_h1_estimate_arbitrary(&recording, &options, &frf, &error), error.message);
    claim_within("(2.14) h1, random signals, error [dB]", "inconsistent", error_db(&frf, truth), 0.0, INFINITY);
    claim_within("(2.14) h1, distance to its printed limit [dB]", "0", error_db(&frf, printed_limit), -INFINITY,
                 asked_db(-27.0));
    frf_free(&frf);
    free_run(&run);
}

int main(void)
{
    UNITY_BEGIN();
    claim_title();
    RUN_TEST(test_ratio_of_means_is_consistent_with_a_multisine);
    RUN_TEST(test_only_the_indirect_method_is_consistent_with_random_signals);
    return UNITY_END();
}
