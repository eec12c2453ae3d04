/* SPDX-License-Identifier: MIT */
/// What may hide between two lines: held against resonances that are hidden there.
#include "lab/numeric/statistics.h"
#include "lab/tune/gap.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { lines_max = 4000, campaign_seed = 7, pairs = 3000 };

static const double pi = 3.141592653589793, damping_least = 0.01;

static double frequency_hz[lines_max];
static double complex response[lines_max];
static struct tune_plant plant;

void setUp(void)
{
    plant = (struct tune_plant){.frequency_hz = frequency_hz, .rate_hz = 10000.0};
}

void tearDown(void) {}

/// A pole pair and the zero pair below it.
struct pair {
    double hz, distance, damping; ///< distance: (fp^2 - fz^2)/fp^2
};

static double complex pair_at(const struct pair *pair, double f)
{
    const double p2 = pair->hz * pair->hz, z2 = p2 * (1.0 - pair->distance);
    return (z2 - f * f + 2.0 * I * pair->damping * sqrt(z2) * f) / z2 * p2 /
           (p2 - f * f + 2.0 * I * pair->damping * pair->hz * f);
}

/// An inertia with 1 ms of delay, alone or with a pair.
static void fill(const struct pair *pair)
{
    for (size_t k = 0; k < plant.count; k++) {
        const double f = frequency_hz[k];
        response[k] = 30.0 / (I * f) * cexp(-2.0 * pi * I * f * 1e-3) * (pair ? pair_at(pair, f) : 1.0);
    }
}

static void take_ratio(double first_hz, double ratio, size_t count)
{
    plant.count = count;
    for (size_t k = 0; k < count; k++)
        frequency_hz[k] = first_hz * pow(ratio, (double)k);
}

static double uniform(struct random *random, double low, double high)
{
    return low + (high - low) * random_uniform(random);
}

/// A pair between two lines raises the loop by d/(2 zeta). The rise that is said is at least that, less a tenth and
/// 1 dB for what a pair does to the trend beside it.
static void test_tune_gap_rise_covers_hidden_resonances(void)
{
    const double share = 0.9, less = 0.15;
    struct random random;
    size_t large = 0;
    double least = INFINITY;
    random_seed(&random, campaign_seed);
    for (int i = 0; i < pairs; i++) {
        const double ratio = uniform(&random, 1.02, 3.0);
        take_ratio(10.0, ratio, 12);
        const double low = frequency_hz[5], high = frequency_hz[6];
        const double zero_hz = uniform(&random, low, high), pole_hz = uniform(&random, zero_hz, high);
        const struct pair pair = {pole_hz, 1.0 - zero_hz * zero_hz / (pole_hz * pole_hz), damping_least};
        const double raises = fmin(pair.distance / (2.0 * damping_least), 31.6);
        fill(&pair);
        const struct gap gap = gap_look(&plant, response, response, 5);
        char which[160];
        snprintf(which, sizeof which,
                 "seed %d, pair %d: lines %g and %g Hz, zeros %g, poles %g Hz: raises by %g, said %g",
                 (int)campaign_seed, i, low, high, zero_hz, pole_hz, raises, gap.rise);
        least = raises > 1.0 ? fmin(least, gap.rise / raises) : least;
        TEST_ASSERT_TRUE_MESSAGE(gap.rise >= share * raises - less, which);
        large += raises > 3.0;
    }
    printf("of %d hidden pairs %zu raise the loop by more than 10 dB; least said over true above 6 dB %.3f\n",
           (int)pairs, large, least);
    TEST_ASSERT_TRUE(large > pairs / 10);
}

