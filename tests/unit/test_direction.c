/* SPDX-License-Identifier: MIT */
#include "lab/estimate/direction.h"

#include "unity.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { length = 1000, periods = 4, lines = 100 };

static const double two_pi = 6.283185307179586476925;

static struct run run;
static struct periodic recording;
static struct error error;

void setUp(void)
{
    static char path[] = "made";
    run = (struct run){.path = path, .sample_rate_hz = 1000.0, .rows = length * periods, .period_samples = length};
    run.bins = malloc(lines * sizeof *run.bins);
    run.bin_count = lines;
    for (uint32_t k = 0; k < lines; k++) {
        run.bins[k] = k + 1;
    }
}

void tearDown(void)
{
    periodic_free(&recording);
    run.path = NULL;
    run_free(&run);
}

/// A drive of two masses: antiresonance at 40 Hz, resonance at 55 Hz; friction, and a lag of the speed's sensor.
struct drive {
    double viscous; ///< over the inertia, 1/s
    double delay_s;
};

static double complex motor_speed(const struct drive *self, double frequency_hz)
{
    const double complex s = I * two_pi * frequency_hz;
    const double complex anti = 1.0 + 0.02 * s / (two_pi * 40.0) + s * s / pow(two_pi * 40.0, 2.0);
    const double complex resonance = 1.0 + 0.02 * s / (two_pi * 55.0) + s * s / pow(two_pi * 55.0, 2.0);
    return anti / resonance / (s + self->viscous) * cexp(-s * self->delay_s);
}

static double complex load_speed(const struct drive *self, double frequency_hz)
{
    const double complex s = I * two_pi * frequency_hz;
    const double complex anti = 1.0 + 0.02 * s / (two_pi * 40.0) + s * s / pow(two_pi * 40.0, 2.0);
    return motor_speed(self, frequency_hz) * (1.0 + 0.02 * s / (two_pi * 40.0)) / anti;
}

static double complex rigid_speed(const struct drive *self, double frequency_hz)
{
    const double complex s = I * two_pi * frequency_hz;
    return 1.0 / (s + self->viscous) * cexp(-s * self->delay_s);
}

typedef double complex response(const struct drive *self, double frequency_hz);

/// Adds a column that answers the torque; `position`: its integral.
static void add(const char *name, response *of, const struct drive *drive, double sign, bool position)
{
    double *column = run_add_column(&run, name);
    for (size_t k = 1; k <= lines; k++) {
        const double frequency_hz = (double)k;
        const double phase = 0.37 * (double)(k * k);
        double complex value = sign * (of ? of(drive, frequency_hz) : 1.0);
        value /= position ? I * two_pi * frequency_hz : 1.0;
        for (size_t n = 0; n < run.rows; n++) {
            column[n] += creal(value * cexp(I * (two_pi * (double)(k * n % length) / length + phase)));
        }
    }
}

static struct direction measure(const char *output)
{
    const struct periodic_options options = {.output = output, .settle = periodic_settle_given};
    struct direction direction;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &options, &recording, &error), error.message);
    TEST_ASSERT_TRUE(direction_measure(&recording, &direction));
    return direction;
}

/// From sheer inertia to sheer friction, with a sensor that lags by up to a quarter turn at 50 Hz.
static const struct drive drives[] = {{0.1, 0.0}, {20.0, 0.001}, {500.0, 0.0}, {20.0, 0.005}};

static void test_direction_says_nothing_where_all_is_right(void)
{
    for (size_t i = 0; i < sizeof drives / sizeof drives[0]; i++) {
        add("torque_Nm", NULL, &drives[i], 1.0, false);
        add("velocity_rad_per_s", motor_speed, &drives[i], 1.0, false);
        add("position_rad", motor_speed, &drives[i], 1.0, true);
        add("load_velocity_rad_per_s", load_speed, &drives[i], 1.0, false);
        add("load_position_rad", load_speed, &drives[i], 1.0, true);
        TEST_ASSERT_EQUAL_UINT(0, measure(NULL).count);
        tearDown();
        setUp();
    }
}

static void test_direction_finds_a_motor_that_counts_against_the_torque(void)
{
    /* Friction and resonance together may be a delay: the last two stay open. */
    for (size_t i = 0; i + 2 < sizeof drives / sizeof drives[0]; i++) {
        add("torque_Nm", NULL, &drives[i], 1.0, false);
        add("velocity_rad_per_s", motor_speed, &drives[i], -1.0, false);
        const struct direction direction = measure(NULL);
        TEST_ASSERT_EQUAL_UINT(1, direction.count);
        TEST_ASSERT_EQUAL_STRING("velocity_rad_per_s", direction.found[0].name);
        TEST_ASSERT_EQUAL_STRING("torque_Nm", direction.found[0].against);
        tearDown();
        setUp();
    }
}

