/* SPDX-License-Identifier: MIT */
/// Whitened residuals of runs whose noise is known: independent, of unit variance, whatever the noise of the two
/// channels and however they go together.
#include "lab/diagnose/noise.h"

#include "lab/diagnose/validate.h"
#include "lab/numeric/statistics.h"
#include "sim/plant.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { samples = 1024, lead = samples, most_periods = 48, rows = lead + samples * most_periods, band = 300 };

static const double two_pi = 6.283185307179586;
/// Of the chi-square and normal bounds, both sides together: one run in a thousand leaves them by chance.
static const double chance = 1e-3;
static const double normal_bound = 3.29;

static struct sim_model model;
static struct recording recording;
static struct evidence evidence;
static struct random generator;
static double torque_ref[rows], torque[rows], position[rows], velocity[rows];
static double block[4][samples];
static size_t starts[most_periods];
static double *whitened;
static char message[120];

void setUp(void)
{
    sim_model_default(&model);
    memset(&recording, 0, sizeof recording);
}

void tearDown(void)
{
    evidence_free(&evidence);
    free(whitened);
    whitened = NULL;
}

/// Noise of a run, in Nm per sample.
struct noise {
    double mechanics;
    double actuator;
    double common; ///< of a torque that the motor feels one sample before it is measured: both channels, out of phase
};

/// White noise without a mean over one period, so that the motion it makes repeats.
static void draw(double deviation, double *out)
{
    double mean = 0.0;
    for (size_t i = 0; i < samples; i++) {
        out[i] = deviation * random_normal(&generator);
        mean += out[i] / samples;
    }
    for (size_t i = 0; i < samples; i++)
        out[i] -= mean;
}

/// A frictionless rigid drive that integrates its torque and the noise sample by sample: the residuals are the noise
/// itself.
static void record(const struct noise *noise, uint64_t seed, size_t periods)
{
    random_seed(&generator, seed);
    snprintf(message, sizeof message, "seed %u", (unsigned)seed);
    double per_sample = 1.0 / (model.motor_inertia_kgm2 * model.sample_rate_hz), speed = 0.0;
    for (size_t p = 0; p <= periods; p++) {
        static double mechanics[samples], actuator[samples], common[samples];
        draw(noise->mechanics, mechanics);
        draw(noise->actuator, actuator);
        draw(noise->common, common);
        for (size_t i = 0; i < samples; i++) {
            size_t n = p * samples + i;
            torque_ref[n] =
                0.3 * sin(two_pi * 5.0 * (double)i / samples) + 0.2 * cos(two_pi * 40.0 * (double)i / samples);
            velocity[n] = speed;
            position[n] = 0.01 * (double)i / samples; // no part of a frictionless drive's residual
            speed += per_sample * (torque_ref[n] + mechanics[i] + common[i]);
            torque[n] = torque_ref[n] + actuator[i] + common[(i + samples - 1) % samples];
        }
    }
}

static void average(const double *column, size_t periods, double *out)
{
    memset(out, 0, samples * sizeof *out);
    for (size_t p = 0; p < periods; p++)
        for (size_t i = 0; i < samples; i++)
            out[i] += column[lead + p * samples + i] / (double)periods;
}

static void prepare(size_t periods, bool with_reference)
{
    average(torque_ref, periods, block[0]);
    average(torque, periods, block[1]);
    average(position, periods, block[2]);
    average(velocity, periods, block[3]);
    recording.periodic = true;
    recording.rate_hz = model.sample_rate_hz;
    recording.periods = periods;
    recording.lead = lead;
    recording.starts = starts;
    for (size_t p = 0; p < (size_t)periods; p++)
        starts[p] = lead + p * samples;
    recording.band = band;
    recording.block = (struct stretch){.samples = samples,
                                       .torque_ref = with_reference ? block[0] : NULL,
                                       .torque = block[1],
                                       .position = block[2],
                                       .velocity = block[3],
                                       .substeps = sim_substeps};
    recording.all = (struct stretch){.samples = lead + samples * periods,
                                     .torque_ref = with_reference ? torque_ref : NULL,
                                     .torque = torque,
                                     .position = position,
                                     .velocity = velocity,
                                     .substeps = sim_substeps};
    TEST_ASSERT_TRUE(evidence_init(&evidence, &recording, model.motor_inertia_kgm2));
    TEST_ASSERT_EQUAL_UINT(with_reference ? 2 : 1, evidence.channels);
    TEST_ASSERT_TRUE(evidence_estimate_noise(&evidence, &model));
    whitened = malloc(evidence.values * sizeof *whitened);
    TEST_ASSERT_NOT_NULL(whitened);
    evidence_residual(&evidence, &model, whitened, NULL);
}

