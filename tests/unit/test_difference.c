/* SPDX-License-Identifier: MIT */
/// How far two responses are from each other, on made-up responses: lab/estimate/difference.h.
#include "lab/estimate/difference.h"

#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { lines = 400, trials = 60, dof = 10 };

/// Of 24 000 lines of chance 3.0 %: three standard deviations, and as much for what neighbours in a trial share.
static const double share_tolerance = 0.005;
static const double rounding = 1e-12;

static struct frf first, other;
static struct error error;

static void make(struct frf *out)
{
    TEST_ASSERT_EQUAL(0, frf_alloc(out, lines, &error));
    for (size_t k = 0; k < lines; k++) {
        out->frequency_hz[k] = 1.0 + (double)k;
        out->real[k] = 2.0;
        out->std[k] = 0.1;
        out->valid[k] = true;
    }
    out->degrees_of_freedom = dof;
}

void setUp(void)
{
    make(&first);
    make(&other);
}

void tearDown(void)
{
    frf_free(&first);
    frf_free(&other);
}

static void test_difference_is_over_two_std_of_both(void)
{
    double over_two_std[lines];
    struct difference difference;
    other.imag[7] = 0.5;
    other.std[7] = 0.2;
    TEST_ASSERT_TRUE(difference_measure(&first, &other, over_two_std, &difference));
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 0.25 / sqrt(0.05), over_two_std[7]);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, over_two_std[8]);
    TEST_ASSERT_EQUAL_size_t(lines, difference.common);
    TEST_ASSERT_EQUAL_size_t(1, difference.beyond);
    TEST_ASSERT_EQUAL_DOUBLE(8.0, difference.worst_hz);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, difference.middle_db);
}

/* Clocks apart by 1e-5, other lines in between, lines that are not valid on one side, no std on one side. */
static void test_difference_compares_only_what_both_have(void)
{
    double over_two_std[lines];
    struct difference difference;
    for (size_t k = 0; k < lines; k++) {
        other.frequency_hz[k] = (1.0 + (double)k) * (1.0 + 1e-5) + (k % 2 == 1 ? 0.4 : 0.0);
        other.real[k] = 4.0;
    }
    first.valid[0] = other.valid[2] = false;
    other.std[4] = FRF_UNKNOWN;
    TEST_ASSERT_TRUE(difference_measure(&first, &other, over_two_std, &difference));
    TEST_ASSERT_EQUAL_size_t(lines / 2 - 2, difference.common);
    TEST_ASSERT_EQUAL_size_t(lines / 2 - 3, difference.compared);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 20.0 * log10(2.0), difference.middle_db);
    TEST_ASSERT_TRUE(isnan(over_two_std[0]) && isnan(over_two_std[1]) && isnan(over_two_std[2]) &&
                     isnan(over_two_std[4]) && over_two_std[6] > 1.0);
}

static void test_difference_without_common_lines_or_std_says_so(void)
{
    char says[300];
    struct difference difference;
    for (size_t k = 0; k < lines; k++) {
        other.std[k] = FRF_UNKNOWN;
    }
    TEST_ASSERT_TRUE(difference_measure(&first, &other, NULL, &difference));
    difference_say(&difference, "a.csv", says, sizeof says);
    TEST_ASSERT_NOT_NULL(strstr(says, "without standard deviations"));
    for (size_t k = 0; k < lines; k++) {
        other.frequency_hz[k] += 0.5;
    }
    TEST_ASSERT_TRUE(difference_measure(&first, &other, NULL, &difference));
    difference_say(&difference, "a.csv", says, sizeof says);
    TEST_ASSERT_EQUAL_STRING("has no line in common with a.csv.", says);
}

/* Two noisy measurements of one response, their std estimated from as many degrees of freedom as they say. */
static void test_difference_of_equal_drives_is_beyond_as_often_as_said(void)
{
    struct random random;
    struct frf *both[2] = {&first, &other};
    size_t beyond = 0;
    struct difference difference;
    random_seed(&random, 5);
    for (int trial = 0; trial < trials; trial++) {
        for (size_t k = 0; k < lines; k++) {
            for (int side = 0; side < 2; side++) {
                double sum = 0.0;
                for (int d = 0; d < dof; d++) {
                    const double normal = random_normal(&random);
                    sum += normal * normal;
                }
                both[side]->real[k] = 2.0 + sqrt(0.5) * 0.1 * random_normal(&random);
                both[side]->imag[k] = sqrt(0.5) * 0.1 * random_normal(&random);
                both[side]->std[k] = 0.1 * sqrt(sum / dof);
            }
        }
        TEST_ASSERT_TRUE(difference_measure(&first, &other, NULL, &difference));
        beyond += difference.beyond;
    }
    TEST_ASSERT_DOUBLE_WITHIN(share_tolerance, difference.chance, (double)beyond / (trials * lines));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_difference_is_over_two_std_of_both);
    RUN_TEST(test_difference_compares_only_what_both_have);
    RUN_TEST(test_difference_without_common_lines_or_std_says_so);
    RUN_TEST(test_difference_of_equal_drives_is_beyond_as_often_as_said);
    return UNITY_END();
}
