/* SPDX-License-Identifier: MIT */
/// What tuning takes from a response file: which lines, which units, which rate; and what it refuses.
#include "lab/tune/plant.h"
#include "tests/support/known_drive.h"
#include "unity.h"

#include <math.h>
#include <string.h>

static struct frf frf;
static struct tune_plant plant;
static struct error error;

void setUp(void)
{
    const struct known_drive drive = known_rigid(2000.0, 1, 0.005, 0.01);
    frf = known_frf(&drive, 0.0, 10.0, 101); // 0 .. 1000 Hz, half the rate
}

void tearDown(void)
{
    tune_plant_free(&plant);
    frf_free(&frf);
}

static void refuses(int status, const char *part)
{
    TEST_ASSERT_EQUAL_INT(status, tune_plant_take("f.csv", &frf, 0.0, 0.0, &plant, &error));
    TEST_ASSERT_TRUE_MESSAGE(strstr(error.message, part) != NULL, error.message);
    TEST_ASSERT_NULL(plant.response);
}

static void test_tune_plant_leaves_out_lines_that_cannot_be_used(void)
{
    frf.valid[5] = false;
    frf.real[7] = frf.imag[7] = 0.0;
    TEST_ASSERT_EQUAL_INT(0, tune_plant_take("f.csv", &frf, 0.0, 0.0, &plant, &error));
    // Of 101 lines 0 Hz, 1000 Hz, one not valid, one without a response.
    TEST_ASSERT_EQUAL_size_t(97, plant.count);
    TEST_ASSERT_EQUAL_size_t(4, plant.skipped);
    TEST_ASSERT_EQUAL_size_t(2, plant.left_out);
    TEST_ASSERT_EQUAL_DOUBLE(50.0, plant.left_out_hz[0]);
    TEST_ASSERT_EQUAL_DOUBLE(2000.0, plant.rate_hz);
    TEST_ASSERT_EQUAL_DOUBLE(10.0, plant.frequency_hz[0]);
    TEST_ASSERT_EQUAL_DOUBLE(990.0, plant.frequency_hz[96]);
    TEST_ASSERT_FALSE(plant.std_known);
}

static void test_tune_plant_takes_standard_deviations_and_their_confidence(void)
{
    const double factor_of_ten_periods = 1.8855; // root of 3.555, F(2, 18) at 95 %
    frf.std[3] = 0.25;
    frf.degrees_of_freedom = 18.0;
    TEST_ASSERT_EQUAL_INT(0, tune_plant_take("f.csv", &frf, 0.0, 0.0, &plant, &error));
    TEST_ASSERT_TRUE(plant.std_known);
    TEST_ASSERT_EQUAL_DOUBLE(0.25, plant.std[2]);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, plant.std[3]);
    TEST_ASSERT_EQUAL_size_t(plant.count - 1, plant.std_unknown);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, factor_of_ten_periods, plant.confidence_factor);
}

static void test_tune_plant_adds_the_loops_delay(void)
{
    TEST_ASSERT_EQUAL_INT(0, tune_plant_take("f.csv", &frf, 0.0, 0.001, &plant, &error));
    const double complex measured = frf.real[25] + frf.imag[25] * I; // 250 Hz: 1 ms is a quarter of a turn
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0, cabs(plant.response[24] - measured * -I));
}

static void test_tune_plant_puts_a_removed_delay_back(void)
{
    TEST_ASSERT_TRUE(frf_set_text(&frf.keys[0].key, "delay_removed_s"));
    TEST_ASSERT_TRUE(frf_set_text(&frf.keys[0].value, "0.00075"));
    TEST_ASSERT_EQUAL_INT(0, tune_plant_take("f.csv", &frf, 2000.0, 0.00025, &plant, &error));
    const double complex shown = frf.real[25] + frf.imag[25] * I;
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0, cabs(plant.response[24] - shown * -I));
    tune_plant_free(&plant);
    TEST_ASSERT_TRUE(frf_set_text(&frf.keys[0].value, "late"));
    TEST_ASSERT_EQUAL_INT(error_refused, tune_plant_take("f.csv", &frf, 2000.0, 0.0, &plant, &error));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "delay_removed_s: 'late'"));
}