/// Without a pair lines up to a factor 1.3 apart hide little, at a loop's crossover too.
static void test_tune_gap_rise_is_small_on_usual_grids(void)
{
    static const double ratios[] = {1.02, 1.05, 1.1, 1.2, 1.3};
    for (size_t i = 0; i < sizeof ratios / sizeof *ratios; i++) {
        struct gap gap;
        take_ratio(1.0, ratios[i], (size_t)(log(400.0) / log(ratios[i])));
        fill(NULL);
        const size_t count = gap_find_worst(&plant, response, response, &gap); // crosses 0 dB at 30 Hz
        printf("ratio %.2f: rise over reach at most %.3f\n", ratios[i], gap.rise / gap.reach);
        TEST_ASSERT_EQUAL_size_t(0, count);
    }
}

static void test_tune_gap_is_found_where_lines_are_missing(void)
{
    static const struct {
        double low_hz, high_hz;
        size_t count;
    } cases[] = {{29.0, 31.0, 0}, {28.0, 33.0, 0}, {20.0, 45.0, 1}, {5.0, 15.0, 1}, {120.0, 300.0, 1}, {1.5, 2.5, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct gap gap;
        plant.count = 0;
        for (size_t k = 1; k <= 400; k++)
            if ((double)k <= cases[i].low_hz || (double)k >= cases[i].high_hz)
                frequency_hz[plant.count++] = (double)k;
        fill(NULL);
        TEST_ASSERT_EQUAL_size_t(cases[i].count, gap_find_worst(&plant, response, response, &gap));
        if (cases[i].count == 1)
            TEST_ASSERT_EQUAL_DOUBLE(cases[i].low_hz, frequency_hz[gap.line]);
    }
}

/// 30 dB away from 0 dB, on either side, a gap of any width is no matter.
static void test_tune_gap_is_no_matter_30_db_away(void)
{
    static const double gains[] = {1.0 / 40.0, 40.0}, near[] = {1.0 / 20.0, 20.0};
    struct gap gap;
    plant.count = 0;
    for (size_t k = 1; k <= 100; k++)
        if (k <= 10 || k >= 50)
            frequency_hz[plant.count++] = (double)k;
    fill(NULL);
    for (size_t i = 0; i < 2; i++) {
        double complex loop[100];
        for (size_t k = 0; k < plant.count; k++)
            loop[k] = -I * gains[i];
        TEST_ASSERT_EQUAL_size_t(0, gap_find_worst(&plant, response, loop, &gap));
        for (size_t k = 0; k < plant.count; k++)
            loop[k] = -I * near[i];
        TEST_ASSERT_EQUAL_size_t(1, gap_find_worst(&plant, response, loop, &gap));
    }
}

/// Odd lines begin a factor 3 apart. Above 0 dB and before -180 degrees that is let pass; behind -180 it is not.
static void test_tune_gap_lets_the_lower_end_of_a_grid_pass(void)
{
    struct gap gap;
    double complex loop[200];
    plant.count = 200;
    for (size_t k = 0; k < plant.count; k++)
        frequency_hz[k] = 1.0 + 2.0 * (double)k;
    fill(NULL);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 11.0, gap_lower_end_hz(&plant));
    for (size_t k = 0; k < plant.count; k++)
        loop[k] = response[k] * 0.7; // |L| 21 dB at 1 Hz, where only 26 dB would do
    TEST_ASSERT_EQUAL_size_t(0, gap_find_worst(&plant, response, loop, &gap));
    for (size_t k = 0; k < plant.count; k++)
        loop[k] *= -I * 0.999; // an integrator more
    loop[0] *= cexp(-0.1 * I);
    TEST_ASSERT_TRUE(gap_find_worst(&plant, response, loop, &gap) >= 1);
    TEST_ASSERT_EQUAL_DOUBLE(1.0, frequency_hz[gap.line]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_tune_gap_rise_covers_hidden_resonances);
    RUN_TEST(test_tune_gap_rise_is_small_on_usual_grids);
    RUN_TEST(test_tune_gap_is_found_where_lines_are_missing);
    RUN_TEST(test_tune_gap_is_no_matter_30_db_away);
    RUN_TEST(test_tune_gap_lets_the_lower_end_of_a_grid_pass);
    return UNITY_END();
}
