/* SPDX-License-Identifier: MIT */
/// A torque that a model lacks only in one band, place, direction, stretch of time or at one level is seen there, and
/// noise is seen nowhere.
#include "lab/diagnose/misfit.h"

#include "lab/diagnose/fit.h"
#include "lab/numeric/statistics.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { samples = 1024, periods = 8, lead = samples, rows = lead + samples * periods, band = 300 };

static const double two_pi = 6.283185307179586;
/// Nearly all of a torque that is white where it acts: what is brought back to time from the band alone rings a little.
static const double nearly_all = 0.8;

static struct sim_model model;
static struct recording recording;
static struct evidence evidence;
static struct fit_data data;
static struct random generator;
static double torque[rows], position[rows], velocity[rows], block[3][samples];
static size_t starts[periods];
static struct misfit misfit;
static double lacking[samples];

/// Where the torque acts: sample of the period, period.
typedef double (*torque_at)(size_t i, size_t p);

void setUp(void)
{
    sim_model_default(&model);
    model.structure = sim_structure_rigid;
    model.viscous_friction_Nms_per_rad = model.coulomb_friction_Nm = 0.0;
    model.torque_lag_s = model.dead_time_s = 0.0;
    memset(&recording, 0, sizeof recording);
    random_seed(&generator, 20);
    double mean = 0.0;
    for (size_t i = 0; i < samples; i++)
        mean += (lacking[i] = random_normal(&generator)) / samples;
    for (size_t i = 0; i < samples; i++)
        lacking[i] -= mean;
}

void tearDown(void)
{
    evidence_free(&evidence);
}

static double drive_torque(size_t i)
{
    double angle = two_pi * (double)i / samples;
    return 0.4 * cos(2.0 * angle) + 0.02 * cos(31.0 * angle);
}

/// What that makes of the speed, to a scale.
static double pace(size_t i)
{
    return sin(2.0 * two_pi * (double)i / samples);
}

/// There and back once a period, whatever the motor does: a frictionless drive's residual does not hold it.
static double place(size_t i)
{
    return cos(two_pi * (double)i / samples);
}

/// Integrates drive, lacking torque and noise sample by sample; what is added has no mean, so that the motion repeats.
static void record(torque_at at)
{
    double per_sample = 1.0 / ((model.motor_inertia_kgm2 + model.load_inertia_kgm2) * model.sample_rate_hz);
    double speed = 0.0;
    for (size_t p = 0; p <= periods; p++) {
        static double added[samples];
        double mean = 0.0;
        for (size_t i = 0; i < samples; i++)
            mean += (added[i] = 0.002 * random_normal(&generator) + (at ? at(i, p) : 0.0)) / samples;
        for (size_t i = 0; i < samples; i++) {
            size_t n = p * samples + i;
            torque[n] = drive_torque(i);
            position[n] = place(i);
            velocity[n] = speed;
            speed += per_sample * (torque[n] + added[i] - mean);
        }
    }
    double *const blocks[] = {block[0], block[1], block[2]};
    const double *const columns[] = {torque, position, velocity};
    for (size_t c = 0; c < 3; c++)
        for (size_t i = 0; i < samples; i++) {
            blocks[c][i] = 0.0;
            for (size_t p = 0; p < periods; p++)
                blocks[c][i] += columns[c][lead + p * samples + i] / periods;
        }
}

static void find(torque_at at)
{
    record(at);
    recording.periodic = true;
    recording.rate_hz = model.sample_rate_hz;
    recording.periods = periods;
    recording.lead = lead;
    recording.starts = starts;
    for (size_t p = 0; p < periods; p++)
        starts[p] = lead + p * samples;
    recording.band = band;
    recording.block = (struct stretch){.samples = samples,
                                       .substeps = 1,
                                       .torque = block[0],
                                       .position = block[1],
                                       .velocity = block[2],
                                       .held = true};
    recording.all = (struct stretch){
        .samples = rows, .substeps = 1, .torque = torque, .position = position, .velocity = velocity, .held = true};
    TEST_ASSERT_TRUE(evidence_init(&evidence, &recording, model.motor_inertia_kgm2 + model.load_inertia_kgm2));
    TEST_ASSERT_TRUE(evidence_estimate_noise(&evidence, &model));
    data = (struct fit_data){.runs = 1, .evidence = &evidence, .values = evidence.values};
    struct sim_model heavy = model;
    heavy.motor_inertia_kgm2 *= 1.5; // wrong wherever the drive's torque is
    TEST_ASSERT_TRUE(misfit_find(&data, &heavy, &model, &misfit));
}

static const struct misfit_range *range_of(enum misfit_axis_kind kind)
{
    const struct misfit_range *range = &misfit.axes[kind].range[misfit_extended];
    TEST_ASSERT_TRUE(range->found);
    TEST_ASSERT_TRUE(range->share > nearly_all);
    TEST_ASSERT_TRUE(misfit_is_left(&misfit, misfit_extended));
    return range;
}

static double above_half(size_t i, size_t p)
{
    (void)p;
    return place(i) > 0.5 ? 0.05 * lacking[i] : 0.0;
}

static double late(size_t i, size_t p)
{
    return p > 4 ? 0.05 * lacking[i] : 0.0;
}

