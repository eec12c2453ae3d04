/* SPDX-License-Identifier: MIT */
/// The difference of speed and position columns as evidence: white where it is noise, an error of the sensors where it
/// is not, and blind to a small gain or delay of the speed column.
#include "lab/diagnose/kinematics.h"

#include "lab/diagnose/noise.h"
#include "lab/numeric/statistics.h"
#include "unity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { samples = 2000, periods = 6, rows = samples * (periods + 1), band = 300 };

static const double two_pi = 6.283185307179586;
static const double rate_hz = 1000.0;

static struct sim_model model;
static struct recording recording;
static struct evidence evidence;
static struct random generator;
static double torque[rows], position[rows], velocity[rows], kinematics[rows], block[4][samples];
static size_t starts[periods];

void setUp(void)
{
    sim_model_default(&model);
    model.structure = sim_structure_rigid;
    model.sample_rate_hz = rate_hz;
    memset(&recording, 0, sizeof recording);
    // A stroke of more than a turn with a faster line on it; both repeat.
    for (size_t n = 0; n < rows; n++) {
        double t = (double)n / rate_hz;
        position[n] = 3.6 * sin(two_pi * 0.5 * t) + 0.02 * sin(two_pi * 7.5 * t);
        velocity[n] = 3.6 * two_pi * 0.5 * cos(two_pi * 0.5 * t) + 0.02 * two_pi * 7.5 * cos(two_pi * 7.5 * t);
        torque[n] = 0.1 * cos(two_pi * 7.5 * t);
    }
}

void tearDown(void)
{
    evidence_free(&evidence);
}

static void mean_of_periods(const double *column, double *out)
{
    memset(out, 0, samples * sizeof *out);
    for (size_t p = 0; p < periods; p++)
        for (size_t i = 0; i < samples; i++)
            out[i] += column[starts[p] + i] / periods;
}

/// A recording whose columns differ by noise, and by `difference`.
static void record(double (*difference)(size_t n), double noise, uint64_t seed)
{
    random_seed(&generator, seed);
    for (size_t n = 0; n < rows; n++)
        kinematics[n] = noise * random_normal(&generator) + (difference ? difference(n) : 0.0);
    for (size_t p = 0; p < periods; p++)
        starts[p] = (p + 1) * samples;
    const double *columns[] = {torque, position, velocity, kinematics};
    for (size_t i = 0; i < 4; i++)
        mean_of_periods(columns[i], block[i]);
    recording = (struct recording){.periodic = true,
                                   .rate_hz = rate_hz,
                                   .periods = periods,
                                   .lead = samples,
                                   .starts = starts,
                                   .band = band,
                                   .coverage = {.velocity_rms = 8.0, .torque_rms = 0.07, .position_span = 7.2}};
    recording.block = (struct stretch){.samples = samples,
                                       .substeps = 1,
                                       .torque = block[0],
                                       .position = block[1],
                                       .velocity = block[2],
                                       .kinematics = block[3]};
    recording.all = (struct stretch){.samples = rows,
                                     .substeps = 1,
                                     .torque = torque,
                                     .position = position,
                                     .velocity = velocity,
                                     .kinematics = kinematics};
    TEST_ASSERT_TRUE(evidence_init(&evidence, &recording, 0.004));
    TEST_ASSERT_TRUE(evidence_estimate_noise(&evidence, &model));
}

static double mean_square(const struct sim_model *of)
{
    double sum = 0.0, *residual = malloc(evidence.kinematics.values * sizeof *residual);
    TEST_ASSERT_NOT_NULL(residual);
    TEST_ASSERT_TRUE(kinematics_residual(&evidence, of, residual));
    for (size_t i = 0; i < evidence.kinematics.values; i++)
        sum += residual[i] * residual[i] / (double)evidence.kinematics.values;
    free(residual);
    return sum;
}

static void test_kinematics_of_noise_have_unit_variance(void)
{
    enum { seeds = 20 };
    double sum = 0.0;
    for (uint64_t seed = 1; seed <= seeds; seed++) {
        record(NULL, 1e-2, seed); // so that what is added for digits does not count
        sum += mean_square(&model) / seeds;
        evidence_free(&evidence);
    }
    // 20 x 80 squares (standard deviation 0.035), divided by a scatter of 5 degrees of freedom and 7..21 bins, which
    // makes them larger by 2 % at most; four nuisances take 5 % away.
    TEST_ASSERT_DOUBLE_WITHIN(0.15, 0.97, sum);
}

static const double amplitude = 2e-4, phase = 0.7;

static double out_of_true(size_t n)
{
    return amplitude * sin(position[n] + phase) * velocity[n];
}

static void test_kinematics_see_a_sensor_that_is_wrong_by_position(void)
{
    int effect = sim_effect_find("encoder_eccentricity");
    record(out_of_true, 1e-3, 3);
    double without = mean_square(&model);
    struct sim_model with = model;
    with.effect_on[effect] = true;
    with.effect_parameters[effect][0] = amplitude;
    with.effect_parameters[effect][1] = phase;
    with.effect_parameters[effect][2] = 0.0; // the speed column has a sensor of its own
    TEST_ASSERT_TRUE(without > 10.0);
    TEST_ASSERT_TRUE(mean_square(&with) < 1.5);
    with.effect_parameters[effect][2] = 1.0; // and is not derived from the position
    TEST_ASSERT_DOUBLE_WITHIN(1e-2 * without, without, mean_square(&with));
}

static double small_gain_and_delay(size_t n)
{
    double slope = 0.5 * rate_hz * (velocity[n + 1 < rows ? n + 1 : n] - velocity[n > 0 ? n - 1 : 0]);
    return 0.01 * velocity[n] - 1e-4 * slope;
}

static void test_kinematics_are_blind_to_gain_and_delay_of_the_speed_column(void)
{
    record(small_gain_and_delay, 1e-3, 4);
    TEST_ASSERT_TRUE(mean_square(&model) < 1.5);
}

static void test_kinematics_of_one_column_are_empty(void)
{
    record(NULL, 1e-3, 5);
    evidence_free(&evidence);
    recording.block.kinematics = recording.all.kinematics = NULL;
    TEST_ASSERT_TRUE(evidence_init(&evidence, &recording, 0.004));
    TEST_ASSERT_EQUAL_UINT(0, evidence.kinematics.values);
    struct sim_model with = model;
    with.effect_on[sim_effect_find("encoder_eccentricity")] = true;
    TEST_ASSERT_TRUE(evidence_estimate_noise(&evidence, &with));
    TEST_ASSERT_TRUE(kinematics_residual(&evidence, &with, NULL));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_kinematics_of_noise_have_unit_variance);
    RUN_TEST(test_kinematics_see_a_sensor_that_is_wrong_by_position);
    RUN_TEST(test_kinematics_are_blind_to_gain_and_delay_of_the_speed_column);
    RUN_TEST(test_kinematics_of_one_column_are_empty);
    return UNITY_END();
}
