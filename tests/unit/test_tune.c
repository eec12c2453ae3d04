/* SPDX-License-Identifier: MIT */
/// Tuning as a whole: what is given out is stable, sure to the degree that is said, and in the right units; the rest is
/// refused with advice that holds.
#include "lab/numeric/statistics.h"
#include "lab/tune/report.h"
#include "lab/tune/say.h"
#include "lab/tune/tune.h"
#include "lab/tune/tune_json.h"
#include "tests/support/known_drive.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static struct frf frf;
static struct tune_result result;
static struct tune_options options;
static struct error error;

void setUp(void)
{
    tune_options_default(&options);
    options.bandwidth_hz = 30.0;
}

void tearDown(void)
{
    tune_result_free(&result);
    frf_free(&frf);
}

static struct known_drive rigid(void)
{
    return known_rigid(2000.0, 1, 0.005, 0.01);
}

static void take(const struct known_drive *drive)
{
    frf = known_frf(drive, 1.0, 2.0, 450);
}

static void add_noise(double std, uint64_t seed)
{
    struct random random;
    random_seed(&random, seed);
    frf.degrees_of_freedom = 18.0;
    for (size_t k = 0; k < frf.count; k++) {
        frf.real[k] += std * sqrt(0.5) * random_normal(&random);
        frf.imag[k] += std * sqrt(0.5) * random_normal(&random);
        frf.std[k] = std;
    }
}

static void tune(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, tune_run("f.csv", &frf, &options, &result, &error), error.message);
}

static void refuses(int status, const char *part)
{
    TEST_ASSERT_EQUAL_INT(status, tune_run("f.csv", &frf, &options, &result, &error));
    TEST_ASSERT_TRUE_MESSAGE(strstr(error.message, part) != NULL, error.message);
    TEST_ASSERT_NULL(result.loop);
}

static bool warns(const char *part)
{
    for (size_t i = 0; i < result.warning_count; i++)
        if (strstr(result.warnings[i], part))
            return true;
    return false;
}

/// Sums of a number over repetitions.
struct scatter {
    double sum, square, count;
};

static void scatter_add(struct scatter *self, double value)
{
    self->sum += value;
    self->square += value * value;
    self->count++;
}

static double scatter_std(const struct scatter *self)
{
    return sqrt((self->square - self->sum * self->sum / self->count) / (self->count - 1.0));
}

/// Gains and, of the given controller, margins, on the response in `frf`.
static void repeat(const struct tune_solution *given, struct scatter *gains, struct scatter *margins)
{
    struct tune_plant plant;
    struct tune_problem problem;
    struct margins found;
    double gain[tune_gains_max] = {0.0};
    TEST_ASSERT_EQUAL_INT(0, tune_plant_take("f.csv", &frf, 0.0, 0.0, &plant, &error));
    TEST_ASSERT_TRUE(tune_problem_init(&problem, &plant, &given->controller, &given->reference, tune_weighting_log));
    TEST_ASSERT_TRUE(tune_fit_linear(&problem, plant.response, gain));
    TEST_ASSERT_TRUE(tune_fit_reweighted(&problem, plant.response, gain));
    for (size_t i = 0; i < 2; i++)
        scatter_add(&gains[i], gain[i]);
    for (size_t k = 0; k < plant.count; k++)
        plant.response[k] *= tune_controller_at(&given->controller, plant.delay[k]);
    margins_find(plant.count, plant.frequency_hz, plant.response, &found);
    scatter_add(&margins[0], found.phase_deg);
    scatter_add(&margins[1], found.gain_db);
    scatter_add(&margins[2], found.cutoff_hz);
    tune_problem_free(&problem);
    tune_plant_free(&plant);
}