static void test_tune_plant_rate_of_the_option_goes_before_the_file(void)
{
    TEST_ASSERT_EQUAL_INT(0, tune_plant_take("f.csv", &frf, 4000.0, 0.0, &plant, &error));
    TEST_ASSERT_EQUAL_DOUBLE(4000.0, plant.rate_hz);
    TEST_ASSERT_EQUAL_DOUBLE(2000.0, plant.response_rate_hz);
    TEST_ASSERT_TRUE(plant.carried);
    TEST_ASSERT_EQUAL_size_t(100, plant.count);
}

static void test_tune_plant_names_stretches_of_lines_left_out(void)
{
    char text[120];
    TEST_ASSERT_EQUAL_INT(0, tune_plant_take("f.csv", &frf, 0.0, 0.0, &plant, &error));
    tune_plant_name_left_out(&plant, 0.0, INFINITY, sizeof text, text);
    TEST_ASSERT_EQUAL_STRING("", text);
    tune_plant_free(&plant);
    static const size_t lines[] = {5, 10, 11, 12, 20, 22, 30, 40};
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++)
        frf.valid[lines[i]] = false;
    TEST_ASSERT_EQUAL_INT(0, tune_plant_take("f.csv", &frf, 0.0, 0.0, &plant, &error));
    tune_plant_name_left_out(&plant, 0.0, 210.0, sizeof text, text);
    TEST_ASSERT_EQUAL_STRING("5 lines at 50, 100..120, 200 Hz", text);
    tune_plant_name_left_out(&plant, 50.0, 110.0, sizeof text, text);
    TEST_ASSERT_EQUAL_STRING("1 line at 100 Hz", text);
    tune_plant_name_left_out(&plant, 0.0, INFINITY, sizeof text, text);
    TEST_ASSERT_EQUAL_STRING("8 lines at 50, 100..120, 200, 220 Hz and elsewhere", text);
    char cut[12];
    tune_plant_name_left_out(&plant, 0.0, INFINITY, sizeof cut, cut);
    TEST_ASSERT_EQUAL_STRING("8 lines at ", cut);
}

static void set_keys(const char *const (*keys)[2], size_t count)
{
    for (size_t i = 0; i < frf.key_count; i++) {
        free(frf.keys[i].key);
        free(frf.keys[i].value);
    }
    free(frf.keys);
    frf.keys = calloc(count, sizeof *frf.keys);
    frf.key_count = count;
    for (size_t i = 0; i < count; i++)
        TEST_ASSERT_TRUE(frf_set_text(&frf.keys[i].key, keys[i][0]) && frf_set_text(&frf.keys[i].value, keys[i][1]));
}

/// A figure that the file warns with is doubt of that size, the two together; without the warning it is none.
static void test_tune_plant_takes_the_figures_of_warnings_as_doubt(void)
{
    static const char *const keys[][2] = {{"sample_rate_hz", "2000"},
                                          {"other_inputs_db", "-20"},
                                          {"warning_inputs", "another"},
                                          {"repetition_level", "0.05"},
                                          {"warning_repetition", "late"}};
    static const struct {
        size_t keys;
        double share;
    } cases[] = {{2, 0.0}, {3, 0.1}, {4, 0.1}, {5, 0.15}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        set_keys(keys, cases[i].keys);
        TEST_ASSERT_EQUAL_INT(0, tune_plant_take("f.csv", &frf, 0.0, 0.0, &plant, &error));
        for (size_t k = 0; k < plant.count; k++)
            TEST_ASSERT_DOUBLE_WITHIN(1e-12, cases[i].share, plant.doubt[k] / cabs(plant.response[k]));
        TEST_ASSERT_EQUAL(cases[i].share > 0.0, plant.doubt_from[0] != '\0');
        tune_plant_free(&plant);
    }
    TEST_ASSERT_TRUE(frf_set_text(&frf.keys[1].value, "much"));
    refuses(error_refused, "other_inputs_db: 'much', expected a number of decibel");
}

static void test_tune_plant_refuses_frequencies_beyond_half_the_rate(void)
{
    for (size_t k = 0; k < frf.count; k++)
        frf.frequency_hz[k] *= known_two_pi;
    refuses(error_refused, "a line at 6283.19 Hz, expected at most 1000 Hz");
}

