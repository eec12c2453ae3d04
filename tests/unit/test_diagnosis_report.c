/* SPDX-License-Identifier: MIT */
/// The diagnosis as a page: its sentences hold the numbers that went in, in the right units; it is whole or not there.
#include "lab/diagnose/report.h"
#include "lab/diagnose/report_curves.h"
#include "lab/diagnose/wording.h"
#include "tests/support/sample_diagnosis.h"
#include "tests/support/scratch.h"

#include "unity.h"

static struct diagnosis diagnosis;
static char *html;
static struct error error;

void setUp(void)
{
    html = NULL;
    error = (struct error){0};
}

void tearDown(void)
{
    free(html);
    diagnosis_free(&diagnosis);
    scratch_empty();
}

static void report(void)
{
    const char *path = scratch_path("r.html");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, diagnosis_report(&diagnosis, path, &error), error.message);
    html = scratch_load(path, NULL);
    TEST_ASSERT_NOT_NULL(html);
}

static void has(const char *text)
{
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(html, text), text);
}

static void has_not(const char *text)
{
    TEST_ASSERT_NULL_MESSAGE(strstr(html, text), text);
}

/// As a number printed by mistake, not as a part of "resonances".
static void has_no_nan(void)
{
    static const char *const printed[] = {" nan", "-nan", ">nan", "\"nan", " inf ", "-inf", ">inf"};
    for (size_t i = 0; i < sizeof printed / sizeof printed[0]; i++) {
        has_not(printed[i]);
    }
}

static void test_diagnosis_report_names_causes_with_their_numbers(void)
{
    sample_diagnosis(false, &diagnosis);
    report();
    has("Explained: cogging and stribeck friction");
    has("21.3 % of the measured torque");
    has("with the causes 5.02 %");
    has("The noise alone makes 4.81 %");
    has("0.03120 ± 0.00042");
    has("12 ± 0");
    has("1234.5");
    has("repeats 12 times a turn");
    has("To tell load bias from asymmetric friction: measure a run at half the level.");
    has("resonances above 400 Hz do not show");
    has("friction torque in Nm");
    has("</html>");
    has_no_nan();
}

static void test_diagnosis_report_has_linear_units_on_a_linear_axis(void)
{
    sample_diagnosis(true, &diagnosis);
    report();
    has("of the measured force");
    has("force error in N, model as given");
    has("speed in m/s");
    has("amplitude_N<");
    has_not("Nm");
    has_not("rad/s");
}

static void test_diagnosis_report_says_what_stays_unexplained(void)
{
    sample_unexplained(&diagnosis);
    report();
    has("Not explained as a whole: cogging stands");
    has("31.0 % of the given model&#39;s misfit stays (5.72 times what noise makes): 0.8..3 Hz, moving left, after 9 "
        "s.");
    has("What might be, without being claimed");
    has_not("Nothing that stands out of the noise");
}

static void test_diagnosis_report_without_causes_and_curves_is_whole(void)
{
    sample_no_discrepancy(&diagnosis);
    report();
    has("No discrepancy: as given the model fits");
    has("There are no spectra to compare.");
    has("Nothing that stands out of the noise.");
    has("None is needed");
    has("Record a second run");
    has("</html>");
    has_not(">extended<");
}

static void test_diagnosis_report_survives_numbers_that_are_none(void)
{
    sample_diagnosis(false, &diagnosis);
    diagnosis.nominal.validation_nrmse = NAN;
    diagnosis.noise_floor_nrmse = NAN;
    diagnosis.fit_misfit = INFINITY;
    diagnosis.causes[0].deviations[0] = NAN;
    diagnosis.causes[1].evidence = NAN;
    memset(diagnosis.curves.two_sigma_Nm, 0, diagnosis.curves.bins * sizeof(double));
    diagnosis.curves.friction_measured[0] = NAN;
    report();
    has("is off by unknown of the measured torque");
    has("0.0312 ± unknown");
    has_no_nan();
}

static void test_diagnosis_report_leaves_nothing_half_written(void)
{
    sample_diagnosis(false, &diagnosis);
    const char *path = scratch_path("missing/r.html");
    TEST_ASSERT_EQUAL_INT(error_refused, diagnosis_report(&diagnosis, path, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "missing/r.html"), error.message);
    TEST_ASSERT_EQUAL_INT(0, scratch_count());
    TEST_ASSERT_EQUAL_INT(error_refused, diagnosis_report(&diagnosis, "/dev/full", &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "/dev/full"), error.message);
}