/// Standard deviations said for one noisy response are what many noisy responses of the same drive scatter by.
static void test_tune_says_how_much_gains_and_margins_scatter(void)
{
    enum { repetitions = 150 };
    // A standard deviation from 150 numbers has one of 6 % itself, one from 100 draws 7 %: four times both together.
    const double sure = 0.37;
    const struct known_drive drive = rigid();
    struct scatter gains[2] = {{0.0, 0.0, 0.0}}, margins[3] = {{0.0, 0.0, 0.0}};
    take(&drive);
    add_noise(0.01, 99);
    tune();
    for (int r = 0; r < repetitions; r++) {
        frf_free(&frf);
        take(&drive);
        add_noise(0.01, (uint64_t)(100 + r));
        repeat(&result.solution, gains, margins);
    }
    const struct tune_deviation *said = &result.deviation;
    const double stds[] = {said->gain[0], said->gain[1], said->margins.phase_deg, said->margins.gain_db,
                           said->margins.cutoff_hz};
    const double seen[] = {scatter_std(&gains[0]), scatter_std(&gains[1]), scatter_std(&margins[0]),
                           scatter_std(&margins[1]), scatter_std(&margins[2])};
    static const char *const names[] = {"Kp", "Ki", "phase margin", "gain margin", "cutoff"};
    for (size_t i = 0; i < 5; i++) {
        printf("%-12s std said %.5f, seen in %d repetitions %.5f\n", names[i], stds[i], (int)repetitions, seen[i]);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(sure * seen[i], seen[i], stds[i], names[i]);
    }
    TEST_ASSERT_EQUAL_size_t(tune_draws, said->stable);
}

static void test_tune_gives_the_same_numbers_for_the_same_response(void)
{
    const struct known_drive drive = rigid();
    double first[3];
    for (int time = 0; time < 2; time++) {
        take(&drive);
        add_noise(0.01, 5);
        tune();
        const double now[3] = {result.solution.controller.gain[0], result.deviation.gain[1],
                               result.deviation.margins.modulus};
        if (time == 0)
            memcpy(first, now, sizeof first);
        TEST_ASSERT_EQUAL_MEMORY(first, now, sizeof first);
        tearDown();
    }
}

/// Refused, and what the refusal proposes is stable.
static void test_tune_refuses_an_unstable_loop_with_advice_that_holds(void)
{
    const struct known_drive drive = rigid();
    frf = known_frf(&drive, 0.5, 0.5, 1800);
    options.bandwidth_hz = 60.0;
    options.delay_samples = 0.0;
    options.loop_delay_s = 0.02;
    refuses(error_refused, "would be unstable: 2 poles outside the unit circle with Kp");
    const char *advice = strstr(error.message, "try: --bandwidth ");
    TEST_ASSERT_NOT_NULL_MESSAGE(advice, error.message);
    TEST_ASSERT_EQUAL_INT(1, sscanf(advice, "try: --bandwidth %lf is stable", &options.bandwidth_hz));
    TEST_ASSERT_TRUE(options.bandwidth_hz < 60.0);
    tune();
}

static void test_tune_refuses_lines_that_begin_too_high_with_advice_that_holds(void)
{
    const struct known_drive drive = rigid();
    take(&drive);
    for (size_t k = 0; k < frf.count; k++)
        frf.valid[k] = frf.frequency_hz[k] > 30.0;
    options.bandwidth_hz = 10.0;
    refuses(error_refused, "lines below the crossover are missing");
    const char *advice = strstr(error.message, "try: --bandwidth ");
    TEST_ASSERT_NOT_NULL_MESSAGE(advice, error.message);
    TEST_ASSERT_EQUAL_INT(1, sscanf(advice, "try: --bandwidth %lf is stable", &options.bandwidth_hz));
    TEST_ASSERT_TRUE(options.bandwidth_hz > 10.0);
    tune();
}

static void test_tune_refuses_a_response_of_the_wrong_sign(void)
{
    const struct known_drive drive = rigid();
    take(&drive);
    for (size_t k = 0; k < frf.count; k++) {
        frf.real[k] = -frf.real[k];
        frf.imag[k] = -frf.imag[k];
    }
    options.structure = "p";
    refuses(error_refused, "does the velocity count the other way round?");
}

