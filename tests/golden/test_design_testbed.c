/* SPDX-License-Identifier: MIT */
/// The testbed of the first paper, from the command line to the written CSV, which is judged by sums of its own.
/// Published: standard clipping 0.632 Nm, modified clipping 0.692 Nm, L-infinity 0.723 Nm; the reference implementation
/// of the same equations gives 0.6332, 0.6934 and 0.7225 (limits at the samples, 200 lines 0.5 .. 100 Hz, 1 kHz, 2 s).
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { samples = 2000, lines = 200, between = 16, columns = 5 };

static const double two_pi = 6.283185307179586;
static const double inertia_kgm2 = 0.00516;
static const double torque_limit_Nm = 1;
static const double velocity_limit_rad_per_s = 0.05 / 0.0159;

/// A number in the CSV has at least nine digits.
static const double printed = 1e-8;

static double column[columns][samples]; ///< n, torque, position, velocity, acceleration
static double cosine_of[lines];         ///< position spectrum, from the CSV
static double sine_of[lines];

void setUp(void) {}

void tearDown(void) {}

static void design(const char *options)
{
    char command[1000];
    const char *program = getenv("SERVOSCOPE");
    TEST_ASSERT_NOT_NULL_MESSAGE(program, "SERVOSCOPE, the path of the program, is not set");
    snprintf(command, sizeof command,
             "'%s' design --quiet --rate 1000 --period 2000 --lines linear:0.5:100:0.5 --limit-torque 1 "
             "--inertia 0.00516 --limit-velocity-m-per-s 0.05 --pulley-radius 0.0159 --out testbed %s",
             program, options);
    remove("testbed.csv");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, system(command), command);
}

static void read_csv(void)
{
    char *line = NULL;
    size_t capacity = 0; // the key excited_bins makes a long line
    int row = -1;
    FILE *stream = fopen("testbed.csv", "r");
    TEST_ASSERT_NOT_NULL(stream);
    while (getline(&line, &capacity, stream) >= 0) {
        if (line[0] == '#') {
            continue;
        }
        if (row < 0) {
            TEST_ASSERT_EQUAL_STRING("n,torque_Nm,position_rad,velocity_rad_per_s,acceleration_rad_per_s2\n", line);
        } else {
            TEST_ASSERT_LESS_THAN_INT(samples, row);
            TEST_ASSERT_EQUAL_INT(5, sscanf(line, "%lf,%lf,%lf,%lf,%lf", &column[0][row], &column[1][row],
                                            &column[2][row], &column[3][row], &column[4][row]));
            TEST_ASSERT_EQUAL_DOUBLE(row, column[0][row]);
        }
        row++;
    }
    free(line);
    fclose(stream);
    TEST_ASSERT_EQUAL_INT(samples, row);
}

/// DFT of the position at the excited lines.
static void analyse(void)
{
    for (int k = 0; k < lines; k++) {
        cosine_of[k] = 0;
        sine_of[k] = 0;
        for (int n = 0; n < samples; n++) {
            double angle = two_pi * ((long)(k + 1) * n % samples) / samples;
            cosine_of[k] += 2.0 / samples * column[2][n] * cos(angle);
            sine_of[k] += 2.0 / samples * column[2][n] * sin(angle);
        }
    }
}

/// Position, velocity and acceleration at time t from the position's spectrum.
static void evaluate(double t, double out_q[3])
{
    out_q[0] = out_q[1] = out_q[2] = 0;
    for (int k = 0; k < lines; k++) {
        double w = two_pi * 0.5 * (k + 1);
        double c = cos(w * t);
        double s = sin(w * t);
        out_q[0] += cosine_of[k] * c + sine_of[k] * s;
        out_q[1] += w * (sine_of[k] * c - cosine_of[k] * s);
        out_q[2] -= w * w * (cosine_of[k] * c + sine_of[k] * s);
    }
}

/// Nothing but the 200 lines is in the position, and the other columns are its derivatives and J times the second.
static void check_columns_belong_together(void)
{
    for (int n = 0; n < samples; n++) {
        double q[3];
        evaluate(n * 0.001, q);
        TEST_ASSERT_DOUBLE_WITHIN(printed, q[0], column[2][n]);
        TEST_ASSERT_DOUBLE_WITHIN(printed * two_pi * 100, q[1], column[3][n]);
        TEST_ASSERT_DOUBLE_WITHIN(printed * two_pi * two_pi * 1e4, q[2], column[4][n]);
        TEST_ASSERT_DOUBLE_WITHIN(printed * 10, inertia_kgm2 * column[4][n], column[1][n]);
    }
}

