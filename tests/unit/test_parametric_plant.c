/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_plant.h"

#include "lab/numeric/statistics.h"
#include "unity.h"

#include <math.h>

enum { lines = 80 };

static const double two_pi = 6.283185307179586476925;
static const double sample_rate_hz = 500.0;

/// Two masses: gain (s^2 + ...) / ((s + p) (s^2 + ...)).
static const double gain = 40.0, slow = 8.0;
static const double zero_hz = 30.0, zero_damping = 0.04, pole_hz = 45.0, pole_damping = 0.06;

static double frequency_hz[lines];
static double variance[lines];
static double complex output[lines];

void setUp(void) {}

void tearDown(void) {}

static double complex second_order(double complex s, double hz, double damping)
{
    double w = two_pi * hz;
    return s * s + 2.0 * damping * w * s + w * w;
}

/// Response to held input that comes `delay` samples late, by partial fractions.
static double complex held_response(double f, double delay)
{
    double w = two_pi * pole_hz;
    double complex pair = w * (-pole_damping + I * sqrt(1.0 - pole_damping * pole_damping));
    double complex poles[3] = {-slow, pair, conj(pair)};
    double complex z = cexp(I * two_pi * f / sample_rate_hz);
    double whole = floor(delay);
    double part = delay - whole;
    double complex sum = 0.0;
    for (size_t i = 0; i < 3; i++) {
        double complex s = poles[i];
        double complex below = 1.0;
        for (size_t j = 0; j < 3; j++) {
            below *= j == i ? 1.0 : s - poles[j];
        }
        double complex residue = gain * second_order(s, zero_hz, zero_damping) / below;
        double complex all = cexp(s / sample_rate_hz);
        double complex rest = cexp(s * (1.0 - part) / sample_rate_hz);
        sum += residue / s * ((rest - 1.0) + (all - rest) / z) / (z - all);
    }
    return sum / cpow(z, whole);
}

static struct parametric_model identify(double delay, size_t samples, size_t numerator_order, double noise,
                                        uint64_t seed)
{
    const struct parametric_structure structure = {.domain = parametric_discrete,
                                                   .numerator_order = numerator_order,
                                                   .denominator_order = 3,
                                                   .delay_s = (double)samples / sample_rate_hz};
    struct parametric_model model;
    struct error error = {0};
    struct random random;
    random_seed(&random, seed);
    for (size_t k = 0; k < lines; k++) {
        frequency_hz[k] = 2.0 * (double)(k + 1);
        variance[k] = 1e-6;
        double real = random_normal(&random);
        output[k] = held_response(frequency_hz[k], delay) + noise * (real + I * random_normal(&random));
    }
    const struct parametric_data data = {.name = "made",
                                         .count = lines,
                                         .frequency_hz = frequency_hz,
                                         .output = output,
                                         .output_variance = variance,
                                         .sample_rate_hz = sample_rate_hz};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parametric_fit(&data, &structure, NULL, &model, &error), error.message);
    return model;
}

/// Without noise all digits but those that rounding costs come back.
static void check_plant(const struct parametric_model *plant, double delay)
{
    const double share = 1e-6;
    TEST_ASSERT_EQUAL_INT(parametric_continuous, plant->structure.domain);
    TEST_ASSERT_EQUAL_size_t(2, plant->pole_count);
    TEST_ASSERT_DOUBLE_WITHIN(share * slow, slow, two_pi * plant->poles[0].frequency_hz);
    TEST_ASSERT_DOUBLE_WITHIN(share * pole_hz, pole_hz, plant->poles[1].frequency_hz);
    TEST_ASSERT_DOUBLE_WITHIN(share, pole_damping, plant->poles[1].damping);
    TEST_ASSERT_EQUAL_size_t(1, plant->zero_count);
    TEST_ASSERT_DOUBLE_WITHIN(share * zero_hz, zero_hz, plant->zeros[0].frequency_hz);
    TEST_ASSERT_DOUBLE_WITHIN(share, zero_damping, plant->zeros[0].damping);
    TEST_ASSERT_DOUBLE_WITHIN(share, delay, plant->delay_s * sample_rate_hz);
    double at_zero = gain * creal(second_order(0.0, zero_hz, zero_damping)) /
                     (slow * creal(second_order(0.0, pole_hz, pole_damping)));
    TEST_ASSERT_DOUBLE_WITHIN(share * at_zero, at_zero, plant->dc_gain);
}