/// Sum of squares of one channel's values over all bins but the constant part, against chi-square; the noise was
/// estimated from the scatter of so many periods, which widens the bounds by as much again.
static void assert_unit_variance(size_t channel, size_t periods)
{
    double sum = 0.0;
    size_t count = 0;
    for (size_t i = 1; i < evidence.values; i++) {
        size_t of;
        evidence_bin(&evidence, i, &of);
        if (of != channel)
            continue;
        sum += whitened[i] * whitened[i];
        count++;
    }
    TEST_ASSERT_EQUAL_UINT(2 * band, count);
    double dof = (double)count, widened = sqrt(1.0 + 1.0 / (double)(periods - 1));
    double low = dof + widened * (statistics_chi2_quantile(0.5 * chance, dof) - dof);
    double high = dof + widened * (statistics_chi2_quantile(1.0 - 0.5 * chance, dof) - dof);
    TEST_ASSERT_TRUE_MESSAGE(sum > low && sum < high, message);
}

/// Mean product of value i and value i + distance, over those i that start a channel, against its standard normal
/// bound.
static void assert_uncorrelated(size_t channel, size_t distance)
{
    double sum = 0.0;
    size_t count = 0;
    for (size_t i = 1; i + distance < evidence.values; i++) {
        size_t of;
        evidence_bin(&evidence, i, &of);
        if (of != channel)
            continue;
        sum += whitened[i] * whitened[i + distance];
        count++;
    }
    snprintf(message + strcspn(message, ","), 60, ", channel %zu, distance %zu: %.2f sigma", channel, distance,
             sum / sqrt((double)count));
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1.05 * normal_bound, 0.0, sum / sqrt((double)count), message);
}

static void assert_white(const struct noise *noise, uint64_t seed, size_t periods)
{
    record(noise, seed, periods);
    prepare(periods, true);
    for (size_t channel = 0; channel < 2; channel++) {
        assert_unit_variance(channel, periods);
        for (size_t distance = 1; distance <= 8; distance++)
            assert_uncorrelated(channel, distance);
    }
    tearDown();
}

static void test_noise_whitens_independent_channels(void)
{
    assert_white(&(struct noise){.mechanics = 0.02, .actuator = 0.003}, 1, most_periods);
    assert_white(&(struct noise){.mechanics = 1e-4, .actuator = 0.1}, 2, most_periods);
}

static void test_noise_whitens_channels_that_go_together(void)
{
    assert_white(&(struct noise){.mechanics = 0.01, .actuator = 0.01, .common = 0.02}, 3, most_periods);
    assert_white(&(struct noise){.mechanics = 0.002, .actuator = 0.01, .common = 0.02}, 4, most_periods);
}

static void test_noise_covariance_is_that_of_the_periods_mean(void)
{
    const struct noise noise = {.mechanics = 0.01, .actuator = 0.005, .common = 0.02};
    record(&noise, 5, most_periods);
    prepare(most_periods, true);
    // DFT / N of the mean of P periods of white noise s: s^2 / (N P) each bin. The common part turns by one sample
    // between them.
    double per_bin = 1.0 / ((double)samples * most_periods), m = 0.01 * 0.01, a = 0.005 * 0.005, c = 0.02 * 0.02;
    // Each is a mean over 21 bins of P - 1 periods: 3.2 % a standard deviation; five of them.
    const double share = 0.16;
    for (size_t k = 20; k < band; k += 10) {
        const double *estimate = evidence.covariance + 4 * k;
        double angle = two_pi * (double)k / samples;
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(share * (m + c) * per_bin, (m + c) * per_bin, estimate[0], message);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(share * (a + c) * per_bin, (a + c) * per_bin, estimate[1], message);
        double size = share * sqrt((m + c) * (a + c)) * per_bin;
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(size, c * cos(angle) * per_bin, estimate[2], message);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(size, -c * sin(angle) * per_bin, estimate[3], message);
    }
}

