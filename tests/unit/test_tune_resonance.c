/* SPDX-License-Identifier: MIT */
/// Resonance and antiresonance from lines: against the equations of the drive, with delay, noise and few lines.
#include "lab/numeric/statistics.h"
#include "lab/tune/resonance.h"
#include "tests/support/known_drive.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>

static struct frf frf;
static struct tune_plant plant;

void setUp(void) {}

void tearDown(void)
{
    tune_plant_free(&plant);
    frf_free(&frf);
}

static void take(const struct known_drive *drive, double first_hz, double step_hz, size_t count)
{
    struct error error;
    frf = known_frf(drive, first_hz, step_hz, count);
    TEST_ASSERT_EQUAL_INT(0, tune_plant_take("frf.csv", &frf, 0.0, 0.0, &plant, &error));
}

struct pair {
    double hz, damping;
};

static struct pair pair_of(double complex s)
{
    return (struct pair){cabs(s) / known_two_pi, -creal(s) / cabs(s)};
}

/// The pole pair of a two-mass drive without bearings, from its equations; sampling does not move it.
static struct pair pole_of(double motor, double load, double stiffness, double damping)
{
    const double w = sqrt(stiffness * (1.0 / motor + 1.0 / load)), d = 0.5 * damping * (1.0 / motor + 1.0 / load) / w;
    return (struct pair){w / known_two_pi, d};
}

/// The zero pair of the sampled drive, which the hold moves: by the secant method from that of the equations.
static struct pair zero_of(const struct known_drive *drive, double load, double stiffness, double damping)
{
    const double w = sqrt(stiffness / load), Ts = 1.0 / drive->rate_hz;
    double complex before = -0.5 * damping / load + I * w, s = before * 1.001;
    double complex value_before = known_response(drive, cexp(-before * Ts));
    for (int step = 0; step < 30; step++) {
        const double complex value = known_response(drive, cexp(-s * Ts));
        const double complex next = value == value_before ? s : s - value * (s - before) / (value - value_before);
        before = s;
        value_before = value;
        s = next;
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, cabs(known_response(drive, cexp(-s * Ts))));
    return pair_of(s);
}

static void test_tune_resonance_is_that_of_the_equations(void)
{
    static const struct {
        double stiffness, damping, step_hz;
        size_t delay;
    } cases[] = {{60.0, 0.01, 1.0, 0},
                 {600.0, 0.05, 1.0, 1},
                 {600.0, 0.05, 2.5, 3},
                 {2000.0, 0.3, 0.5, 1},
                 {200.0, 0.002, 0.25, 2}};
    // What is left is the curvature of delay, hold and the other pair over the window.
    const double frequency_tolerance = 1e-3, damping_tolerance = 0.02;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct known_drive drive =
            known_two_mass(2000.0, cases[i].delay, 0.003, 0.002, cases[i].stiffness, cases[i].damping, 1e-6);
        const struct pair pole = pole_of(0.003, 0.002, cases[i].stiffness, cases[i].damping);
        const struct pair zero = zero_of(&drive, 0.002, cases[i].stiffness, cases[i].damping);
        struct resonance found;
        take(&drive, 1.0, cases[i].step_hz, (size_t)(900.0 / cases[i].step_hz));
        TEST_ASSERT_TRUE(resonance_find(&plant, &found));
        TEST_ASSERT_TRUE(found.found && found.has_antiresonance);
        printf("%8.4f Hz %.5f, %8.4f Hz %.5f found; %8.4f %.5f, %8.4f %.5f exact\n", found.frequency_hz, found.damping,
               found.antiresonance_hz, found.antiresonance_damping, pole.hz, pole.damping, zero.hz, zero.damping);
        TEST_ASSERT_DOUBLE_WITHIN(frequency_tolerance * pole.hz, pole.hz, found.frequency_hz);
        TEST_ASSERT_DOUBLE_WITHIN(frequency_tolerance * zero.hz, zero.hz, found.antiresonance_hz);
        TEST_ASSERT_DOUBLE_WITHIN(damping_tolerance * pole.damping, pole.damping, found.damping);
        TEST_ASSERT_DOUBLE_WITHIN(damping_tolerance * zero.damping, zero.damping, found.antiresonance_damping);
        tearDown();
    }
}

static void add_noise(double std, uint64_t seed)
{
    struct random random;
    random_seed(&random, seed);
    for (size_t k = 0; k < plant.count; k++) {
        const double real = std * sqrt(0.5) * random_normal(&random), imag = std * sqrt(0.5) * random_normal(&random);
        plant.response[k] += real + imag * I;
        plant.std[k] = std;
    }
}

static void test_tune_resonance_bears_noise(void)
{
    const struct known_drive drive = known_two_mass(2000.0, 1, 0.003, 0.002, 600.0, 0.05, 0.005);
    const struct pair pole = pole_of(0.003, 0.002, 600.0, 0.05);
    struct resonance found;
    take(&drive, 1.0, 1.0, 900);
    add_noise(0.02, 4); // the response is 3.5 at the resonance, .4 beside it
    TEST_ASSERT_TRUE(resonance_find(&plant, &found));
    TEST_ASSERT_TRUE(found.found);
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * pole.hz, pole.hz, found.frequency_hz);
    TEST_ASSERT_DOUBLE_WITHIN(0.15 * pole.damping, pole.damping, found.damping);
}

/// Noise makes peaks of more than 3 dB where the response is small; its standard deviation says that they are none.
static void test_tune_resonance_is_not_found_in_noise(void)
{
    const struct known_drive drive = known_rigid(2000.0, 1, 0.005, 0.01);
    struct resonance found;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        take(&drive, 1.0, 1.0, 900);
        add_noise(0.02, seed);
        TEST_ASSERT_TRUE(resonance_find(&plant, &found));
        TEST_ASSERT_FALSE_MESSAGE(found.found, "a resonance in noise alone");
        tearDown();
    }
}

static void test_tune_resonance_is_not_found_in_a_rigid_drive(void)
{
    const struct known_drive drive = known_rigid(2000.0, 1, 0.005, 0.01);
    struct resonance found;
    take(&drive, 1.0, 1.0, 900);
    TEST_ASSERT_TRUE(resonance_find(&plant, &found));
    TEST_ASSERT_FALSE(found.found);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_tune_resonance_is_that_of_the_equations);
    RUN_TEST(test_tune_resonance_bears_noise);
    RUN_TEST(test_tune_resonance_is_not_found_in_noise);
    RUN_TEST(test_tune_resonance_is_not_found_in_a_rigid_drive);
    return UNITY_END();
}
