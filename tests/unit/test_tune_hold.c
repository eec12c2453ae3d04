/* SPDX-License-Identifier: MIT */
/// Responses carried over to a controller at another rate, against the same drive sampled at that rate from its
/// equations.
#include "lab/tune/hold.h"
#include "tests/support/known_drive.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/// What is left where every fold lies on a line: rounding of two matrix exponentials.
static const double rounding = 1e-9;

static struct frf frf;
static struct tune_plant plant;
static struct error error;

void setUp(void) {}

void tearDown(void)
{
    tune_plant_free(&plant);
    frf_free(&frf);
}

static struct known_drive drive_at(const char *name, double rate_hz, double delay_s)
{
    const size_t delay = (size_t)lround(delay_s * rate_hz);
    return strcmp(name, "rigid") == 0 ? known_rigid(rate_hz, delay, 0.005, 0.01)
                                      : known_two_mass(rate_hz, delay, 0.003, 0.002, 600.0, 0.05, 0.005);
}

/// P(j w), the drive without a hold: the state-space solution at z^-1 = 1/(j w) with the matrices before sampling.
static double complex unheld(const struct known_drive *drive, double frequency_hz)
{
    struct known_drive whole = *drive;
    memcpy(whole.Ad, drive->A, sizeof whole.Ad);
    memcpy(whole.Bd, drive->B, sizeof whole.Bd);
    whole.delay_samples = 0;
    const double w = known_two_pi * frequency_hz;
    return known_response(&whole, 1.0 / (I * w)) * cexp(-I * w * (double)drive->delay_samples / drive->rate_hz);
}

static void take(double rate_hz)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, tune_plant_take("f.csv", &frf, rate_hz, 0.0, &plant, &error), error.message);
}

/// The largest error against the drive at the controller's rate, up to a frequency, over what its inertia alone would
/// answer (at an antiresonance the response itself is next to nothing); counts lines whose error is more than their
/// doubt.
static double compare(const struct known_drive *exact, double up_to_hz, size_t *out_beyond_doubt)
{
    double worst = 0.0;
    *out_beyond_doubt = 0;
    for (size_t k = 0; k < plant.count; k++) {
        const double complex G = known_response(exact, plant.delay[k]);
        const double difference = cabs(plant.response[k] - G);
        *out_beyond_doubt += difference > plant.doubt[k] + rounding * cabs(G);
        const double inertia = 1.0 / (0.005 * known_two_pi * plant.frequency_hz[k]);
        worst = plant.frequency_hz[k] <= up_to_hz ? fmax(worst, difference / inertia) : worst;
    }
    return worst;
}

/// A whole number of times slower, and all lines there: exact, resonance or not.
static void test_tune_hold_of_a_slower_controller_is_exact(void)
{
    static const char *const names[] = {"rigid", "two-mass"};
    static const double rates[] = {2000.0, 1000.0, 800.0, 500.0};
    for (size_t i = 0; i < 2; i++)
        for (size_t r = 0; r < sizeof rates / sizeof *rates; r++) {
            const struct known_drive fast = drive_at(names[i], 4000.0, 0.01), slow = drive_at(names[i], rates[r], 0.01);
            size_t beyond;
            frf = known_frf(&fast, 1.0, 1.0, 1999);
            take(rates[r]);
            const double worst = compare(&slow, 2000.0, &beyond);
            printf("%s, 4000 to %g Hz: largest error %.2g\n", names[i], rates[r], worst);
            TEST_ASSERT_TRUE(worst < rounding);
            TEST_ASSERT_TRUE(plant.carried);
            TEST_ASSERT_EQUAL_size_t((size_t)(0.5 * rates[r]) - 1, plant.count);
            tearDown();
        }
}

/// The quotient of the holds alone would be off by this much: the test can tell.
static void test_tune_hold_of_a_slower_controller_is_more_than_a_quotient(void)
{
    const struct known_drive fast = drive_at("rigid", 4000.0, 0.0), slow = drive_at("rigid", 1000.0, 0.0);
    const double f = 250.0;
    const double complex G = known_response(&fast, cexp(-I * known_two_pi * f / 4000.0));
    const double x = 0.5 * known_two_pi * f;
    const double complex quotient = sin(x / 1000.0) / (4.0 * sin(x / 4000.0)) * cexp(-I * (x / 1000.0 - x / 4000.0));
    const double complex exact = known_response(&slow, cexp(-I * known_two_pi * f / 1000.0));
    TEST_ASSERT_TRUE(cabs(G * quotient / exact - 1.0) > 0.1);
}

/// Lines missing above: what they would have folded is doubt, and the error is within it.
static void test_tune_hold_of_a_slower_controller_knows_what_it_lacks(void)
{
    const struct known_drive fast = drive_at("two-mass", 4000.0, 0.001), slow = drive_at("two-mass", 1000.0, 0.001);
    size_t beyond;
    frf = known_frf(&fast, 1.0, 1.0, 599);
    take(1000.0);
    const double worst = compare(&slow, 500.0, &beyond);
    TEST_ASSERT_TRUE(worst > 0.01);
    TEST_ASSERT_EQUAL_size_t(0, beyond);
    TEST_ASSERT_TRUE(plant.doubt[400] > 0.0 && plant.doubt[400] < 0.5 * cabs(plant.response[400]));
}