/// The filter's poles are on the antiresonance, but much wider: the reweighting goes astray.
static void test_tune_gives_the_linear_fit_where_reweighting_is_worse(void)
{
    const struct known_drive belt = known_two_mass(2000.0, 1, 0.0031, 0.00206, 600.0, 0.05, 0.005);
    take(&belt);
    options.structure = "pi+biquad";
    options.filter = (struct tune_filter){.zero_hz = 110.8, .zero_damping = 0.03, .pole_hz = 86.0, .pole_damping = 0.7};
    tune();
    TEST_ASSERT_FALSE(result.solution.reweighted);
    TEST_ASSERT_EQUAL_DOUBLE(result.solution.cost_linear, result.solution.cost);
    TEST_ASSERT_TRUE(warns("no better than the linear one"));
}

static void test_tune_refuses_options_out_of_range(void)
{
    static const double bandwidths[] = {0.0, -1.0, 500.1, NAN, INFINITY}, dampings[] = {0.0, 11.0, NAN},
                        delays[] = {-1.0, 101.0, NAN};
    const struct known_drive drive = rigid();
    take(&drive);
    for (size_t i = 0; i < sizeof bandwidths / sizeof *bandwidths; i++) {
        options.bandwidth_hz = bandwidths[i];
        refuses(error_usage, "--bandwidth");
    }
    options.bandwidth_hz = 30.0;
    for (size_t i = 0; i < sizeof dampings / sizeof *dampings; i++) {
        options.damping = dampings[i];
        refuses(error_usage, "--damping");
    }
    options.damping = 0.9;
    for (size_t i = 0; i < sizeof delays / sizeof *delays; i++) {
        options.delay_samples = delays[i];
        refuses(error_usage, "--delay");
    }
    options.delay_samples = 1.0;
    options.structure = "pid";
    options.corner_hz = 901.0;
    refuses(error_usage, "--corner");
    options.rate_hz = 1e12;
    refuses(error_usage, "--rate: 1e+12 Hz, expected at most 1e+07 Hz");
}

static void test_tune_warns_of_what_the_engineer_should_know(void)
{
    const struct known_drive drive = rigid();
    take(&drive);
    tune();
    TEST_ASSERT_TRUE(warns("no standard deviations"));
    TEST_ASSERT_FALSE(warns("as measured"));
    tearDown();

    take(&drive);
    TEST_ASSERT_TRUE(frf_set_text(&frf.input, "torque_Nm"));
    add_noise(0.001, 1);
    options.structure = "pid";
    tune();
    TEST_ASSERT_TRUE(warns("begins at torque_Nm, as measured"));
    TEST_ASSERT_FALSE(warns("no standard deviations"));
    tearDown();

    const struct known_drive belt = known_two_mass(2000.0, 1, 0.003, 0.002, 600.0, 0.05, 0.005);
    take(&belt);
    options.structure = "pi";
    tune();
    TEST_ASSERT_TRUE(warns("a dip at the antiresonance"));
    tearDown();

    take(&drive);
    options.structure = "p";
    options.bandwidth_hz = 400.0;
    tune();
    TEST_ASSERT_TRUE(warns("max |S| is"));
    tearDown();

    take(&belt);
    options.structure = "pi";
    options.bandwidth_hz = 500.0; // this reference has no -3 dB below half the rate
    tune();
    TEST_ASSERT_TRUE(warns("cannot reach the reference"));
}

static void add_key(const char *key, const char *value)
{
    frf.keys = realloc(frf.keys, (frf.key_count + 1) * sizeof *frf.keys);
    TEST_ASSERT_NOT_NULL(frf.keys);
    frf.keys[frf.key_count] = (struct run_key){0};
    TEST_ASSERT_TRUE(frf_set_text(&frf.keys[frf.key_count].key, key) &&
                     frf_set_text(&frf.keys[frf.key_count].value, value));
    frf.key_count++;
}

/// Whatever the file says against itself comes first; one that covers nothing is told at the end, without a guess.
static void test_tune_says_what_the_file_warns_of(void)
{
    static const char *const keys[][2] = {{"parametric_warning", "more dynamics than the model has"},
                                          {"warning", "biased if a loop is closed"},
                                          {"warning_of_the_future", "something else"},
                                          {"clock", "apart"}};
    const struct known_drive drive = rigid();
    take(&drive);
    for (size_t i = 0; i < 4; i++)
        add_key(keys[i][0], keys[i][1]);
    add_key("no_warnings", "this is none");
    tune();
    TEST_ASSERT_EQUAL_size_t(4, result.file_warning_count);
    for (size_t i = 0; i < 4; i++)
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(result.warnings[i], keys[i][0]), result.warnings[i]);
    TEST_ASSERT_TRUE(warns("more dynamics than the model has") && !warns("this is none"));
}

