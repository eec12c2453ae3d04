/* SPDX-License-Identifier: MIT */
#include "lab/estimate/excitation.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

enum { most_lines = 60, length = 500, draws = 200 };

void setUp(void) {}

void tearDown(void) {}

/// Unit lines on bins 3, 6, 9, ... with phases by `seed`, begun `shift` samples late, `level` as strong, with noise of
/// this RMS in each line's mean.
static struct excitation make(size_t lines, uint64_t seed, double shift, double level, double noise,
                              uint64_t noise_seed)
{
    struct random random;
    struct random noises;
    struct excitation self = {.period_samples = length, .count = lines};
    self.bins = malloc(lines * sizeof *self.bins);
    self.mean = malloc(lines * sizeof *self.mean);
    self.noise = noise * noise * (double)lines;
    random_seed(&random, seed);
    random_seed(&noises, noise_seed);
    for (size_t k = 0; k < lines; k++) {
        self.bins[k] = (uint32_t)(3 * (k + 1));
        const double phase = two_pi * (random_uniform(&random) - (double)self.bins[k] * shift / length);
        const double complex error = CMPLX(random_normal(&noises), random_normal(&noises)) * sqrt(0.5);
        self.mean[k] = level * cexp(I * phase) + noise * error;
    }
    return self;
}

static enum excitation_match compare(struct excitation a, struct excitation b, double *out_level)
{
    enum excitation_match match;
    TEST_ASSERT_TRUE(excitation_compare(&a, &b, &match, out_level));
    excitation_free(&a);
    excitation_free(&b);
    return match;
}

/// Few lines say nothing through the last one's noise.
static const size_t line_counts[] = {6, 12, most_lines};
static const double noises[] = {0.0, 0.05, 0.2};

/// Same phases, begun at any sample and between samples, are recognised through noise.
static void test_excitation_same_phases_are_recognised(void)
{
    for (size_t l = 0; l < sizeof line_counts / sizeof line_counts[0]; l++) {
        for (size_t n = 0; n < sizeof noises / sizeof noises[0] - (line_counts[l] <= 12); n++) {
            for (uint64_t seed = 1; seed <= draws; seed++) {
                double level;
                char text[80];
                const double shift = 7.3 * (double)seed;
                snprintf(text, sizeof text, "%zu lines, noise %g, seed %d", line_counts[l], noises[n], (int)seed);
                TEST_ASSERT_EQUAL_INT_MESSAGE(excitation_same,
                                              compare(make(line_counts[l], seed, 0.0, 1.0, noises[n], 2 * seed),
                                                      make(line_counts[l], seed, shift, 1.0, noises[n], 2 * seed + 1),
                                                      &level),
                                              text);
            }
        }
    }
}

/// Other phases are told apart, however they are shifted.
static void test_excitation_other_phases_are_told_apart(void)
{
    for (size_t l = 0; l < sizeof line_counts / sizeof line_counts[0]; l++) {
        for (size_t n = 0; n < sizeof noises / sizeof noises[0] - (line_counts[l] <= 12); n++) {
            for (uint64_t seed = 1; seed <= draws; seed++) {
                double level;
                char text[80];
                snprintf(text, sizeof text, "%zu lines, noise %g, seed %d", line_counts[l], noises[n], (int)seed);
                TEST_ASSERT_EQUAL_INT_MESSAGE(excitation_other,
                                              compare(make(line_counts[l], seed, 0.0, 1.0, noises[n], 2 * seed),
                                                      make(line_counts[l], seed + 5000, 0.0, 1.0, noises[n], 3 * seed),
                                                      &level),
                                              text);
            }
        }
    }
}

static void test_excitation_other_level_is_said(void)
{
    double level;
    TEST_ASSERT_EQUAL_INT(excitation_other_level,
                          compare(make(20, 1, 0.0, 1.0, 0.01, 1), make(20, 1, 11.0, 0.5, 0.01, 2), &level));
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.5, level);
}

/// A shift alone brings few lines together, and noise hides phases: a table's checksum decides, or nothing.
static void test_excitation_without_evidence_is_unknown_but_for_the_table(void)
{
    double level;
    TEST_ASSERT_EQUAL_INT(excitation_unknown,
                          compare(make(5, 1, 0.0, 1.0, 0.0, 1), make(5, 1, 0.0, 1.0, 0.0, 2), &level));
    TEST_ASSERT_EQUAL_INT(excitation_unknown,
                          compare(make(20, 1, 0.0, 1.0, 0.5, 1), make(20, 1, 0.0, 1.0, 0.5, 2), &level));
    TEST_ASSERT_EQUAL_INT(excitation_unknown,
                          compare(make(20, 1, 0.0, 1.0, 0.0, 1), make(19, 1, 0.0, 1.0, 0.0, 2), &level));
    struct excitation a = make(1, 1, 0.0, 1.0, 0.0, 1);
    struct excitation b = make(1, 2, 0.0, 1.0, 0.0, 2);
    a.has_table_crc32 = b.has_table_crc32 = true;
    a.table_crc32 = b.table_crc32 = 0x12345678;
    TEST_ASSERT_EQUAL_INT(excitation_same, compare(a, b, &level));
}

/// Of sequences any segment that can be compared decides.
static void test_excitations_of_segments_decide_together(void)
{
    struct excitations a = {0};
    struct excitations b = {0};
    enum excitation_match match;
    double level;
    for (uint64_t segment = 0; segment < 3; segment++) {
        const size_t lines = segment == 0 ? 1 : 10;
        struct excitation one = make(lines, segment + 1, 0.0, 1.0, 0.01, 1);
        struct excitation other = make(lines, segment + 1, 4.0, 1.0, 0.01, 2);
        TEST_ASSERT_TRUE(excitations_add(&a, &one) && excitations_add(&b, &other));
        TEST_ASSERT_EQUAL_size_t(0, one.count);
    }
    TEST_ASSERT_TRUE(excitations_compare(&a, &b, &match, &level));
    TEST_ASSERT_EQUAL_INT(excitation_same, match);
    struct excitation changed = make(10, 99, 0.0, 1.0, 0.01, 2);
    excitation_free(&b.items[2]);
    b.items[2] = changed;
    TEST_ASSERT_TRUE(excitations_compare(&a, &b, &match, &level));
    TEST_ASSERT_EQUAL_INT(excitation_other, match);
    excitations_free(&a);
    excitations_free(&b);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_excitation_same_phases_are_recognised);
    RUN_TEST(test_excitation_other_phases_are_told_apart);
    RUN_TEST(test_excitation_other_level_is_said);
    RUN_TEST(test_excitation_without_evidence_is_unknown_but_for_the_table);
    RUN_TEST(test_excitations_of_segments_decide_together);
    return UNITY_END();
}