/// Faster, or not a whole number of times slower: as far as the doubt goes, which is small where loops are closed.
static void test_tune_hold_of_other_rates_is_within_its_doubt(void)
{
    static const char *const names[] = {"rigid", "two-mass"};
    static const struct {
        double from_hz, to_hz;
    } rates[] = {{1000.0, 4000.0}, {1000.0, 8000.0}, {1000.0, 2000.0}, {3000.0, 2000.0}, {5000.0, 2000.0}};
    for (size_t i = 0; i < 2; i++)
        for (size_t r = 0; r < sizeof rates / sizeof *rates; r++) {
            const double slower_hz = fmin(rates[r].from_hz, rates[r].to_hz);
            const struct known_drive from = drive_at(names[i], rates[r].from_hz, 0.002),
                                     to = drive_at(names[i], rates[r].to_hz, 0.002);
            size_t beyond;
            frf = known_frf(&from, 1.0, 1.0, (size_t)(0.45 * rates[r].from_hz));
            take(rates[r].to_hz);
            const double worst = compare(&to, 0.1 * slower_hz, &beyond);
            const double doubt =
                plant.doubt[(size_t)(0.1 * slower_hz)] / cabs(plant.response[(size_t)(0.1 * slower_hz)]);
            printf("%s, %g to %g Hz: largest error up to a tenth %.3f, doubt there %.3f\n", names[i], rates[r].from_hz,
                   rates[r].to_hz, worst, doubt);
            TEST_ASSERT_EQUAL_size_t(0, beyond);
            TEST_ASSERT_TRUE(worst < 0.08 && doubt < 0.15);
            tearDown();
        }
}

/// A response in s has no hold yet: the controller's belongs to its loop, at its own rate too.
static void test_tune_hold_of_a_band_limited_response_is_added(void)
{
    static const double rates[] = {2000.0, 1000.0, 4000.0};
    for (size_t r = 0; r < sizeof rates / sizeof *rates; r++) {
        const struct known_drive drive = drive_at("two-mass", 2000.0, 0.002);
        const struct known_drive sampled = drive_at("two-mass", rates[r], 0.002);
        size_t beyond;
        frf = known_frf(&drive, 1.0, 1.0, 950);
        for (size_t k = 0; k < frf.count; k++) {
            const double complex P = unheld(&drive, frf.frequency_hz[k]);
            frf.real[k] = creal(P);
            frf.imag[k] = cimag(P);
        }
        frf.keys = realloc(frf.keys, 2 * sizeof *frf.keys);
        TEST_ASSERT_NOT_NULL(frf.keys);
        frf.keys[1] = (struct run_key){0};
        frf.key_count = 2;
        TEST_ASSERT_TRUE(frf_set_text(&frf.keys[1].key, "hold") && frf_set_text(&frf.keys[1].value, "band-limited"));
        take(rates[r]);
        const double worst = compare(&sampled, 0.1 * rates[r], &beyond);
        printf("band-limited to %g Hz: largest error up to a tenth %.3f\n", rates[r], worst);
        TEST_ASSERT_EQUAL_size_t(0, beyond);
        TEST_ASSERT_TRUE(worst < 0.08);
        tearDown();
    }
}

static void test_tune_hold_of_the_same_rate_changes_nothing(void)
{
    const struct known_drive drive = drive_at("two-mass", 2000.0, 0.001);
    frf = known_frf(&drive, 1.0, 1.0, 900);
    take(2000.9); // a recording's own clock
    TEST_ASSERT_FALSE(plant.carried);
    for (size_t k = 0; k < plant.count; k++) {
        TEST_ASSERT_EQUAL_DOUBLE(frf.real[k], creal(plant.response[k]));
        TEST_ASSERT_EQUAL_DOUBLE(0.0, plant.doubt[k]);
    }
}

/// Noise of the lines that fold onto each other adds up; beyond that a smaller gain of the hold makes it smaller.
static void test_tune_hold_carries_standard_deviations(void)
{
    const struct known_drive fast = drive_at("rigid", 2000.0, 0.001);
    frf = known_frf(&fast, 1.0, 1.0, 999);
    for (size_t k = 0; k < frf.count; k++)
        frf.std[k] = 0.01;
    take(1000.0);
    // D of both folds: cos(x) and sin(x), x = pi f/2000 Hz, whose squares sum to 1.
    for (size_t k = 0; k < plant.count; k++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.01, plant.std[k]);
}

static void test_tune_hold_refuses_a_name_it_does_not_know(void)
{
    const struct known_drive drive = drive_at("rigid", 2000.0, 0.0);
    frf = known_frf(&drive, 1.0, 1.0, 900);
    TEST_ASSERT_TRUE(frf_set_text(&frf.keys[0].key, "hold") && frf_set_text(&frf.keys[0].value, "triangle"));
    TEST_ASSERT_EQUAL_INT(error_refused, tune_plant_take("f.csv", &frf, 2000.0, 0.0, &plant, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "hold: 'triangle', expected zoh or band-limited"),
                                 error.message);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_tune_hold_of_a_slower_controller_is_exact);
    RUN_TEST(test_tune_hold_of_a_slower_controller_is_more_than_a_quotient);
    RUN_TEST(test_tune_hold_of_a_slower_controller_knows_what_it_lacks);
    RUN_TEST(test_tune_hold_of_other_rates_is_within_its_doubt);
    RUN_TEST(test_tune_hold_of_a_band_limited_response_is_added);
    RUN_TEST(test_tune_hold_of_the_same_rate_changes_nothing);
    RUN_TEST(test_tune_hold_carries_standard_deviations);
    RUN_TEST(test_tune_hold_refuses_a_name_it_does_not_know);
    return UNITY_END();
}