static void test_tune_plant_names_units(void)
{
    static const struct {
        const char *input, *output, *suffixes[3], *readables[3];
    } cases[] = {
        {"torque_Nm",
         "velocity_rad_per_s",
         {"Nm_per_rad", "Nms_per_rad", "Nms2_per_rad"},
         {"Nm/rad", "Nm s/rad", "Nm s^2/rad"}},
        {"force_ref_N", "velocity_m_per_s", {"N_per_m", "Ns_per_m", "Ns2_per_m"}, {"N/m", "N s/m", "N s^2/m"}},
        {"torque_1_Nm",
         "load_position_rad",
         {"Nm_per_rad_s", "Nm_per_rad", "Nms_per_rad"},
         {"Nm/(rad s)", "Nm/rad", "Nm s/rad"}},
        {"current_A",
         "velocity_rad_per_s",
         {"A_per_rad", "As_per_rad", "As2_per_rad"},
         {"A/rad", "A s/rad", "A s^2/rad"}},
        {"voltage_V", "position_m", {"V_per_m_s", "V_per_m", "Vs_per_m"}, {"V/(m s)", "V/m", "V s/m"}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        TEST_ASSERT_TRUE(frf_set_text(&frf.input, cases[i].input) && frf_set_text(&frf.output, cases[i].output));
        TEST_ASSERT_EQUAL_INT(0, tune_plant_take("f.csv", &frf, 0.0, 0.0, &plant, &error));
        for (int power = -1; power <= 1; power++) {
            char suffix[tune_unit_size], readable[tune_unit_size];
            tune_plant_gain_unit(&plant, power, suffix, readable);
            TEST_ASSERT_EQUAL_STRING(cases[i].suffixes[power + 1], suffix);
            TEST_ASSERT_EQUAL_STRING(cases[i].readables[power + 1], readable);
        }
        tune_plant_free(&plant);
    }
}

static void test_tune_plant_refuses_other_quantities(void)
{
    TEST_ASSERT_TRUE(frf_set_text(&frf.input, "velocity_ref_rad_per_s"));
    refuses(error_refused, "from 'velocity_ref_rad_per_s' to 'velocity_rad_per_s'");
    TEST_ASSERT_TRUE(frf_set_text(&frf.input, "torque_Nm") && frf_set_text(&frf.output, "acceleration_rad_per_s2"));
    refuses(error_refused, "to 'acceleration_rad_per_s2': expected");
    free(frf.output);
    frf.output = NULL; // a file without keys
    refuses(error_refused, "to ''");
}

static void test_tune_plant_refuses_a_rate_that_is_none(void)
{
    static const char *const rates[] = {"fast", "0", "-2000", ""};
    for (size_t i = 0; i < sizeof rates / sizeof *rates; i++) {
        TEST_ASSERT_TRUE(frf_set_text(&frf.keys[0].value, rates[i]));
        refuses(error_refused, "sample_rate_hz");
    }
    TEST_ASSERT_TRUE(frf_set_text(&frf.keys[0].key, "other"));
    refuses(error_usage, "expected --rate HZ");
}

static void test_tune_plant_refuses_too_few_lines(void)
{
    for (size_t k = 8; k < frf.count; k++)
        frf.valid[k] = false;
    refuses(error_refused, "7 of 101 lines are valid");
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_tune_plant_leaves_out_lines_that_cannot_be_used);
    RUN_TEST(test_tune_plant_takes_standard_deviations_and_their_confidence);
    RUN_TEST(test_tune_plant_adds_the_loops_delay);
    RUN_TEST(test_tune_plant_puts_a_removed_delay_back);
    RUN_TEST(test_tune_plant_rate_of_the_option_goes_before_the_file);
    RUN_TEST(test_tune_plant_names_stretches_of_lines_left_out);
    RUN_TEST(test_tune_plant_takes_the_figures_of_warnings_as_doubt);
    RUN_TEST(test_tune_plant_refuses_frequencies_beyond_half_the_rate);
    RUN_TEST(test_tune_plant_names_units);
    RUN_TEST(test_tune_plant_refuses_other_quantities);
    RUN_TEST(test_tune_plant_refuses_a_rate_that_is_none);
    RUN_TEST(test_tune_plant_refuses_too_few_lines);
    return UNITY_END();
}