static void test_noise_correlation_between_channels_is_seen_by_the_gain_of_a_likelihood(void)
{
    // Noise of 0.02 Nm in both channels together hides a torque that only the mechanics feel, unless what the other
    // channel says about it is taken out: then 0.001 Nm of own noise is left, and the torque stands out in the second
    // value of its bin.
    const struct noise noise = {.mechanics = 0.001, .actuator = 0.001, .common = 0.02};
    record(&noise, 6, most_periods);
    prepare(most_periods, true);
    double *small = calloc(2 * samples, sizeof *small), sum[2] = {0.0, 0.0};
    TEST_ASSERT_NOT_NULL(small);
    for (size_t i = 0; i < samples; i++)
        small[i] = 0.001 * sin(two_pi * 100.0 * (double)i / samples);
    double *response = malloc(evidence.values * sizeof *response);
    TEST_ASSERT_NOT_NULL(response);
    evidence_whiten(&evidence, small, small + samples, response);
    for (size_t i = 0; i < evidence.values; i++) {
        size_t channel;
        evidence_bin(&evidence, i, &channel);
        sum[channel] += response[i] * response[i];
    }
    free(response);
    free(small);
    TEST_ASSERT_TRUE(sum[1] > 30.0 * sum[0]);
}

static void test_noise_single_channel_without_reference(void)
{
    record(&(struct noise){.mechanics = 0.02}, 7, most_periods);
    prepare(most_periods, true);
    double with_reference = evidence.covariance[4 * 50];
    tearDown();
    // Measured torque in the place of the reference: the same torque here, held between samples there, straight lines
    // here.
    prepare(most_periods, false);
    TEST_ASSERT_EQUAL_UINT(2 * band + 1, evidence.values);
    TEST_ASSERT_DOUBLE_WITHIN(0.05 * with_reference, with_reference, evidence.covariance[4 * 50]);
}

static void test_noise_numbers_values_by_bin_and_channel(void)
{
    record(&(struct noise){.mechanics = 0.02, .actuator = 0.01}, 8, 3);
    prepare(3, true);
    TEST_ASSERT_EQUAL_UINT(4 * band + 1, evidence.values);
    // A line in one channel at one bin shows in the values that belong there, and in the correlated ones of that bin.
    evidence.allowance_count = 0; // these spread over all bins
    static double line[samples], nothing[samples];
    for (size_t i = 0; i < samples; i++)
        line[i] = cos(two_pi * 77.0 * (double)i / samples + 0.4);
    for (size_t which = 0; which < 2; which++) {
        evidence_whiten(&evidence, which == 0 ? line : nothing, which == 1 ? line : nothing, whitened);
        double largest = 0.0;
        for (size_t i = 0; i < evidence.values; i++)
            largest = fmax(largest, fabs(whitened[i]));
        for (size_t i = 0; i < evidence.values; i++) {
            size_t channel, bin = evidence_bin(&evidence, i, &channel);
            if (bin != 77 || channel < which)
                TEST_ASSERT_DOUBLE_WITHIN(1e-10 * largest, 0.0, whitened[i]);
            else if (channel == which)
                TEST_ASSERT_TRUE(fabs(whitened[i]) > 0.1 * largest);
        }
    }
}

static void test_noise_transform_is_the_dft_over_the_length(void)
{
    record(&(struct noise){.mechanics = 0.02, .actuator = 0.01}, 9, 3);
    prepare(3, true);
    static double line[samples], spectrum[2 * (band + 1)];
    for (size_t i = 0; i < samples; i++)
        line[i] = 2.5 + 0.8 * cos(two_pi * 33.0 * (double)i / samples + 0.4);
    evidence_transform(&evidence, line, spectrum);
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, 2.5, spectrum[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, 0.4 * cos(0.4), spectrum[66]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, 0.4 * sin(0.4), spectrum[67]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, 0.0, spectrum[64]);
}

/// Figures of the model that made the data, over many runs of few periods: what the estimate of the noise itself adds.
struct perfect {
    double mean_square, whole_square; ///< means over the runs
    unsigned beyond;                  ///< runs whose mean_rms is larger than what chance allows once in twenty
};

static struct perfect measure_perfect(unsigned runs, size_t periods)
{
    const struct noise noise = {.mechanics = 0.01, .actuator = 0.005, .common = 0.01};
    struct perfect p = {0};
    for (unsigned i = 0; i < runs; i++) {
        record(&noise, 100 + i, periods);
        prepare(periods, true);
        struct fit_data data = {.runs = 1, .evidence = &evidence, .values = evidence.values};
        struct diagnosis_figures figures = validate_figures(&data, &model);
        p.mean_square += figures.mean_rms * figures.mean_rms / runs;
        p.whole_square += figures.whitened_rms * figures.whitened_rms / runs;
        p.beyond += figures.mean_rms > validate_mean_rms_chance(&data);
        tearDown();
    }
    return p;
}

