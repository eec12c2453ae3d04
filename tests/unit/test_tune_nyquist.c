/* SPDX-License-Identifier: MIT */
/// The verdict on stability from lines alone, held against the closed loop's poles; and when it refuses to judge.
#include "lab/numeric/statistics.h"
#include "lab/tune/nyquist.h"
#include "lab/tune/tune.h"
#include "tests/support/known_drive.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { campaign_seed = 11, drives = 40, gains_per_drive = 10 };

/// Loops this close to the unit circle are neither: sampled lines may pass -1 on either side.
static const double too_close = 1e-8;

static struct frf frf;
static struct tune_plant plant;
static double complex *loop;
static struct tune_controller controller;

void setUp(void) {}

void tearDown(void)
{
    tune_plant_free(&plant);
    frf_free(&frf);
    free(loop);
    loop = NULL;
}

static void take(const struct known_drive *drive, double first_hz, double step_hz, size_t count)
{
    struct error error;
    frf = known_frf(drive, first_hz, step_hz, count);
    TEST_ASSERT_EQUAL_INT(0, tune_plant_take("frf.csv", &frf, 0.0, 0.0, &plant, &error));
    loop = calloc(plant.count, sizeof *loop);
}

static struct nyquist judge(double Kp, double Ki)
{
    struct nyquist nyquist;
    struct error error;
    controller = (struct tune_controller){
        .structure = tune_structure_find("pi", &error), .rate_hz = plant.rate_hz, .gain = {Kp, Ki}};
    for (size_t k = 0; k < plant.count; k++)
        loop[k] = tune_controller_at(&controller, plant.delay[k]) * plant.response[k];
    nyquist_judge(&plant, plant.response, loop, &controller, true, &nyquist);
    return nyquist;
}

static double uniform(struct random *random, double low, double high)
{
    return low + (high - low) * random_uniform(random);
}

/// Low to high on a logarithmic scale.
static double spread(struct random *random, double low, double high)
{
    return low * pow(high / low, random_uniform(random));
}

static struct known_drive draw_drive(struct random *random)
{
    const double inertia = spread(random, 1e-4, 1e-1);
    const size_t delay = (size_t)uniform(random, 0.0, 5.0);
    if (random_uniform(random) < 0.3)
        return known_rigid(2000.0, delay, inertia, inertia * spread(random, 0.05, 20.0));
    const double share = uniform(random, 0.2, 0.8), motor = share * inertia, load = inertia - motor;
    const double resonance = known_two_pi * spread(random, 15.0, 400.0);
    const double stiffness = resonance * resonance * motor * load / inertia;
    const double damping = 2.0 * uniform(random, 0.01, 0.1) * stiffness / resonance;
    return known_two_mass(2000.0, delay, motor, load, stiffness, damping, inertia * spread(random, 0.05, 5.0));
}

static void test_tune_nyquist_agrees_with_the_poles_of_random_loops(void)
{
    struct random random;
    size_t judged[2] = {0}, undecided = 0, close = 0;
    random_seed(&random, campaign_seed);
    for (int d = 0; d < drives; d++) {
        const struct known_drive drive = draw_drive(&random);
        take(&drive, 0.5, 0.5, 1999);
        const double inertia = 1.0 / cabs(plant.response[100]) / (known_two_pi * plant.frequency_hz[100]);
        for (int g = 0; g < gains_per_drive; g++) {
            const double crossover = known_two_pi * spread(&random, 5.0, 800.0);
            const double Kp = crossover * inertia, Ki = Kp * crossover * spread(&random, 1e-3, 2.0);
            const double pole = known_worst_pole(&drive, Kp, Ki);
            const struct nyquist nyquist = judge(Kp, Ki);
            char which[sizeof nyquist.reason + 200];
            snprintf(which, sizeof which, "seed %d, drive %d, loop %d: Kp %.6g Ki %.6g, worst pole %.6f, %s",
                     (int)campaign_seed, d, g, Kp, Ki, pole, nyquist.reason);
            if (nyquist.verdict == nyquist_undecided) {
                TEST_ASSERT_TRUE(nyquist.reason[0] != '\0');
                undecided++;
            } else if (fabs(pole - 1.0) < too_close) {
                close++;
            } else {
                TEST_ASSERT_EQUAL_INT_MESSAGE(pole < 1.0, nyquist.verdict == nyquist_stable, which);
                judged[pole < 1.0]++;
            }
        }
        tearDown();
    }
    printf("of %d loops: %zu unstable and %zu stable ones judged right, %zu refused, %zu on the edge\n",
           (int)(drives * gains_per_drive), judged[0], judged[1], undecided, close);
    TEST_ASSERT_TRUE(judged[0] >= 40 && judged[1] >= 100); // the campaign has both kinds, and most get a verdict
    TEST_ASSERT_TRUE(2 * undecided < (size_t)drives * gains_per_drive);
}

