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

/// A hole in the lines, around the resonance as often as not.
static void make_hole(const struct known_drive *drive, struct random *random)
{
    size_t peak = 1;
    for (size_t k = 2; k + 1 < frf.count; k++) {
        const double complex G = frf.real[k] + frf.imag[k] * I, P = frf.real[peak] + frf.imag[peak] * I;
        peak = frf.frequency_hz[k] * cabs(G) > frf.frequency_hz[peak] * cabs(P) ? k : peak;
    }
    const bool around = drive->order > 1 && random_uniform(random) < 0.7;
    const double low = around ? frf.frequency_hz[peak] * uniform(random, 0.4, 0.95) : spread(random, 5.0, 300.0);
    const double high = around ? frf.frequency_hz[peak] * uniform(random, 1.05, 2.0) : low * uniform(random, 1.1, 4.0);
    for (size_t k = 0; k < frf.count; k++)
        frf.valid[k] = !(frf.frequency_hz[k] > low && frf.frequency_hz[k] < high);
}

/// No loop is certified that a resonance in a hole makes unstable. Without the look into gaps some would be.
static void test_tune_nyquist_certifies_no_unstable_loop_across_a_hole(void)
{
    enum { holes = 800, fooled_least = 10, stable_least = 40 };
    struct random random;
    struct error error;
    size_t fooled = 0, stable = 0, refused = 0;
    random_seed(&random, campaign_seed);
    for (int h = 0; h < holes; h++) {
        const struct known_drive drive = draw_drive(&random);
        frf = known_frf(&drive, 1.0, 1.0, 990);
        make_hole(&drive, &random);
        TEST_ASSERT_EQUAL_INT(0, tune_plant_take("frf.csv", &frf, 0.0, 0.0, &plant, &error));
        loop = calloc(plant.count, sizeof *loop);
        const double inertia = 1.0 / cabs(plant.response[0]) / (known_two_pi * plant.frequency_hz[0]);
        const double crossover = known_two_pi * spread(&random, 5.0, 200.0);
        const double Kp = crossover * inertia, Ki = Kp * crossover * spread(&random, 1e-3, 0.5);
        const bool is_stable = known_worst_pole(&drive, Kp, Ki) < 1.0;
        const struct nyquist judged = judge(Kp, Ki);
        struct nyquist lines;
        nyquist_judge(&plant, plant.response, loop, &controller, false, &lines);
        char which[sizeof judged.reason + 100];
        snprintf(which, sizeof which, "seed %d, hole %d: Kp %.6g Ki %.6g", (int)campaign_seed, h, Kp, Ki);
        TEST_ASSERT_TRUE_MESSAGE(is_stable || judged.verdict != nyquist_stable, which);
        fooled += !is_stable && lines.verdict == nyquist_stable;
        stable += judged.verdict == nyquist_stable;
        refused += judged.verdict == nyquist_undecided;
        tearDown();
    }
    printf("of %d drives with a hole in their lines: %zu judged stable, %zu refused; %zu unstable ones that the lines "
           "alone would have passed\n",
           (int)holes, stable, refused, fooled);
    TEST_ASSERT_TRUE(fooled >= fooled_least && stable >= stable_least);
}

static void test_tune_nyquist_names_the_gap_and_the_lines_left_out(void)
{
    const struct known_drive drive = known_rigid(2000.0, 1, 0.005, 0.01);
    struct error error;
    frf = known_frf(&drive, 0.5, 0.5, 1800);
    for (size_t k = 0; k < frf.count; k++)
        frf.valid[k] = !(frf.frequency_hz[k] > 17.5 && frf.frequency_hz[k] < 50.5);
    TEST_ASSERT_EQUAL_INT(0, tune_plant_take("frf.csv", &frf, 0.0, 0.0, &plant, &error));
    loop = calloc(plant.count, sizeof *loop);
    refuses(0.005 * known_two_pi * 10.0, 0.1,
            "expected lines between 17.5 and 50.5 Hz (65 lines at 18..50 Hz not valid)");
    refuses(0.005 * known_two_pi * 30.0, 0.1, "between the lines at 17.5 and 50.5 Hz"); // the crossover is in it
    tearDown();
    frf = known_frf(&drive, 0.5, 0.5, 1800);
    for (size_t k = 0; k < frf.count; k++)
        frf.valid[k] = !(frf.frequency_hz[k] > 200.0 && frf.frequency_hz[k] < 600.0);
    TEST_ASSERT_EQUAL_INT(0, tune_plant_take("frf.csv", &frf, 0.0, 0.0, &plant, &error));
    loop = calloc(plant.count, sizeof *loop);
    TEST_ASSERT_EQUAL_INT(nyquist_stable, judge(0.005 * known_two_pi * 6.0, 0.1).verdict); // 30 dB below
    refuses(0.005 * known_two_pi * 20.0, 0.1, "between the lines at 200 and 600 Hz");      // 20 dB
}

