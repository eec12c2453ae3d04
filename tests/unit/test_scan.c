/* SPDX-License-Identifier: MIT */
/// Places that a scan finds on top of the given model, in a recording of the simulated drive that has the effect.
#include "lab/diagnose/scan.h"

#include "lab/diagnose/search.h"
#include "sim/belt_drive.h"
#include "unity.h"

#include <math.h>
#include <string.h>

enum { samples = 512, periods = 4, lead = samples, rows = lead + samples * periods };

static const double two_pi = 6.283185307179586;

static struct sim_model truth, given;
static struct recording recording;
static size_t period_starts[periods];
static struct evidence evidence;
static struct fit_data data;
static struct fit fit;
static struct hypothesis hypothesis;
static double columns[4][rows], block[4][samples];
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
}

void tearDown(void)
{
    fit_free(&fit);
    evidence_free(&evidence);
}

/// A swing of more than half a turn to either side with faster lines on it.
static void command_at(size_t n, struct sim_command *out)
{
    static const double lines[][2] = {{1.0, 30.0}, {7.0, 3.0}, {19.0, 3.0}, {41.0, 3.0}};
    *out = (struct sim_command){.control = sim_control_cascade};
    for (size_t l = 0; l < sizeof lines / sizeof lines[0]; l++) {
        double w = two_pi * lines[l][0] * truth.sample_rate_hz / samples, angle = w * (double)n / truth.sample_rate_hz;
        out->position += lines[l][1] / w * sin(angle);
        out->velocity += lines[l][1] * cos(angle);
    }
}

static struct stretch stretch_of(double *const from[4], size_t length)
{
    return (struct stretch){.samples = length,
                            .torque_ref = from[0],
                            .torque = from[1],
                            .position = from[2],
                            .velocity = from[3],
                            .substeps = sim_substeps};
}

/// Runs the true drive and fits the given model to what was recorded.
static void record_and_fit(void)
{
    static struct sim_belt_drive drive;
    sim_belt_drive_init(&drive, &truth, 0.0);
    memset(block, 0, sizeof block);
    for (size_t n = 0; n < rows; n++) {
        struct sim_command command;
        struct sim_sample s;
        command_at(n, &command);
        sim_belt_drive_step(&drive, &command, &s);
        double turn = two_pi * (double)n / samples;
        double stranger = stranger_Nm * (cos(23.0 * turn) + sin(31.0 * turn) + cos(37.0 * turn));
        const double row[4] = {s.torque_ref + stranger, s.torque + stranger, s.position, s.velocity};
        for (size_t c = 0; c < 4; c++) {
            columns[c][n] = row[c];
            block[c][n % samples] += n < lead ? 0.0 : row[c] / periods;
        }
    }
    recording = (struct recording){.periodic = true,
                                   .rate_hz = truth.sample_rate_hz,
                                   .periods = periods,
                                   .lead = lead,
                                   .starts = period_starts,
                                   .band = 60};
    for (size_t p = 0; p < periods; p++)
        period_starts[p] = lead + p * samples;
    recording.block = stretch_of((double *const[]){block[0], block[1], block[2], block[3]}, samples);
    recording.all = stretch_of((double *const[]){columns[0], columns[1], columns[2], columns[3]}, rows);
    recording.coverage = (struct sim_coverage){.position_span = 5.0, .torque_rms = 1.0, .duration_s = 2.0};
    TEST_ASSERT_TRUE(evidence_init(&evidence, &recording, 0.005));
    TEST_ASSERT_TRUE(evidence_estimate_noise(&evidence, &truth));
    data = (struct fit_data){.runs = 1, .evidence = &evidence, .values = evidence.values};
    TEST_ASSERT_TRUE(fit_init(&fit, &data));
    hypothesis_init(&hypothesis, &given, false, true);
    TEST_ASSERT_TRUE(fit_run(&fit, &data, &hypothesis, 10));
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
            phase = two_pi * (double)eighth / 8.0;
        setUp();
        truth.effect_on[effect] = true;
        memcpy(truth.effect_parameters[effect], (double[]){amplitude, phase, 1.0}, 3 * sizeof(double));
        record_and_fit();
        TEST_ASSERT_TRUE(fit.cost > 5.0 * (double)data.values);
        TEST_ASSERT_TRUE(scan_init(&scan, &data, &recording.coverage, &hypothesis, &fit));
        TEST_ASSERT_TRUE(scan_effect(&scan, effect, 0.25 * fit.cost, &candidate));
        scan_free(&scan);
        hypothesis_parameters(&candidate.hypothesis, effect, NULL, values, unused);
        TEST_ASSERT_TRUE(candidate.cost < 0.5 * fit.cost);
        TEST_ASSERT_DOUBLE_WITHIN(near * amplitude, amplitude, values[0]);
        TEST_ASSERT_DOUBLE_WITHIN(near, 0.0, remainder(values[1] - phase, two_pi));
        tearDown();
    }
}

/// A rigid drive that has nothing of the kind promises nothing.
static void test_scan_finds_no_encoder_out_of_true_where_there_is_none(void)
{
    struct scan scan;
    struct scan_candidate candidate;
    record_and_fit();
    TEST_ASSERT_TRUE(scan_init(&scan, &data, &recording.coverage, &hypothesis, &fit));
    TEST_ASSERT_FALSE(scan_effect(&scan, sim_effect_find("encoder_eccentricity"), 20.0, &candidate));
    scan_free(&scan);
}

/// Gain in nats of the best effect of the catalogue.
static double best_gain(void)
{
    struct scan scan;
    double lowest = fit.cost;
    TEST_ASSERT_TRUE(scan_init(&scan, &data, &recording.coverage, &hypothesis, &fit));
    for (int e = 0; sim_effects[e]; e++) {
        struct scan_candidate candidate;
        if (hypothesis_may_name(&hypothesis, e) && scan_effect(&scan, e, 0.0, &candidate))
            lowest = fmin(lowest, candidate.cost);
    }
    scan_free(&scan);
    return 0.5 * (fit.cost - lowest);
}

/// What nothing in the catalogue takes a tenth of away gets no name, and no time, however much its small parts gain.
static void test_search_names_nothing_where_the_best_is_a_small_part_of_far_too_much(void)
{
    const struct search_options options = {.causes_max = 6};
    stranger_Nm = 0.1;
    record_and_fit();
    double gain = best_gain(), left = fit.cost;
    TEST_ASSERT_TRUE(gain > 100.0 && gain < 0.05 * left && left > 10.0 * (double)data.values);
    TEST_ASSERT_TRUE(search_run(&data, &recording.coverage, &options, &hypothesis, &fit));
    for (int e = 0; sim_effects[e]; e++)
        TEST_ASSERT_FALSE_MESSAGE(hypothesis.named[e], sim_effects[e]->id);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_scan_finds_an_encoder_out_of_true_at_any_phase);
    RUN_TEST(test_scan_finds_no_encoder_out_of_true_where_there_is_none);
    RUN_TEST(test_search_names_nothing_where_the_best_is_a_small_part_of_far_too_much);
    return UNITY_END();
}