/// Each line alone reaches one limit: below fc = 9.81 Hz amplitudes go with 1 / f, above with 1 / f^2.
static void check_amplitudes(void)
{
    double scale = 0;
    for (int k = 0; k < lines; k++) {
        double w = two_pi * 0.5 * (k + 1);
        double alone = fmin(velocity_limit_rad_per_s / w, torque_limit_Nm / inertia_kgm2 / (w * w));
        double ratio = hypot(cosine_of[k], sine_of[k]) / alone;
        scale = k == 0 ? ratio : scale;
        TEST_ASSERT_DOUBLE_WITHIN(1e-4 * scale, scale, ratio);
    }
}

static double largest(const double *values)
{
    double peak = 0;
    for (int n = 0; n < samples; n++) {
        peak = fmax(peak, fabs(values[n]));
    }
    return peak;
}

static double effective_torque(void)
{
    double sum = 0;
    for (int n = 0; n < samples; n++) {
        sum += column[1][n] * column[1][n];
    }
    return sqrt(sum / samples);
}

static double judge_samples(const char *options)
{
    design(options);
    read_csv();
    analyse();
    check_columns_belong_together();
    check_amplitudes();
    double used = fmax(largest(column[1]) / torque_limit_Nm, largest(column[3]) / velocity_limit_rad_per_s);
    TEST_ASSERT_TRUE(used <= 1 + printed);
    TEST_ASSERT_TRUE(used > 0.9999); // and one limit is reached
    printf("%-52s effective %.4f Nm, largest use of a limit %.6f\n", options, effective_torque(), used);
    return effective_torque();
}

static void test_testbed_standard_clipping_by_all_limits(void)
{
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.633, judge_samples("--grid samples --method clip --keep all"));
}

static void test_testbed_standard_clipping_by_acceleration(void)
{
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.5696, judge_samples("--grid samples --method clip --keep acceleration"));
}

static void test_testbed_modified_clipping(void)
{
    TEST_ASSERT_DOUBLE_WITHIN(0.001, 0.6934, judge_samples("--grid samples --method mca"));
}

/// Good local optima, wherever they are started from, lie in this band; the reference implementation's is 0.7225.
static void test_testbed_linf(void)
{
    double effective_Nm = judge_samples("--grid samples --method linf");
    TEST_ASSERT_TRUE(effective_Nm >= 0.718);
    TEST_ASSERT_TRUE(effective_Nm <= 0.727);
}

static void test_testbed_newman_phases(void)
{
    TEST_ASSERT_DOUBLE_WITHIN(0.0005, 0.5692, judge_samples("--grid samples --method newman"));
}

/// One start without randomness; the band of local optima is 0.718 .. 0.730.
static void test_testbed_fast_single_start(void)
{
    TEST_ASSERT_TRUE(judge_samples("--grid samples --method fast --starts 1") >= 0.7195);
}

/// The best of its own number of starts; 130 seeds lay in 0.7254 .. 0.7302.
static void test_testbed_fast(void)
{
    TEST_ASSERT_TRUE(judge_samples("--grid samples --method fast") >= 0.7235);
}

/// The default holds the limits at every instant: looked at here on 16 points per sample, from the CSV's spectrum.
static void test_testbed_default_holds_limits_between_the_samples(void)
{
    design("");
    read_csv();
    analyse();
    check_columns_belong_together();
    double used = 0;
    for (int n = 0; n < samples * between; n++) {
        double q[3];
        evaluate(n * 0.001 / between, q);
        used = fmax(used, fmax(fabs(q[1]) / velocity_limit_rad_per_s, fabs(q[2]) * inertia_kgm2 / torque_limit_Nm));
    }
    printf("%-52s effective %.4f Nm, largest use of a limit %.6f between the samples\n", "(default)",
           effective_torque(), used);
    TEST_ASSERT_TRUE(used <= 1);
    TEST_ASSERT_TRUE(used > 0.999);
    TEST_ASSERT_TRUE(effective_torque() >= 0.715); // 1 kHz L-infinity scaled down until it holds: 0.696
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_testbed_standard_clipping_by_all_limits);
    RUN_TEST(test_testbed_standard_clipping_by_acceleration);
    RUN_TEST(test_testbed_modified_clipping);
    RUN_TEST(test_testbed_linf);
    RUN_TEST(test_testbed_newman_phases);
    RUN_TEST(test_testbed_fast_single_start);
    RUN_TEST(test_testbed_fast);
    RUN_TEST(test_testbed_default_holds_limits_between_the_samples);
    return UNITY_END();
}