/// A response drawn towards minus the inverse of the controller is not tuned on; one that another input answers is, as
/// far as that leaves a verdict.
static void test_tune_refuses_on_what_the_file_warns_of(void)
{
    const struct known_drive drive = rigid();
    take(&drive);
    add_key("warning", "biased: the recording holds velocity_ref_rad_per_s; use method indirect");
    refuses(error_refused, "its key warning says of the response: biased: the recording holds");
    tearDown();

    take(&drive);
    add_key("other_inputs_db", "-26");
    add_key("warning_inputs", "it answers");
    tune();
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.05, result.doubt_at_crossover);
    tearDown();

    take(&drive);
    add_key("other_inputs_db", "1");
    add_key("warning_inputs", "it answers");
    refuses(error_refused, "another input is up to 1.1 times as strong on a line");
    tearDown();

    take(&drive);
    add_key("repetition_level", "0.9");
    add_key("warning_repetition", "every second period");
    refuses(error_refused, "0.9 of the response does not repeat");
}

static void test_tune_says_what_its_lines_leave_open(void)
{
    const struct known_drive drive = rigid();
    frf = known_frf(&drive, 1.0, 1.0, 300);
    for (size_t k = 48; k < 51; k++)
        frf.valid[k] = false;
    tune();
    TEST_ASSERT_TRUE(warns("left out as not valid: 3 lines at 49..51 Hz"));
    TEST_ASSERT_TRUE(warns("the lines end at 300 Hz"));
    tearDown();

    frf = known_frf(&drive, 1.0, 1.0, 950);
    for (size_t k = 0; k < frf.count; k++)
        frf.valid[k] = !(frf.frequency_hz[k] > 400.0 && frf.frequency_hz[k] < 700.0);
    options.bandwidth_hz = 5.0;
    tune();
    TEST_ASSERT_TRUE(warns("there is no line between 400 and 700 Hz"));
    TEST_ASSERT_FALSE(warns("the lines end"));
}

static void test_tune_says_that_it_carried_the_response_over(void)
{
    const struct known_drive drive = rigid();
    frf = known_frf(&drive, 1.0, 1.0, 999);
    options.rate_hz = 1000.0;
    tune();
    TEST_ASSERT_TRUE(warns("measured with a hold at 2000 Hz, is carried over to the controller's hold at 1000 Hz"));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, result.doubt_at_crossover);
    tearDown();
    frf = known_frf(&drive, 1.0, 1.0, 999);
    frf.key_count = 0; // no rate
    options.rate_hz = 2000.0;
    tune();
    TEST_ASSERT_TRUE(warns("no sample_rate_hz"));
    TEST_ASSERT_FALSE(warns("carried over"));
    frf.key_count = 1;
}

static void test_tune_warns_of_several_inputs_and_of_missing_standard_deviations(void)
{
    const struct known_drive drive = rigid();
    take(&drive);
    add_noise(0.001, 1);
    frf.std[7] = FRF_UNKNOWN;
    TEST_ASSERT_TRUE(frf_set_text(&frf.input, "torque_ref_2_Nm") && frf_set_text(&frf.output, "velocity_1_rad_per_s"));
    tune();
    TEST_ASSERT_TRUE(warns("torque_ref_2_Nm is one of several inputs"));
    TEST_ASSERT_TRUE(warns("the output is another one's"));
    TEST_ASSERT_TRUE(warns("1 of 450 lines have no standard deviation"));
}