static void test_diagnosis_report_bands_keep_the_mean_square(void)
{
    const double rounding = 1e-9; // sums of a few hundred numbers of size one
    static struct report_bands bands;
    sample_diagnosis(false, &diagnosis);
    struct diagnosis_curves *c = &diagnosis.curves;
    for (size_t k = 0; k < c->bins; k++) {
        c->nominal_Nm[k] = 3.0 * c->two_sigma_Nm[k];
    }
    c->extended_Nm[c->bins - 1] = 2.5 * c->two_sigma_Nm[c->bins - 1];
    report_bands_find(c, &bands);
    TEST_ASSERT_TRUE(bands.logarithmic);
    TEST_ASSERT_TRUE(bands.count > 100 && bands.count <= report_bands_max);
    TEST_ASSERT_TRUE(bands.widest > 1);
    TEST_ASSERT_EQUAL_DOUBLE(c->frequency_hz[0], bands.frequency_hz[0]);
    for (size_t i = 0; i < bands.count; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(rounding, 3.0, bands.nominal[i]);
    }
    struct report_excess excess = report_excess_find(c, c->nominal_Nm);
    TEST_ASSERT_EQUAL_size_t(c->bins, excess.bins);
    TEST_ASSERT_EQUAL_size_t(c->bins, excess.above);
    excess = report_excess_find(c, c->extended_Nm);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 2.5, excess.worst);
    TEST_ASSERT_EQUAL_DOUBLE(c->frequency_hz[c->bins - 1], excess.worst_hz);
}

static void test_diagnosis_report_finds_the_worst_stretch(void)
{
    sample_diagnosis(false, &diagnosis);
    struct diagnosis_curves *c = &diagnosis.curves;
    memset(c->residual_nominal, 0, c->samples * sizeof(double));
    for (size_t n = 1000; n < 1100; n++) {
        c->residual_nominal[n] = 1.0;
    }
    TEST_ASSERT_EQUAL_size_t(1000, report_worst_stretch(c, 100));
    memset(c->residual_nominal, 0, c->samples * sizeof(double));
    c->residual_nominal[c->samples - 1] = 1.0;
    TEST_ASSERT_EQUAL_size_t(c->samples - 100, report_worst_stretch(c, 100));
}

static void test_diagnosis_report_friction_scatter_is_that_of_the_points(void)
{
    const double noise_Nm = 0.004;  // sample_motion()'s
    const double sampling = 0.0004; // of a standard deviation from 1300 points, four of its own
    static struct report_friction friction;
    sample_diagnosis(false, &diagnosis);
    report_friction_find(&diagnosis.curves, &friction);
    TEST_ASSERT_TRUE(friction.count > 1000 && friction.count <= report_points_max);
    TEST_ASSERT_DOUBLE_WITHIN(sampling, noise_Nm, friction.spread);
}

static void test_diagnosis_report_estimates_have_the_digits_of_their_deviation(void)
{
    static const struct {
        double value, deviation;
        const char *text;
    } cases[] = {
        {0.0312, 0.00042, "0.03120 ± 0.00042"},
        {12.0, 0.0, "12 ± 0"},
        {123.456, 7.8, "123.5 ± 7.8"},
        {2.5e-9, 1.2e-10, "2.5e-09 ± 1.2e-10"},
        {15321.0, 420.0, "1.532e+04 ± 4.2e+02"},
        {1.0, NAN, "1 ± unknown"},
        {NAN, 1.0, "unknown"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[2 * wording_short];
        wording_estimate(cases[i].value, cases[i].deviation, text);
        TEST_ASSERT_EQUAL_STRING(cases[i].text, text);
    }
}

static void test_diagnosis_report_gain_counts_above_the_noise_floor(void)
{
    const double rounding = 1e-12;
    sample_diagnosis(false, &diagnosis);
    diagnosis.nominal.validation_nrmse = 0.5;
    diagnosis.extended.validation_nrmse = 0.4;
    diagnosis.noise_floor_nrmse = 0.3;
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 1.0 - 0.07 / 0.16, wording_removed_share(&diagnosis));
    diagnosis.nominal.validation_nrmse = 0.3;
    TEST_ASSERT_TRUE(isnan(wording_removed_share(&diagnosis)));
}

static void test_diagnosis_report_a_number_at_the_edge_of_its_range_has_no_deviation(void)
{
    char text[wording_size] = "A mass of 3 +- 0 kg at 12 +- 0.5 Hz and 4 +- 0";
    wording_in_units(&diagnosis, sizeof text, text);
    TEST_ASSERT_EQUAL_STRING("A mass of 3 kg at 12 +- 0.5 Hz and 4", text);
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_diagnosis_report_names_causes_with_their_numbers);
    RUN_TEST(test_diagnosis_report_has_linear_units_on_a_linear_axis);
    RUN_TEST(test_diagnosis_report_says_what_stays_unexplained);
    RUN_TEST(test_diagnosis_report_without_causes_and_curves_is_whole);
    RUN_TEST(test_diagnosis_report_survives_numbers_that_are_none);
    RUN_TEST(test_diagnosis_report_leaves_nothing_half_written);
    RUN_TEST(test_diagnosis_report_bands_keep_the_mean_square);
    RUN_TEST(test_diagnosis_report_finds_the_worst_stretch);
    RUN_TEST(test_diagnosis_report_friction_scatter_is_that_of_the_points);
    RUN_TEST(test_diagnosis_report_estimates_have_the_digits_of_their_deviation);
    RUN_TEST(test_diagnosis_report_gain_counts_above_the_noise_floor);
    RUN_TEST(test_diagnosis_report_a_number_at_the_edge_of_its_range_has_no_deviation);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