/// A speed that lags by 4 ms hides its direction; the position beside it does not.
static void test_direction_takes_the_column_that_lags_less(void)
{
    const struct drive slow = {1.0, 0.004};
    const struct drive fast = {1.0, 0.0};
    for (int sign = -1; sign <= 1; sign += 2) {
        add("torque_Nm", NULL, &fast, 1.0, false);
        add("velocity_rad_per_s", motor_speed, &slow, sign, false);
        add("position_rad", motor_speed, &fast, sign, true);
        const struct direction direction = measure(NULL);
        TEST_ASSERT_TRUE(sign < 0 ? direction.count >= 1 : direction.count == 0);
        TEST_ASSERT_TRUE(sign > 0 || strcmp(direction.found[direction.count - 1].name, "position_rad") == 0);
        tearDown();
        setUp();
    }
}

static void test_direction_finds_a_position_that_counts_against_the_speed(void)
{
    add("torque_Nm", NULL, &drives[1], 1.0, false);
    add("velocity_rad_per_s", motor_speed, &drives[1], 1.0, false);
    add("position_rad", motor_speed, &drives[1], -1.0, true);
    double *position = run.columns[2].data;
    for (size_t n = 0; n < run.rows; n++) {
        position[n] += 0.002 * (double)n; /* a drift many times the motion says nothing about direction */
    }
    const struct direction direction = measure("position_rad");
    TEST_ASSERT_EQUAL_UINT(2, direction.count);
    TEST_ASSERT_EQUAL_STRING("position_rad", direction.found[0].name);
    TEST_ASSERT_EQUAL_STRING("velocity_rad_per_s", direction.found[0].against);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, -1.0, direction.found[0].cosine);
    TEST_ASSERT_EQUAL_STRING("position_rad", direction.found[1].name);
    TEST_ASSERT_EQUAL_STRING("torque_Nm", direction.found[1].against);
}

/// Above the antiresonance motor and load swing against each other, which is no fault.
static void test_direction_finds_a_load_that_counts_against_the_motor(void)
{
    for (int sign = -1; sign <= 1; sign += 2) {
        add("torque_Nm", NULL, &drives[1], 1.0, false);
        add("position_rad", motor_speed, &drives[1], 1.0, true);
        add("load_position_rad", load_speed, &drives[1], sign, true);
        const struct direction direction = measure(NULL);
        TEST_ASSERT_EQUAL_UINT(sign < 0, direction.count);
        if (sign < 0) {
            TEST_ASSERT_EQUAL_STRING("load_position_rad", direction.found[0].name);
        }
        tearDown();
        setUp();
    }
}

static void test_direction_asks_nothing_of_a_response_to_a_set_point(void)
{
    add("torque_Nm", NULL, &drives[1], 1.0, false);
    add("velocity_ref_rad_per_s", motor_speed, &drives[1], 1.0, false);
    add("position_rad", motor_speed, &drives[1], -1.0, true);
    const struct periodic_options options = {.input = "velocity_ref_rad_per_s", .settle = periodic_settle_given};
    struct direction direction;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &options, &recording, &error), error.message);
    TEST_ASSERT_TRUE(direction_measure(&recording, &direction));
    TEST_ASSERT_EQUAL_UINT(0, direction.count);
}

/// A rigid drive, lines `first` Hz to 100 Hz; the lag of a drive's bus: nothing true is accused, and nothing is said
/// of a narrow band, where a delay looks like a sign.
static void test_direction_tells_a_delay_from_a_sign(void)
{
    static const double delays_s[] = {0.0, 0.001, 0.003, 0.008, 0.02};
    for (size_t i = 0; i < sizeof delays_s / sizeof delays_s[0]; i++) {
        for (uint32_t first = 1; first <= 61; first += 10) {
            for (int sign = -1; sign <= 1; sign += 2) {
                const struct drive drive = {1.0, delays_s[i]};
                for (uint32_t k = first; k <= lines; k++) {
                    run.bins[k - first] = k;
                }
                run.bin_count = lines - first + 1;
                add("torque_Nm", NULL, &drive, 1.0, false);
                add("velocity_rad_per_s", rigid_speed, &drive, sign, false);
                const size_t found = measure(NULL).count;
                TEST_ASSERT_TRUE_MESSAGE(sign < 0 || found == 0, "a true sign is accused");
                TEST_ASSERT_TRUE_MESSAGE(first > 1 || sign > 0 || found == 1, "a reversed sign is missed");
                TEST_ASSERT_TRUE_MESSAGE(first < 21 || found == 0, "a narrow band tells a sign");
                tearDown();
                setUp();
            }
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_direction_tells_a_delay_from_a_sign);
    RUN_TEST(test_direction_says_nothing_where_all_is_right);
    RUN_TEST(test_direction_finds_a_motor_that_counts_against_the_torque);
    RUN_TEST(test_direction_takes_the_column_that_lags_less);
    RUN_TEST(test_direction_finds_a_position_that_counts_against_the_speed);
    RUN_TEST(test_direction_finds_a_load_that_counts_against_the_motor);
    RUN_TEST(test_direction_asks_nothing_of_a_response_to_a_set_point);
    return UNITY_END();
}