/// A pair of unstable poles is counted as two.
static void test_tune_nyquist_counts_unstable_poles(void)
{
    const struct known_drive drive = known_rigid(2000.0, 4, 0.005, 0.01);
    take(&drive, 1.0, 1.0, 999);
    const struct nyquist nyquist = judge(0.005 * known_two_pi * 200.0, 0.1);
    TEST_ASSERT_EQUAL_INT_MESSAGE(nyquist_unstable, nyquist.verdict, nyquist.reason);
    TEST_ASSERT_EQUAL_INT(2, nyquist.unstable_poles);
    TEST_ASSERT_TRUE(known_worst_pole(&drive, 0.005 * known_two_pi * 200.0, 0.1) > 1.0);
}

static void refuses(double Kp, double Ki, const char *part)
{
    const struct nyquist nyquist = judge(Kp, Ki);
    TEST_ASSERT_EQUAL_INT(nyquist_undecided, nyquist.verdict);
    TEST_ASSERT_TRUE_MESSAGE(strstr(nyquist.reason, part) != NULL, nyquist.reason);
}

static void test_tune_nyquist_refuses_lines_that_begin_above_the_crossover(void)
{
    const struct known_drive drive = known_rigid(2000.0, 1, 0.005, 0.01);
    take(&drive, 50.0, 1.0, 900);
    refuses(0.005 * known_two_pi * 30.0, 0.1, "lines below the crossover are missing");
}

static void test_tune_nyquist_refuses_lines_that_end_below_the_crossover(void)
{
    const struct known_drive drive = known_rigid(2000.0, 1, 0.005, 0.01);
    take(&drive, 1.0, 1.0, 30);
    refuses(0.005 * known_two_pi * 30.0, 0.1, "lines above the crossover are missing");
}

static void test_tune_nyquist_refuses_a_resonance_between_two_lines(void)
{
    const struct known_drive drive = known_two_mass(2000.0, 1, 0.003, 0.002, 400.0, 0.002, 0.005);
    take(&drive, 1.0, 20.0, 49); // resonance at 91 Hz, 4 Hz wide
    refuses(0.005 * known_two_pi * 30.0, 0.1, "a resonance may hide there");
}

/// Beside its resonance this loop is small on every line, and turns little seen from -1: only its phase gives it away.
static void test_tune_nyquist_refuses_an_unstable_resonance_that_no_line_shows(void)
{
    const struct known_drive drive = known_two_mass(2000.0, 2, 0.003, 0.002, 6000.0, 0.02, 0.005);
    const double Kp = 0.005 * known_two_pi * 13.0, Ki = 0.1;
    take(&drive, 5.8, 20.0, 49); // resonance at 356 Hz, 2.6 Hz wide, in the middle between two lines
    double largest = 0.0;
    for (size_t k = 0; k < plant.count; k++)
        if (plant.frequency_hz[k] > 200.0)
            largest = fmax(largest, Kp * cabs(plant.response[k]));
    TEST_ASSERT_TRUE(largest < 0.7); // far from turning by 90 degrees round -1
    TEST_ASSERT_TRUE(known_worst_pole(&drive, Kp, Ki) > 1.0);
    refuses(Kp, Ki, "a resonance may hide there");
}

