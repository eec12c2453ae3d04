/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/judge.h"
#include "sim/effect.h"
#include "unity.h"

#include <math.h>
#include <string.h>

void setUp(void) {}

void tearDown(void) {}

static bool is_vague(const char *id, const double *values, const double *deviations)
{
    const double nominal[sim_effect_parameters_max] = {0.0};
    return judge_is_vague(sim_effects[sim_effect_find(id)], values, deviations, nominal);
}

static void test_judge_size_within_two_deviations_of_nothing_is_vague(void)
{
    TEST_ASSERT_TRUE(is_vague("viscous_friction", (double[]){0.0139}, (double[]){0.058}));
    TEST_ASSERT_TRUE(is_vague("viscous_friction", (double[]){0.0139}, (double[]){0.0070}));
    TEST_ASSERT_FALSE(is_vague("viscous_friction", (double[]){0.0139}, (double[]){0.0069}));
    TEST_ASSERT_TRUE(is_vague("load_bias", (double[]){-0.01}, (double[]){0.02}));
    TEST_ASSERT_FALSE(is_vague("load_bias", (double[]){-0.01}, (double[]){0.001}));
    TEST_ASSERT_FALSE(is_vague("load_bias", (double[]){-0.01}, (double[]){0.0}));
}

static void test_judge_size_is_compared_with_that_of_the_given_model(void)
{
    const struct sim_effect *effect = sim_effects[sim_effect_find("viscous_friction")];
    TEST_ASSERT_TRUE(judge_is_vague(effect, (double[]){0.012}, (double[]){0.002}, (double[]){0.010}));
    TEST_ASSERT_FALSE(judge_is_vague(effect, (double[]){0.015}, (double[]){0.002}, (double[]){0.010}));
}

/// How often a ripple repeats is known better than how large it is; one certain number is enough elsewhere.
static void test_judge_size_of_a_ripple_is_its_amplitude(void)
{
    TEST_ASSERT_TRUE(is_vague("cogging", (double[]){0.01, 12.0, 0.3}, (double[]){0.008, 0.001, 0.9}));
    TEST_ASSERT_FALSE(is_vague("cogging", (double[]){0.01, 12.0, 0.3}, (double[]){0.001, 0.001, 0.1}));
    TEST_ASSERT_FALSE(is_vague("stribeck_friction", (double[]){5.0, 9.28}, (double[]){1.0, 38.0}));
    TEST_ASSERT_TRUE(is_vague("stribeck_friction", (double[]){5.0, 9.28}, (double[]){4.0, 38.0}));
    // How friction builds up is certain of a distance that is not.
    TEST_ASSERT_TRUE(is_vague("presliding", (double[]){1e-3, 0.9}, (double[]){1e-3, 0.1}));
}

static void test_judge_noise_larger_than_the_torque_lets_no_name_stand(void)
{
    struct judgement judgement = {.count = 1, .stands = {[3] = true}};
    TEST_ASSERT_TRUE(judge_distance(15.0, 27.0, &judgement));
    TEST_ASSERT_TRUE(judgement.unexplained);
    TEST_ASSERT_EQUAL_UINT(0, judgement.count);
    TEST_ASSERT_FALSE(judgement.stands[3]);
    TEST_ASSERT_NOT_NULL(strstr(judgement.where, "27 times the measured torque"));
}

static void test_judge_error_far_above_the_noise_is_not_explained(void)
{
    struct judgement judgement = {.count = 1, .stands = {[3] = true}};
    TEST_ASSERT_FALSE(judge_distance(0.11, 0.03, &judgement));
    TEST_ASSERT_FALSE(judge_distance(0.09, 0.001, &judgement));
    TEST_ASSERT_FALSE(judgement.unexplained);
    TEST_ASSERT_TRUE(judge_distance(0.2, 0.04, &judgement));
    TEST_ASSERT_TRUE(judgement.unexplained);
    TEST_ASSERT_TRUE(judgement.stands[3]);
}

static void test_judge_torque_that_noise_does_not_make_is_astray(void)
{
    TEST_ASSERT_TRUE(judge_is_astray(0.0179, 0.0101));
    TEST_ASSERT_FALSE(judge_is_astray(0.0123, 0.0101)); // less than a quarter more
    TEST_ASSERT_TRUE(judge_is_astray(0.0127, 0.0101 - 1e-6));
    TEST_ASSERT_FALSE(judge_is_astray(0.0029, 0.0018)); // beyond the noise less than a name is worth
    TEST_ASSERT_FALSE(judge_is_astray(NAN, 0.01));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_judge_size_within_two_deviations_of_nothing_is_vague);
    RUN_TEST(test_judge_size_is_compared_with_that_of_the_given_model);
    RUN_TEST(test_judge_size_of_a_ripple_is_its_amplitude);
    RUN_TEST(test_judge_noise_larger_than_the_torque_lets_no_name_stand);
    RUN_TEST(test_judge_error_far_above_the_noise_is_not_explained);
    RUN_TEST(test_judge_torque_that_noise_does_not_make_is_astray);
    return UNITY_END();
}