/// The model file's controller adds its integral one sample later: K = gain (1 + q/(1 - q) Ts/Ti) has to be the same.
static void test_tune_gives_the_controller_in_the_terms_of_a_model_file(void)
{
    const struct known_drive drive = rigid();
    take(&drive);
    tune();
    const struct say_model_controller model = say_model_controller(&result);
    TEST_ASSERT_TRUE(model.exists);
    TEST_ASSERT_EQUAL_STRING("velocity_gain_Nms_per_rad", model.gain_name);
    for (size_t k = 0; k < result.plant.count; k += 100) {
        const double complex q = result.plant.delay[k];
        const double complex late = model.gain * (1.0 + q / (1.0 - q) / (2000.0 * model.integral_time_s));
        const double complex ours = tune_controller_at(&result.solution.controller, q);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12 * cabs(ours), 0.0, cabs(late - ours));
    }
    tearDown();
    take(&drive);
    options.structure = "pid";
    tune();
    TEST_ASSERT_FALSE(say_model_controller(&result).exists);
}

static void test_tune_json_and_page_hold_no_number_that_is_none(void)
{
    const struct known_drive drive = rigid();
    take(&drive);
    options.bandwidth_hz = 10.0; // few crossings: many margins are unknown
    options.structure = "p";
    tune();
    char *text = NULL;
    size_t size = 0;
    struct page page;
    FILE *stream = open_memstream(&text, &size);
    page_start(&page, stream, "test", NULL);
    tune_report_sections(&page, &frf, &result);
    TEST_ASSERT_EQUAL_INT(0, page_end(&page, NULL));
    fclose(stream);
    const char *body = strstr(text, "<main>");
    TEST_ASSERT_NOT_NULL(body);
    TEST_ASSERT_NULL(strstr(body, ">nan"));
    TEST_ASSERT_NULL(strstr(body, " nan"));
    TEST_ASSERT_NULL(strstr(body, ">inf"));
    TEST_ASSERT_NOT_NULL(strstr(body, "Nyquist plot"));
    TEST_ASSERT_NOT_NULL(strstr(body, "residual over 2 std: T less reference"));
    // The result first, then what it rests on; measured lines are points, the reference and the circles are lines.
    const char *result_first = strstr(body, "The closed loop follows"), *then = strstr(body, "Controller</h2>");
    TEST_ASSERT_TRUE(result_first && then && result_first < then);
    TEST_ASSERT_NOT_NULL(strstr(body, "data-n=\"T, measured lines\""));
    TEST_ASSERT_NULL(strstr(body, "data-d=\"0\" d=\"M")); // no solid line
    free(text);
    cJSON *json = tune_json("f.csv", &result);
    const cJSON *gain = cJSON_GetObjectItem(cJSON_GetObjectItem(json, "gains"), "proportional_Nms_per_rad");
    TEST_ASSERT_EQUAL_DOUBLE(result.solution.controller.gain[0], cJSON_GetObjectItem(gain, "value")->valuedouble);
    TEST_ASSERT_TRUE(cJSON_IsTrue(cJSON_GetObjectItem(cJSON_GetObjectItem(json, "stability"), "stable")));
    TEST_ASSERT_TRUE(cJSON_IsNull(cJSON_GetObjectItem(json, "resonance")));
    cJSON_Delete(json);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_tune_says_how_much_gains_and_margins_scatter);
    RUN_TEST(test_tune_gives_the_same_numbers_for_the_same_response);
    RUN_TEST(test_tune_refuses_an_unstable_loop_with_advice_that_holds);
    RUN_TEST(test_tune_refuses_lines_that_begin_too_high_with_advice_that_holds);
    RUN_TEST(test_tune_refuses_a_response_of_the_wrong_sign);
    RUN_TEST(test_tune_gives_the_linear_fit_where_reweighting_is_worse);
    RUN_TEST(test_tune_refuses_options_out_of_range);
    RUN_TEST(test_tune_warns_of_what_the_engineer_should_know);
    RUN_TEST(test_tune_says_what_the_file_warns_of);
    RUN_TEST(test_tune_refuses_on_what_the_file_warns_of);
    RUN_TEST(test_tune_says_what_its_lines_leave_open);
    RUN_TEST(test_tune_says_that_it_carried_the_response_over);
    RUN_TEST(test_tune_warns_of_several_inputs_and_of_missing_standard_deviations);
    RUN_TEST(test_tune_gives_the_controller_in_the_terms_of_a_model_file);
    RUN_TEST(test_tune_json_and_page_hold_no_number_that_is_none);
    return UNITY_END();
}