static void test_noise_of_few_periods_leaves_a_perfect_model_at_one(void)
{
    // Two channels, 21 bins, 3 scatters each: without its bias taken back the estimate would give 63 / 61, 1.033.
    enum { runs = 100, periods = 4 };
    double values = 4.0 * band + 1.0, deviation = sqrt(2.0 / values * periods / (periods - 1.0) / runs);
    struct perfect p = measure_perfect(runs, periods);
    TEST_ASSERT_DOUBLE_WITHIN(normal_bound * deviation, 1.0, p.mean_square);
    // What differs between the periods is whitened by itself: only the mean's share scatters.
    TEST_ASSERT_DOUBLE_WITHIN(normal_bound * deviation / periods + 0.002, 1.0, p.whole_square);
    // Five expected; fifteen or more come about once in ten thousand.
    TEST_ASSERT_LESS_THAN_UINT(15, p.beyond);
}

static void test_noise_of_a_run_without_periods_comes_from_its_own_residual(void)
{
    record(&(struct noise){.mechanics = 0.01, .actuator = 0.004, .common = 0.01}, 10, 3);
    recording = (struct recording){.rate_hz = model.sample_rate_hz, .periods = 1, .band = 1200};
    recording.block = (struct stretch){.samples = 4 * samples,
                                       .torque_ref = torque_ref,
                                       .torque = torque,
                                       .position = position,
                                       .velocity = velocity,
                                       .substeps = sim_substeps};
    recording.all = recording.block;
    TEST_ASSERT_TRUE(evidence_init(&evidence, &recording, model.motor_inertia_kgm2));
    TEST_ASSERT_TRUE(evidence_estimate_noise(&evidence, &model));
    whitened = malloc(evidence.values * sizeof *whitened);
    TEST_ASSERT_NOT_NULL(whitened);
    evidence_residual(&evidence, &model, whitened, NULL);
    double sums[2] = {0.0, 0.0};
    for (size_t i = 1; i < evidence.values; i++) {
        size_t channel;
        evidence_bin(&evidence, i, &channel);
        sums[channel] += whitened[i] * whitened[i] / (2.0 * 1200.0);
    }
    // Estimated from what it whitens: one but for the smoothing over neighbours.
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.05, 1.0, sums[0], message);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.05, 1.0, sums[1], message);
    for (size_t distance = 1; distance <= 3; distance++)
        assert_uncorrelated(0, distance);
}

/// Sum of the whitened squares of a torque column that is late by so much of a sample.
static double squares_of_skew(double late)
{
    static double nothing[samples], actuator[samples];
    for (size_t i = 0; i < samples; i++) {
        double slow = two_pi * 5.0 / samples, fast = two_pi * 40.0 / samples;
        actuator[i] = late * (0.3 * slow * cos(slow * (double)i) - 0.2 * fast * sin(fast * (double)i));
    }
    evidence_whiten(&evidence, nothing, actuator, whitened);
    double sum = 0.0;
    for (size_t i = 0; i < evidence.values; i++)
        sum += whitened[i] * whitened[i];
    return sum;
}

static void test_noise_allows_for_a_thousandth_of_a_sample_between_columns_and_no_more(void)
{
    const double deviation = 0.001; // of the skew that is allowed for
    record(&(struct noise){.mechanics = 2e-5, .actuator = 2e-5}, 11u, 12);
    prepare(12, true);
    // The columns' noise is so small that all that is left of a skew is its size over that deviation.
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 1.0, squares_of_skew(deviation));
    TEST_ASSERT_DOUBLE_WITHIN(5.0, 100.0, squares_of_skew(10.0 * deviation));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_noise_whitens_independent_channels);
    RUN_TEST(test_noise_whitens_channels_that_go_together);
    RUN_TEST(test_noise_covariance_is_that_of_the_periods_mean);
    RUN_TEST(test_noise_correlation_between_channels_is_seen_by_the_gain_of_a_likelihood);
    RUN_TEST(test_noise_single_channel_without_reference);
    RUN_TEST(test_noise_numbers_values_by_bin_and_channel);
    RUN_TEST(test_noise_transform_is_the_dft_over_the_length);
    RUN_TEST(test_noise_of_few_periods_leaves_a_perfect_model_at_one);
    RUN_TEST(test_noise_of_a_run_without_periods_comes_from_its_own_residual);
    RUN_TEST(test_noise_allows_for_a_thousandth_of_a_sample_between_columns_and_no_more);
    return UNITY_END();
}
