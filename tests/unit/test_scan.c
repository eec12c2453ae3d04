/* SPDX-License-Identifier: MIT */
/// Places that a scan finds on top of the given model, in a recording of the simulated drive that has the effect.
#include "lab/diagnose/scan.h"

#include "lab/diagnose/search.h"
#include "tests/support/recorded_drive.h"
#include "unity.h"

#include <math.h>
#include <string.h>

static struct sim_model truth, given;
static struct recorded_drive drive;
static struct hypothesis hypothesis;
static double centre;      ///< of the motion
static double swing;       ///< over what more than half a turn to either side takes
static double stranger_Nm; ///< of some lines that the torque has, and nothing moves by

void setUp(void)
{
    sim_model_default(&truth);
    truth.sensors = (struct sim_sensors){.velocity_noise_rad_per_s = 1e-2, .torque_noise_Nm = 3e-3};
    truth.motor_inertia_kgm2 = 0.004;
    truth.load_inertia_kgm2 = 0.001;
    truth.viscous_friction_Nms_per_rad = 0.004;
    given = truth;
    stranger_Nm = 0.0;
    centre = 0.0;
    swing = 1.0;
}

/// An elastic axis with a resonance among the lines, which moves little and far from th = 0.
static void make_elastic(void)
{
    truth.structure = sim_structure_two_mass;
    truth.motor_inertia_kgm2 = 0.003;
    truth.load_inertia_kgm2 = 0.002;
    truth.belt_stiffness_Nm_per_rad = 60.0;
    truth.belt_damping_Nms_per_rad = 0.04;
    truth.sensors = (struct sim_sensors){.velocity_noise_rad_per_s = 1e-3, .torque_noise_Nm = 1e-3};
    given = truth;
    centre = 4.0;
    swing = 0.02;
}

void tearDown(void)
{
    recorded_drive_free(&drive);
}

/// A swing of more than half a turn to either side with faster lines on it.
static double command_at(size_t n, double rate_hz, struct sim_command *out)
{
    static const double lines[][2] = {{1.0, 30.0}, {7.0, 3.0}, {19.0, 3.0}, {41.0, 3.0}};
    *out = (struct sim_command){.control = sim_control_cascade, .position = centre};
    for (size_t l = 0; l < sizeof lines / sizeof lines[0]; l++) {
        double w = recorded_two_pi * lines[l][0] * rate_hz / recorded_samples, angle = w * (double)n / rate_hz;
        double speed = lines[l][1] * (l == 0 ? swing : 1.0);
        out->position += speed / w * sin(angle);
        out->velocity += speed * cos(angle);
    }
    double turn = recorded_two_pi * (double)n / recorded_samples;
    return stranger_Nm * (cos(23.0 * turn) + sin(31.0 * turn) + cos(37.0 * turn));
}

/// Runs the true drive and fits the given model to what was recorded.
static void record_and_fit(void)
{
    TEST_ASSERT_TRUE(recorded_drive_init(&drive, &truth, centre, command_at, recorded_samples, 4));
    drive.recording.coverage = (struct sim_coverage){
        .position_span = 5.0 * swing, .position_mean = centre, .torque_rms = 1.0, .duration_s = 2.0};
    hypothesis_init(&hypothesis, &given, false, true);
    hypothesis.middle = centre;
    TEST_ASSERT_TRUE(fit_run(&drive.fit, &drive.data, &hypothesis, 10));
}

/// Of an encoder out of true at any phase the scan, which has one phase, finds size and phase at a look.
static void test_scan_finds_an_encoder_out_of_true_at_any_phase(void)
{
    const double amplitude = 0.01, near = 0.1;
    int effect = sim_effect_find("encoder_eccentricity");
    for (int eighth = 0; eighth < 8; eighth++) {
        struct scan scan;
        struct scan_candidate candidate;
        double values[sim_effect_parameters_max], unused[sim_effect_parameters_max],
            phase = recorded_two_pi * (double)eighth / 8.0;
        setUp();
        truth.effect_on[effect] = true;
        memcpy(truth.effect_parameters[effect], (double[]){amplitude, phase, 1.0}, 3 * sizeof(double));
        record_and_fit();
        TEST_ASSERT_TRUE(drive.fit.cost > 5.0 * (double)drive.data.values);
        TEST_ASSERT_TRUE(scan_init(&scan, &drive.data, &drive.recording.coverage, &hypothesis, &drive.fit));
        TEST_ASSERT_TRUE(scan_effect(&scan, effect, 0.25 * drive.fit.cost, &candidate));
        scan_free(&scan);
        hypothesis_parameters(&candidate.hypothesis, effect, NULL, values, unused);
        TEST_ASSERT_TRUE(candidate.cost < 0.5 * drive.fit.cost);
        TEST_ASSERT_DOUBLE_WITHIN(near * amplitude, amplitude, values[0]);
        TEST_ASSERT_DOUBLE_WITHIN(near, 0.0, remainder(values[1] - phase, recorded_two_pi));
        tearDown();
    }
}

