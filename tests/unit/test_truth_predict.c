/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/noise.h"
#include "sim/effect.h"
#include "sim/stepper.h"
#include "tests/truth/truth_run.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { samples = TRUTH_PERIOD_SAMPLES, periods = 3, rows = periods * samples, band = 300 };

static const double sample_rate_hz = TRUTH_RATE_HZ;

static struct truth_run run;
static struct recording recording;
static struct evidence evidence;
static size_t period_starts[1] = {rows - samples};
static double mechanics[samples], actuator[samples], spectrum[2][2 * (band + 1)];

void setUp(void) {}

void tearDown(void)
{
    evidence_free(&evidence);
    truth_run_free(&run);
}

/// Dead time is no multiple of a quarter sample, and the lag is about one: the torque changes within every step of the
/// prediction.
static struct truth_plant_spec rigid(void)
{
    return (struct truth_plant_spec){.motor_inertia_kgm2 = 0.0022,
                                     .load_inertia_kgm2 = 0.0022,
                                     .viscous_friction_Nms_per_rad = 0.003,
                                     .coulomb_friction_Nm = 0.05,
                                     .torque_lag_s = 3.3e-4,
                                     .dead_time_s = 4.5e-5,
                                     .sample_s = 1e-3,
                                     .step_s = 20e-6};
}

/// Antiresonance at 50 Hz, within the excitation: there the load moves twenty times as far as the motor.
static struct truth_plant_spec belt(void)
{
    struct truth_plant_spec spec = rigid();
    spec.two_mass = 1;
    spec.belt_stiffness_Nm_per_rad = 220.0;
    spec.belt_damping_Nms_per_rad = 0.057;
    return spec;
}

/// Crossed within less than a quarter sample by a motor that is fast.
static struct truth_plant_spec loose_belt(void)
{
    struct truth_plant_spec spec = belt();
    spec.gap_rad = 1.2e-4;
    spec.step_s = 10e-6;
    return spec;
}

static void play(const struct truth_plant_spec *spec)
{
    static struct truth_excitation excitation;
    struct truth_excitation_wish wish = {.inertia_kgm2 = spec->motor_inertia_kgm2 + spec->load_inertia_kgm2,
                                         .torque_rms_Nm = 0.5,
                                         .speed_max_rad_per_s = 2.0,
                                         .corner_hz = 5.0};
    struct truth_controller controller = {.inertia_kgm2 = wish.inertia_kgm2};
    struct truth_sensors perfect = {0};
    struct truth_random random;
    truth_random_init(&random, 1u, 1u);
    truth_excitation_make(&excitation, &wish, &random);
    truth_controller_tune(&controller, spec, 40.0);
    TEST_ASSERT_EQUAL_INT(0, truth_run_make(&run, spec, &controller, &perfect, &excitation, periods, 1u));
}

static struct sim_model model_of(const struct truth_plant_spec *spec)
{
    struct sim_model model;
    sim_model_default(&model);
    model.structure = spec->two_mass ? sim_structure_two_mass : sim_structure_rigid;
    model.sample_rate_hz = sample_rate_hz;
    model.motor_inertia_kgm2 = spec->motor_inertia_kgm2;
    model.load_inertia_kgm2 = spec->load_inertia_kgm2;
    model.belt_stiffness_Nm_per_rad = spec->belt_stiffness_Nm_per_rad;
    model.belt_damping_Nms_per_rad = spec->belt_damping_Nms_per_rad;
    model.viscous_friction_Nms_per_rad = spec->viscous_friction_Nms_per_rad;
    model.coulomb_friction_Nm = spec->coulomb_friction_Nm;
    model.torque_lag_s = spec->torque_lag_s;
    model.dead_time_s = spec->dead_time_s;
    if (spec->gap_rad > 0.0) {
        int gap = sim_effect_find("backlash");
        model.effect_on[gap] = true;
        model.effect_parameters[gap][0] = spec->gap_rad;
    }
    return model;
}

static struct stretch stretch_from(size_t first, size_t count)
{
    return (struct stretch){.samples = count,
                            .torque_ref = run.torque_ref_Nm + first,
                            .torque = run.torque_Nm + first,
                            .position = run.position_rad + first,
                            .velocity = run.velocity_rad_per_s + first,
                            .substeps = sim_substeps};
}

static double rms(const double *bins)
{
    double sum = 0.0;
    for (size_t k = 1; k <= band; k++)
        sum += bins[2 * k] * bins[2 * k] + bins[2 * k + 1] * bins[2 * k + 1];
    return sqrt(sum);
}

/// What the model with the true numbers leaves of a run without noise, in the band, over the torque there.
static double left_by_truth(const struct truth_plant_spec *spec)
{
    play(spec);
    struct sim_model model = model_of(spec);
    recording = (struct recording){.periodic = true,
                                   .rate_hz = sample_rate_hz,
                                   .periods = 1,
                                   .lead = rows - samples,
                                   .starts = period_starts,
                                   .band = band,
                                   .block = stretch_from(rows - samples, samples),
                                   .all = stretch_from(0, rows)};
    TEST_ASSERT_TRUE(evidence_init(&evidence, &recording, spec->motor_inertia_kgm2 + spec->load_inertia_kgm2));
    TEST_ASSERT_TRUE(evidence_signals(&evidence, &model, mechanics, actuator));
    evidence_transform(&evidence, mechanics, spectrum[0]);
    evidence_transform(&evidence, recording.block.torque, spectrum[1]);
    return rms(spectrum[0]) / rms(spectrum[1]);
}

static void assert_left(const struct truth_plant_spec *spec, double most)
{
    char message[80];
    double left = left_by_truth(spec);
    snprintf(message, sizeof message, "left of the torque: %.3g, at most %.3g", left, most);

    TEST_ASSERT_TRUE_MESSAGE(left < most, message);
}

// Recordings are good to a few parts in ten thousand of the torque. Predictions have to be as good, or a search finds
// causes for their errors. Found: 2.8e-6, 1.6e-4 and 5.9e-4; with only the mean of the torque over each quarter sample,
// and gaps looked at only at its ends, 3.7e-5, 1.1e-3 and 8.6e-3.
static const double rigid_most = 1e-5, belt_most = 3e-4, gap_most = 1.2e-3;

static void test_truth_predict_leaves_nothing_of_a_rigid_body(void)
{
    struct truth_plant_spec spec = rigid();
    assert_left(&spec, rigid_most);
}

static void test_truth_predict_leaves_nothing_of_a_belt_at_its_antiresonance(void)
{
    struct truth_plant_spec spec = belt();
    assert_left(&spec, belt_most);
}

static void test_truth_predict_leaves_nothing_of_a_gap_that_is_crossed_within_a_step(void)
{
    struct truth_plant_spec spec = loose_belt();
    assert_left(&spec, gap_most);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_truth_predict_leaves_nothing_of_a_rigid_body);
    RUN_TEST(test_truth_predict_leaves_nothing_of_a_belt_at_its_antiresonance);
    RUN_TEST(test_truth_predict_leaves_nothing_of_a_gap_that_is_crossed_within_a_step);
    return UNITY_END();
}
