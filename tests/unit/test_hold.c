/* SPDX-License-Identifier: MIT */
/// A torque that is held until the next row is told from one that was measured at its row.
#include "lab/diagnose/hold.h"

#include "unity.h"

#include <math.h>
#include <string.h>

enum { rows = 6000, substeps = 20 };

static const double two_pi = 6.283185307179586;
static const double rate_hz = 1000.0, inertia = 0.004, viscous = 0.02, dry = 0.1;
/// Of a sample: sign(v) of the rows is not the friction between them where the direction changes.
static const double tolerance = 0.05;

static double torque[rows], position[rows], velocity[rows];
static size_t bins[1];
static struct recording recording;

void setUp(void)
{
    recording = (struct recording){.rate_hz = rate_hz, .bin_count = 1, .bins = bins};
    recording.block = (struct stretch){.samples = rows, .torque = torque, .position = position, .velocity = velocity};
    bins[0] = rows / 25; // the highest line is at 40 Hz
}

void tearDown(void) {}

static double wanted(double time_s)
{
    double sum = 0.0;
    for (int k = 1; k <= 40; k += 3)
        sum += cos(two_pi * k * time_s + k * k);
    return 0.3 * sum;
}

/// Runs a body with friction; the torque is held over a sample, or is that of the instant and `late_s` before.
static void run_body(bool held, double late_s, double spring)
{
    double x = 0.0, v = 0.0, step_s = 1.0 / rate_hz / substeps;
    for (size_t n = 0; n < rows; n++) {
        torque[n] = wanted((double)n / rate_hz);
        position[n] = x;
        velocity[n] = v;
        for (size_t i = 0; i < substeps; i++) {
            double time_s = ((double)n + ((double)i + 0.5) / substeps) / rate_hz;
            double acting = held ? torque[n] : wanted(time_s - late_s);
            double friction = viscous * v + dry * tanh(v / 1e-3);
            v += (acting - friction - spring * x) / inertia * step_s;
            x += v * step_s;
        }
    }
}

static struct hold found(void)
{
    struct hold hold = {0};
    TEST_ASSERT_TRUE(hold_find(&recording, &hold));
    TEST_ASSERT_TRUE(hold.deviation > 0.0 && hold.deviation < tolerance);
    return hold;
}

static void test_hold_of_a_torque_measured_at_its_row_is_none(void)
{
    run_body(false, 0.0, 0.0);
    struct hold hold = found();
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, 0.0, hold.delay);
    TEST_ASSERT_TRUE(hold.explained > 0.99);
}

static void test_hold_of_a_command_is_half_a_sample(void)
{
    run_body(true, 0.0, 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, 0.5, found().delay);
}

static void test_hold_finds_any_other_delay(void)
{
    run_body(false, 1.5e-3, 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, 1.5, found().delay);
}

static void test_hold_says_how_much_a_rigid_body_leaves(void)
{
    // A spring to the ground that swings at 10 Hz takes most of the torque below it.
    run_body(true, 0.0, inertia * pow(two_pi * 10.0, 2.0));
    struct hold hold = {0};
    TEST_ASSERT_TRUE(hold_find(&recording, &hold));
    TEST_ASSERT_TRUE(hold.explained < 0.9);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_hold_of_a_torque_measured_at_its_row_is_none);
    RUN_TEST(test_hold_of_a_command_is_half_a_sample);
    RUN_TEST(test_hold_finds_any_other_delay);
    RUN_TEST(test_hold_says_how_much_a_rigid_body_leaves);
    return UNITY_END();
}