static void test_tune_nyquist_refuses_a_wrong_sign(void)
{
    const struct known_drive drive = known_rigid(2000.0, 1, 0.005, 0.01);
    take(&drive, 1.0, 1.0, 900);
    for (size_t k = 0; k < plant.count; k++)
        plant.response[k] = -plant.response[k];
    refuses(0.005 * known_two_pi * 30.0, 0.1, "a wrong sign of the velocity?");
}

static void test_tune_nyquist_refuses_where_noise_decides(void)
{
    const struct known_drive drive = known_rigid(2000.0, 1, 0.005, 0.01);
    take(&drive, 1.0, 1.0, 900);
    TEST_ASSERT_EQUAL_INT(nyquist_stable, judge(0.005 * known_two_pi * 60.0, 1.0).verdict);
    for (size_t k = 0; k < plant.count; k++)
        plant.std[k] = 0.8 * cabs(plant.response[k]);
    refuses(0.005 * known_two_pi * 60.0, 1.0, "noise decides");
}

/// A sharp antiresonance turns the phase forward, near 0: nothing to refuse.
static void test_tune_nyquist_takes_an_antiresonance_between_lines(void)
{
    const struct known_drive drive = known_two_mass(2000.0, 0, 0.003, 0.002, 4.0, 0.004, 0.002);
    take(&drive, 0.25, 0.25, 3900); // antiresonance at 7.1 Hz, damping .02
    const struct nyquist nyquist = judge(0.003 * known_two_pi * 60.0, 1.0);
    TEST_ASSERT_EQUAL_INT_MESSAGE(nyquist_stable, nyquist.verdict, nyquist.reason);
    TEST_ASSERT_TRUE(known_worst_pole(&drive, 0.003 * known_two_pi * 60.0, 1.0) < 1.0);
}

static void test_tune_nyquist_takes_a_position_response(void)
{
    // The integral of a rigid body's velocity: phase from -90 degrees with friction on to -180 and beyond.
    const double numerator[] = {0.0, 1.0}, denominator[] = {0.005, 0.01, 0.0};
    const struct known_drive drive = known_transfer(2000.0, 1, 2, numerator, denominator);
    struct nyquist nyquist;
    struct error error;
    take(&drive, 0.5, 0.5, 1900);
    plant.output = tune_output_position;
    for (int with_lead = 0; with_lead < 2; with_lead++) {
        controller = (struct tune_controller){.structure = tune_structure_find("lead", &error),
                                              .rate_hz = plant.rate_hz,
                                              .corner_hz = 300.0,
                                              .gain = {100.0, with_lead ? 1.0 : 0.0}};
        for (size_t k = 0; k < plant.count; k++)
            loop[k] = tune_controller_at(&controller, plant.delay[k]) * plant.response[k];
        nyquist_judge(&plant, plant.response, loop, &controller, true, &nyquist);
        TEST_ASSERT_EQUAL_INT_MESSAGE(with_lead ? nyquist_stable : nyquist_unstable, nyquist.verdict, nyquist.reason);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_tune_nyquist_agrees_with_the_poles_of_random_loops);
    RUN_TEST(test_tune_nyquist_counts_unstable_poles);
    RUN_TEST(test_tune_nyquist_refuses_lines_that_begin_above_the_crossover);
    RUN_TEST(test_tune_nyquist_refuses_lines_that_end_below_the_crossover);
    RUN_TEST(test_tune_nyquist_refuses_a_resonance_between_two_lines);
    RUN_TEST(test_tune_nyquist_refuses_an_unstable_resonance_that_no_line_shows);
    RUN_TEST(test_tune_nyquist_refuses_a_wrong_sign);
    RUN_TEST(test_tune_nyquist_refuses_where_noise_decides);
    RUN_TEST(test_tune_nyquist_takes_an_antiresonance_between_lines);
    RUN_TEST(test_tune_nyquist_takes_a_position_response);
    return UNITY_END();
}