/// Grids as they are used, with a line missing here and there.
static void test_tune_nyquist_takes_usual_grids(void)
{
    static const struct {
        const char *name;
        double first_hz, step_hz, ratio;
    } grids[] = {{"linear", 1.0, 1.0, 0.0},        {"odd", 1.0, 2.0, 0.0},         {"half", 0.5, 0.5, 0.0},
                 {"quasi-log 1.05", 1.0, 0, 1.05}, {"quasi-log 1.1", 1.0, 0, 1.1}, {"quasi-log 1.2", 1.0, 0, 1.2},
                 {"quasi-log 1.3", 1.0, 0, 1.3},   {"coarse", 2.0, 4.0, 0.0}};
    const struct known_drive drive = known_rigid(2000.0, 2, 0.005, 0.01);
    for (size_t g = 0; g < sizeof grids / sizeof *grids; g++)
        for (int missing = 0; missing < 2; missing++) {
            struct error error;
            double f = grids[g].first_hz;
            size_t n = 0;
            frf = known_frf(&drive, 1.0, 1.0, 2000);
            while (f < 900.0) {
                const double complex G = known_response(&drive, cexp(-I * known_two_pi * f / drive.rate_hz));
                frf.frequency_hz[n] = f;
                frf.real[n] = creal(G);
                frf.imag[n] = cimag(G);
                frf.valid[n] = !(missing && grids[g].ratio < 1.2 && n % 13 == 10);
                f = grids[g].ratio > 0.0 ? f * grids[g].ratio : f + grids[g].step_hz;
                n++;
            }
            frf.count = n;
            TEST_ASSERT_EQUAL_INT(0, tune_plant_take("frf.csv", &frf, 0.0, 0.0, &plant, &error));
            loop = calloc(plant.count, sizeof *loop);
            for (double crossover = 15.0; crossover < 100.0; crossover *= 1.3) {
                const double Kp = 0.005 * known_two_pi * crossover;
                const struct nyquist nyquist = judge(Kp, 0.2 * Kp * crossover);
                char which[sizeof nyquist.reason + 80];
                snprintf(which, sizeof which, "%s, crossover %.3g Hz: %s", grids[g].name, crossover, nyquist.reason);
                TEST_ASSERT_EQUAL_INT_MESSAGE(nyquist_stable, nyquist.verdict, which);
            }
            frf.count = 2000;
            tearDown();
        }
}

/// What the file says of itself is believed: -1 within it is undecided, for that reason.
static void test_tune_nyquist_refuses_where_doubt_decides(void)
{
    const struct known_drive drive = known_rigid(2000.0, 1, 0.005, 0.01);
    take(&drive, 1.0, 1.0, 900);
    snprintf(plant.doubt_from, sizeof plant.doubt_from, "another input answers");
    for (size_t k = 0; k < plant.count; k++)
        plant.doubt[k] = 0.05 * cabs(plant.response[k]);
    TEST_ASSERT_EQUAL_INT(nyquist_stable, judge(0.005 * known_two_pi * 60.0, 1.0).verdict);
    for (size_t k = 0; k < plant.count; k++)
        plant.doubt[k] = 1.2 * cabs(plant.response[k]);
    refuses(0.005 * known_two_pi * 60.0, 1.0, "only: another input answers");
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
    controller.gain[0] = 0.0; // a derivative alone: a pole at 1, and the position drifts
    controller.gain[1] = 1.0;
    for (size_t k = 0; k < plant.count; k++)
        loop[k] = tune_controller_at(&controller, plant.delay[k]) * plant.response[k];
    nyquist_judge(&plant, plant.response, loop, &controller, true, &nyquist);
    TEST_ASSERT_EQUAL_INT(nyquist_undecided, nyquist.verdict);
    TEST_ASSERT_NOT_NULL(strstr(nyquist.reason, "nothing holds the position"));
}