/// A rigid drive that has nothing of the kind promises nothing.
static void test_scan_finds_no_encoder_out_of_true_where_there_is_none(void)
{
    struct scan scan;
    struct scan_candidate candidate;
    record_and_fit();
    TEST_ASSERT_TRUE(scan_init(&scan, &drive.data, &drive.recording.coverage, &hypothesis, &drive.fit));
    TEST_ASSERT_FALSE(scan_effect(&scan, sim_effect_find("encoder_eccentricity"), 20.0, &candidate));
    scan_free(&scan);
}

/// Gain in nats of the best effect of the catalogue.
static double best_gain(void)
{
    struct scan scan;
    double lowest = drive.fit.cost;
    TEST_ASSERT_TRUE(scan_init(&scan, &drive.data, &drive.recording.coverage, &hypothesis, &drive.fit));
    for (int e = 0; sim_effects[e]; e++) {
        struct scan_candidate candidate;
        if (hypothesis_may_name(&hypothesis, e) && scan_effect(&scan, e, 0.0, &candidate))
            lowest = fmin(lowest, candidate.cost);
    }
    scan_free(&scan);
    return 0.5 * (drive.fit.cost - lowest);
}

/// What nothing in the catalogue takes a tenth of away gets no name, and no time, however much its small parts gain.
static void test_search_names_nothing_where_the_best_is_a_small_part_of_far_too_much(void)
{
    const struct search_options options = {.causes_max = 6};
    stranger_Nm = 0.1;
    record_and_fit();
    double gain = best_gain(), left = drive.fit.cost;
    TEST_ASSERT_TRUE(gain > 100.0 && gain < 0.05 * left && left > 10.0 * (double)drive.data.values);
    TEST_ASSERT_TRUE(search_run(&drive.data, &drive.recording.coverage, &options, &hypothesis, &drive.fit));
    for (int e = 0; sim_effects[e]; e++)
        TEST_ASSERT_FALSE_MESSAGE(hypothesis.named[e], sim_effects[e]->id);
}

/// A belt that gets stiffer along the travel is, where the axis is, mainly another stiffness: a short travel far from
/// th = 0 shows it by what is left when that has been fitted, and slope and stiffness are found both.
static void test_scan_finds_a_stiffness_slope_on_a_short_travel_far_from_the_origin(void)
{
    const double slope = 0.006;
    int effect = sim_effect_find("position_dependent_stiffness");
    for (int sign = -1; sign <= 1; sign += 2) {
        struct scan scan;
        struct scan_candidate candidate;
        struct sim_model found;
        double values[sim_effect_parameters_max], deviations[sim_effect_parameters_max];
        setUp();
        make_elastic();
        truth.effect_on[effect] = true;
        truth.effect_parameters[effect][0] = sign * slope;
        record_and_fit();
        TEST_ASSERT_TRUE(drive.fit.cost > 2.0 * (double)drive.data.values);
        TEST_ASSERT_TRUE(scan_init(&scan, &drive.data, &drive.recording.coverage, &hypothesis, &drive.fit));
        TEST_ASSERT_TRUE(scan_effect(&scan, effect, 20.0, &candidate));
        scan_free(&scan);
        TEST_ASSERT_TRUE(fit_run(&drive.fit, &drive.data, &candidate.hypothesis, 10));
        TEST_ASSERT_TRUE(drive.fit.cost < 1.3 * (double)drive.data.values);
        hypothesis_parameters(&candidate.hypothesis, effect, drive.fit.covariance, values, deviations);
        hypothesis_model(&candidate.hypothesis, NULL, &found);
        TEST_ASSERT_TRUE(deviations[0] < 0.1 * slope);
        TEST_ASSERT_DOUBLE_WITHIN(4.0 * deviations[0], sign * slope, values[0]);
        TEST_ASSERT_DOUBLE_WITHIN(0.3, truth.belt_stiffness_Nm_per_rad * (1.0 + sign * slope * centre),
                                  found.belt_stiffness_Nm_per_rad * (1.0 + values[0] * centre));
        tearDown();
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_scan_finds_an_encoder_out_of_true_at_any_phase);
    RUN_TEST(test_scan_finds_no_encoder_out_of_true_where_there_is_none);
    RUN_TEST(test_search_names_nothing_where_the_best_is_a_small_part_of_far_too_much);
    RUN_TEST(test_scan_finds_a_stiffness_slope_on_a_short_travel_far_from_the_origin);
    return UNITY_END();
}