static double in_band(size_t i, size_t p)
{
    (void)p;
    double sum = 0.0;
    for (int k = 100; k < 110; k++)
        sum += 0.005 * cos(two_pi * k * (double)i / samples + k * k);
    return sum;
}

static double backward(size_t i, size_t p)
{
    (void)p;
    return pace(i) < 0.0 ? 0.05 * lacking[i] : 0.0;
}

static double fast(size_t i, size_t p)
{
    (void)p;
    return fabs(pace(i)) > 0.9 ? 0.05 * lacking[i] : 0.0;
}

static double strong(size_t i, size_t p)
{
    (void)p;
    return fabs(drive_torque(i)) > 0.3 ? 0.05 * lacking[i] : 0.0;
}

static void test_misfit_of_the_right_model_is_noise_everywhere(void)
{
    find(NULL);
    TEST_ASSERT_FALSE(misfit_is_left(&misfit, misfit_extended));
    enum misfit_axis_kind axes[misfit_axes];
    TEST_ASSERT_EQUAL_UINT(0, misfit_order(&misfit, misfit_extended, axes));
    TEST_ASSERT_DOUBLE_WITHIN(0.15, 1.0, misfit_noise_share(&misfit, misfit_extended)); // 601 values: 6 % each
    TEST_ASSERT_TRUE(misfit_noise_share(&misfit, misfit_given) < 0.1);
}

static void test_misfit_loses_nothing_on_the_way_to_time(void)
{
    const double rounding = 1e-6;
    find(above_half);
    for (int m = 0; m < misfit_models; m++) {
        double whole = misfit.squares[m];
        for (int a = misfit_frequency; a < misfit_axes; a++) {
            double squares = 0.0, values = 0.0;
            for (size_t i = 0; i < misfit.axes[a].parts; i++) {
                squares += misfit.axes[a].part[i].squares[m];
                values += misfit.axes[a].part[i].values;
            }
            if (a == misfit_time) { // of every period
                TEST_ASSERT_DOUBLE_WITHIN(rounding * values, periods * misfit.values, values);
                continue;
            }
            TEST_ASSERT_DOUBLE_WITHIN(rounding * whole, whole, squares);
            TEST_ASSERT_DOUBLE_WITHIN(rounding * values, misfit.values, values);
        }
    }
}

static void test_misfit_of_one_place_lies_there(void)
{
    find(above_half);
    const struct misfit_range *range = range_of(misfit_position);
    TEST_ASSERT_DOUBLE_WITHIN(0.15, 0.5, range->low);
    TEST_ASSERT_TRUE(range->open_high);
    enum misfit_axis_kind axes[misfit_axes];
    TEST_ASSERT_TRUE(misfit_order(&misfit, misfit_extended, axes) > 0);
    TEST_ASSERT_EQUAL_INT(misfit_position, axes[0]);
}

static void test_misfit_of_one_band_lies_there(void)
{
    find(in_band);
    const struct misfit_range *range = range_of(misfit_frequency);
    double hz = model.sample_rate_hz / samples;
    TEST_ASSERT_TRUE(range->low <= 100.0 * hz && range->high >= 109.0 * hz);
    TEST_ASSERT_TRUE(range->high < 150.0 * hz && range->low > 70.0 * hz);
}

static void test_misfit_of_one_direction_lies_there(void)
{
    find(backward);
    const struct misfit_range *range = range_of(misfit_direction);
    TEST_ASSERT_EQUAL_UINT(0, range->first);
    TEST_ASSERT_EQUAL_UINT(0, range->last);
}

static void test_misfit_of_high_speed_lies_there_both_ways(void)
{
    find(fast);
    const struct misfit_range *range = range_of(misfit_speed);
    const struct misfit_axis *axis = &misfit.axes[misfit_speed];
    double highest = axis->part[axis->parts - 1].high;
    TEST_ASSERT_DOUBLE_WITHIN(0.1 * highest, 0.9 * highest, range->low);
    TEST_ASSERT_TRUE(range->open_high);
    TEST_ASSERT_TRUE(misfit_rms(&axis->part[0], misfit_extended) > 2.0); // backward as well
}

static void test_misfit_of_a_high_level_lies_there(void)
{
    find(strong);
    const struct misfit_range *range = range_of(misfit_level);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 0.3, range->low);
    TEST_ASSERT_TRUE(range->open_high);
}

static void test_misfit_of_the_last_periods_lies_late(void)
{
    find(late);
    const struct misfit_range *range = &misfit.axes[misfit_time].range[misfit_extended];
    TEST_ASSERT_TRUE(range->found);
    TEST_ASSERT_DOUBLE_WITHIN(0.5, (double)(5 * samples) / model.sample_rate_hz, range->low);
    TEST_ASSERT_TRUE(range->open_high);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_misfit_of_the_right_model_is_noise_everywhere);
    RUN_TEST(test_misfit_loses_nothing_on_the_way_to_time);
    RUN_TEST(test_misfit_of_one_place_lies_there);
    RUN_TEST(test_misfit_of_one_band_lies_there);
    RUN_TEST(test_misfit_of_one_direction_lies_there);
    RUN_TEST(test_misfit_of_high_speed_lies_there_both_ways);
    RUN_TEST(test_misfit_of_a_high_level_lies_there);
    RUN_TEST(test_misfit_of_the_last_periods_lies_late);
    return UNITY_END();
}