/// Lines 1/delay apart show a curve without the delay, which would be stable.
static void test_tune_nyquist_refuses_a_known_delay_that_lines_do_not_show(void)
{
    static const struct {
        double step_hz, loop_delay_s, removed_s;
        enum nyquist_verdict verdict;
    } cases[] = {
        {1.0, 0.0, 0.0, nyquist_stable},    {1.0, 0.001, 0.0, nyquist_stable},    {1.0, 0.05, 0.0, nyquist_unstable},
        {1.0, 1.0, 0.0, nyquist_undecided}, {1.0, 0.0, 1.0, nyquist_undecided},   {1.0, 0.5, 0.5, nyquist_undecided},
        {1.0, 3.0, 0.0, nyquist_undecided}, {1.0, 0.9, 0.0, nyquist_undecided},   {2.0, 0.5, 0.0, nyquist_undecided},
        {5.0, 0.2, 0.0, nyquist_undecided}, {0.125, 0.05, 0.0, nyquist_unstable},
    };
    const double crossover = known_two_pi * 30.0, inertia = 0.005;
    const struct known_drive drive = known_rigid(2000.0, 1, inertia, 0.01);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error error;
        char removed[32], which[600];
        const double step_hz = cases[i].step_hz;
        frf = known_frf(&drive, step_hz, step_hz, (size_t)(990.0 / step_hz));
        snprintf(removed, sizeof removed, "%.6g", cases[i].removed_s);
        TEST_ASSERT_TRUE(frf_set_text(&frf.keys[0].key, "delay_removed_s") &&
                         frf_set_text(&frf.keys[0].value, removed));
        TEST_ASSERT_EQUAL_INT(0,
                              tune_plant_take("frf.csv", &frf, drive.rate_hz, cases[i].loop_delay_s, &plant, &error));
        loop = calloc(plant.count, sizeof *loop);
        const struct nyquist nyquist = judge(crossover * inertia, 0.1);
        snprintf(which, sizeof which, "lines %g Hz apart, loop delay %g s, removed %g s: %s", step_hz,
                 cases[i].loop_delay_s, cases[i].removed_s, nyquist.reason);
        TEST_ASSERT_EQUAL_INT_MESSAGE(cases[i].verdict, nyquist.verdict, which);
        if (nyquist.verdict == nyquist_undecided)
            TEST_ASSERT_TRUE_MESSAGE(strstr(nyquist.reason, "known delay") != NULL, which);
        tearDown();
    }
}

/// A delay that the response itself contains, of half a turn or more from line to line: no lead is taken for a drive's.
static void test_tune_nyquist_refuses_a_delay_that_lines_show_backwards(void)
{
    static const double turns[] = {0.26, 0.4, 0.5, 0.6, 0.75, 0.85, 0.95};
    const double inertia = 0.005;
    for (size_t i = 0; i < sizeof turns / sizeof *turns; i++) {
        char which[600];
        const struct known_drive drive = known_rigid(2000.0, 1, inertia, 0.01);
        take(&drive, 1.0, 1.0, 990);
        for (size_t k = 0; k < plant.count; k++) // the lowest line's branch is told by a lower one in practice
            plant.response[k] *= cexp(-I * known_two_pi * turns[i] * (plant.frequency_hz[k] - 1.0));
        const struct nyquist nyquist = judge(known_two_pi * 30.0 * inertia, 0.1);
        snprintf(which, sizeof which, "%g turns per line: %s", turns[i], nyquist.reason);
        TEST_ASSERT_EQUAL_INT_MESSAGE(nyquist_undecided, nyquist.verdict, which);
        TEST_ASSERT_TRUE_MESSAGE(strstr(which, "delay") != NULL, which);
        tearDown();
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_tune_nyquist_refuses_a_known_delay_that_lines_do_not_show);
    RUN_TEST(test_tune_nyquist_refuses_a_delay_that_lines_show_backwards);
    RUN_TEST(test_tune_nyquist_agrees_with_the_poles_of_random_loops);
    RUN_TEST(test_tune_nyquist_counts_unstable_poles);
    RUN_TEST(test_tune_nyquist_refuses_lines_that_begin_above_the_crossover);
    RUN_TEST(test_tune_nyquist_refuses_lines_that_end_below_the_crossover);
    RUN_TEST(test_tune_nyquist_refuses_a_resonance_between_two_lines);
    RUN_TEST(test_tune_nyquist_refuses_an_unstable_resonance_that_no_line_shows);
    RUN_TEST(test_tune_nyquist_refuses_a_wrong_sign);
    RUN_TEST(test_tune_nyquist_refuses_where_noise_decides);
    RUN_TEST(test_tune_nyquist_takes_an_antiresonance_between_lines);
    RUN_TEST(test_tune_nyquist_certifies_no_unstable_loop_across_a_hole);
    RUN_TEST(test_tune_nyquist_names_the_gap_and_the_lines_left_out);
    RUN_TEST(test_tune_nyquist_takes_usual_grids);
    RUN_TEST(test_tune_nyquist_refuses_where_doubt_decides);
    RUN_TEST(test_tune_nyquist_takes_a_position_response);
    return UNITY_END();
}