static void test_parametric_plant_is_the_drive_without_its_hold(void)
{
    for (size_t samples = 0; samples < 3; samples++) {
        struct parametric_model model = identify((double)samples, samples + 1, 2, 0.0, 1);
        struct parametric_model plant;
        TEST_ASSERT_TRUE(parametric_plant_of(&model, &plant));
        TEST_ASSERT_FALSE(plant.structure.delay_free);
        check_plant(&plant, (double)samples);
    }
}

static void test_parametric_plant_has_the_part_of_a_sample_that_it_is_late(void)
{
    for (double delay = 0.1; delay < 2.0; delay += 0.3) {
        struct parametric_model model = identify(delay, (size_t)floor(delay) + 1, 3, 0.0, 1);
        struct parametric_model plant;
        TEST_ASSERT_TRUE(parametric_plant_of(&model, &plant));
        TEST_ASSERT_TRUE(plant.structure.delay_free);
        check_plant(&plant, delay);
    }
}

/// 200 draws of noise: the scatter of a standard deviation from 200 is 5 %, four of them are allowed.
static void test_parametric_plant_knows_how_sure_it_is(void)
{
    enum { draws = 200 };
    double frequency = 0.0, damping = 0.0, delay = 0.0;
    for (uint64_t seed = 1; seed <= draws; seed++) {
        struct parametric_model model = identify(0.4, 1, 3, sqrt(0.5e-6), seed);
        struct parametric_model plant;
        TEST_ASSERT_TRUE(parametric_plant_of(&model, &plant));
        frequency += pow((plant.zeros[0].frequency_hz - zero_hz) / plant.zeros[0].frequency_std_hz, 2.0) / draws;
        damping += pow((plant.zeros[0].damping - zero_damping) / plant.zeros[0].damping_std, 2.0) / draws;
        delay += pow((plant.delay_s - 0.4 / sample_rate_hz) / plant.delay_std_s, 2.0) / draws;
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.2, 1.0, sqrt(frequency));
    TEST_ASSERT_DOUBLE_WITHIN(0.2, 1.0, sqrt(damping));
    TEST_ASSERT_DOUBLE_WITHIN(0.2, 1.0, sqrt(delay));
}

/// A pole at a negative z rings from sample to sample, as no drive behind a hold does.
static void test_parametric_plant_refuses_what_has_no_logarithm(void)
{
    struct parametric_model plant;
    struct parametric_model model = {.structure = {.domain = parametric_discrete,
                                                   .numerator_order = 1,
                                                   .numerator_lowest = 1,
                                                   .denominator_order = 1},
                                     .sample_rate_hz = sample_rate_hz,
                                     .numerator = {0.0, 1.0},
                                     .denominator = {1.0, 0.5},
                                     .unknowns = 3};
    TEST_ASSERT_FALSE(parametric_plant_of(&model, &plant));
    model.denominator[1] = -0.5;
    TEST_ASSERT_TRUE(parametric_plant_of(&model, &plant));
    model.structure.domain = parametric_continuous;
    TEST_ASSERT_FALSE(parametric_plant_of(&model, &plant));
    TEST_ASSERT_EQUAL_size_t(0, plant.unknowns);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_parametric_plant_is_the_drive_without_its_hold);
    RUN_TEST(test_parametric_plant_has_the_part_of_a_sample_that_it_is_late);
    RUN_TEST(test_parametric_plant_knows_how_sure_it_is);
    RUN_TEST(test_parametric_plant_refuses_what_has_no_logarithm);
    return UNITY_END();
}
