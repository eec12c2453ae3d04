/* SPDX-License-Identifier: MIT */
/// Second paper: what a sequence of multisines does on two masses with cubic springs, and what it does not.
///
/// Reading: bench/sequential_study.h, tests/support/cubic_plant.h. A = 1 N, 500 Hz, integrated with four substeps a
///          sample,
/// zero state at the start, 10 s to settle before each segment, l = 1, unless a row says otherwise. "reference" is an
/// implementation of the same equations in another language. With SERVOSCOPE_LONG=1 (./run bench sequential) as many
/// runs and draws as the reference had.
#include "bench/sequential_checks.h"
#include "bench/sequential_study.h"
#include "lab/design/sequence.h"
#include "tests/support/claim.h"

#include <string.h>

static const char *const all_lines = "linear:0.1:25:0.1";
static const char *const octaves = "octaves:0.1:25:0.1";
static const char *const dwell = "dwell:0.1:25:0.1";
static const char *const every_fifth_tone = "dwell:0.5:25:0.5";

static const double above_6_hz = 6.1; ///< first line of the band in which the paper sees distortion
static const double no_end_hz = 30.0;

static const struct sequential_play paper_play = {.plant = &cubic_plant_paper, .amplitude_N = 1.0, .settle_periods = 1};

void setUp(void) {}

void tearDown(void) {}

/// claim_within() with the reference's figure beside the paper's.
static void claim_beside(const char *claim, const char *paper, const char *reference, double ours, double lowest,
                         double highest)
{
    char both[64];
    snprintf(both, sizeof both, "%14s %14s", paper, reference);
    claim_within(claim, both, ours, lowest, highest);
}

static void respond(const char *lines, enum sequential_phases phases, const struct sequential_play *play,
                    double complex out_response[sequential_lines])
{
    struct sequential_excitation excitation;
    TEST_ASSERT_TRUE(sequential_design(lines, phases, 0, &excitation));
    TEST_ASSERT_TRUE(sequential_respond(&excitation, play, out_response));
    sequential_free(&excitation);
}

static void test_plant_is_the_papers(void)
{
    double farthest_db = 0.0;
    for (int k = 1; k <= sequential_lines; k++) {
        const double complex ours = cubic_plant_response(&cubic_plant_paper, 0.1 * k);
        const double complex printed = cubic_plant_printed_response(0.1 * k);
        farthest_db = fmax(farthest_db, fabs(20.0 * log10(cabs(ours / printed))));
    }
    claim_beside("(9.4) linearised plant, farthest of 250 lines [dB]", "0", "0.0101", farthest_db, 0.0, 0.02);
}

static double test_time_s(const char *lines, double rate_hz, size_t period_samples, uint64_t periods, double settle_s)
{
    const struct design_line_grid grid = {.rate_hz = rate_hz, .period_samples = period_samples};
    struct design_sequence sequence;
    struct error error = {0};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_sequence_parse(lines, &grid, 1, 1, &sequence, &error), error.message);
    const double time_s = design_sequence_test_time_s(&sequence, periods, settle_s);
    design_sequence_free(&sequence);
    return time_s;
}

static void test_test_times_are_the_papers(void)
{
    claim_beside("9: test time, one multisine [s]", "2510", "2510", test_time_s(all_lines, 500, 5000, 250, 10), 2510,
                 2510);
    claim_beside("9: test time, sine dwell [s]", "5000", "5000", test_time_s(dwell, 500, 5000, 1, 10), 5000, 5000);
    claim_beside("9: test time, octaves [s]", "2580", "2580", test_time_s(octaves, 500, 5000, 1, 10), 2580, 2580);
    claim_beside("10: telescope, one multisine [s]", "730", "730", test_time_s("linear:0.5:90:0.5", 500, 1000, 360, 10),
                 730, 730);
    claim_beside("10: telescope, sine dwell [s]", "2520", "2520", test_time_s("dwell:0.5:90:0.5", 500, 1000, 2, 10),
                 2520, 2520);
    claim_beside("10: telescope, octaves [s]", "800", "800", test_time_s("octaves:0.5:90:0.5", 500, 1000, 2, 10), 800,
                 800);
}

static void test_peak_grows_with_the_root_of_the_lines(void)
{
    struct sequential_excitation single, sequence;
    double highest = 0.0;
    TEST_ASSERT_TRUE(sequential_design(all_lines, sequential_schroeder, 0, &single));
    TEST_ASSERT_TRUE(sequential_design(octaves, sequential_schroeder, 0, &sequence));
    claim_beside("6: peak over A, 250 lines", "about 1", "1.190", sequential_peak(&single.segments[0]), 1.17, 1.21);
    for (size_t i = 0; i < sequence.count; i++) {
        highest = fmax(highest, sequential_peak(&sequence.segments[i]));
    }
    claim_beside("7: peak over A, highest of 8 octaves", "about 1", "1.414", highest, 1.0, 1.42);
    sequential_free(&single);
    sequential_free(&sequence);
}

static void test_octaves_are_better_above_6_hz_and_worse_around_the_mode(void)
{
    double complex single[sequential_lines], sequence[sequential_lines];
    respond(all_lines, sequential_schroeder, &paper_play, single);
    respond(octaves, sequential_schroeder, &paper_play, sequence);
    claim_beside("Figure 2: one multisine, error above 6 Hz, RMS [dB]", "distorted", "4.5855",
                 sequential_error_rms_db(single, above_6_hz, no_end_hz), 4.535, 4.635);
    claim_beside("Figure 4: octaves, error above 6 Hz, RMS [dB]", "good", "0.0056",
                 sequential_error_rms_db(sequence, above_6_hz, no_end_hz), 0.0, 0.02);
    const double single_db = sequential_error_rms_db(single, 1.5, above_6_hz);
    const double sequence_db = sequential_error_rms_db(sequence, 1.5, above_6_hz);
    claim_beside("not in the paper: one multisine, 1.5 to 6 Hz, RMS [dB]", "-", "5.377", single_db, 5.33, 5.43);
    claim_beside("not in the paper: octaves are WORSE there, RMS [dB]", "-", "9.228", sequence_db, 9.13, 9.33);
    TEST_ASSERT_TRUE_MESSAGE(sequence_db > single_db, "octaves should be worse around the mode");
}

static void test_octaves_stand_a_held_force(void)
{
    struct sequential_play play = paper_play;
    double complex response[sequential_lines];
    play.held = true;
    respond(octaves, sequential_schroeder, &play, response);
    claim_beside("octaves, force held between samples, above 6 Hz, RMS [dB]", "-", "0.0191",
                 sequential_error_rms_db(response, above_6_hz, no_end_hz), 0.0, 0.03);
    if (claim_long()) {
        respond(all_lines, sequential_schroeder, &play, response);
        claim_beside("one multisine, force held between samples, above 6 Hz [dB]", "-", "4.5836",
                     sequential_error_rms_db(response, above_6_hz, no_end_hz), 4.535, 4.635);
    }
}

static void test_dwell_is_good_above_6_hz(void)
{
    struct sequential_play play = paper_play;
    double complex response[sequential_lines];
    respond(claim_long() ? dwell : every_fifth_tone, sequential_sine, &play, response);
    claim_beside("Figure 3: sine dwell, error above 6 Hz, RMS [dB]", "good", "0.0019",
                 sequential_error_rms_db(response, above_6_hz, no_end_hz), 0.0, 0.05);
    if (claim_long()) {
        play.from_rest = true;
        respond(dwell, sequential_sine, &play, response);
        claim_beside("sine dwell, each tone from rest, above 6 Hz, RMS [dB]", "-", "0.0429",
                     sequential_error_rms_db(response, above_6_hz, no_end_hz), 0.0, 0.05);
    }
}

/// After 500 s: what is left of the mode's decay is 1e-48.
static void test_band_around_the_mode_answers_with_twice_the_period(void)
{
    struct sequential_play play = {.plant = &cubic_plant_paper, .settle_periods = 50, .periods = 3};
    struct sequential_excitation sequence;
    double next = 0.0, next_but_one = 0.0;
    TEST_ASSERT_TRUE(sequential_design(octaves, sequential_schroeder, 0, &sequence));
    const struct sequential_segment *band = &sequence.segments[4];
    TEST_ASSERT_EQUAL_UINT32(16, band->bins[0]);
    play.amplitude_N = 1.0;
    TEST_ASSERT_TRUE(sequential_period_difference(band, &play, &next, &next_but_one));
    claim_beside("1.6 to 3.1 Hz, A = 1: a period from the next, share of RMS", "-", "0.619", next, 0.5, 0.75);
    claim_beside("1.6 to 3.1 Hz, A = 1: from the next but one", "-", "1e-4", next_but_one, 0.0, 1e-3);
    play.amplitude_N = 0.5;
    TEST_ASSERT_TRUE(sequential_period_difference(band, &play, &next, &next_but_one));
    claim_beside("1.6 to 3.1 Hz, A = 0.5: a period from the next", "0", "none", next, 0.0, 1e-6);
    sequential_free(&sequence);
}

static void test_harmonic_distortion_of_settled_dwell(void)
{
    static const struct {
        size_t line; ///< 0.1 Hz
        double distortion_db;
    } settled[] = {{1, -77.56},  {7, -23.67},  {10, -31.71}, {15, -29.47}, {20, -20.02},
                   {22, -15.83}, {40, -57.18}, {50, -76.44}, {91, -108.65}};
    const struct sequential_play play = {
        .plant = &cubic_plant_paper, .amplitude_N = 1.0, .settle_periods = 5, .periods = 1};
    struct sequential_excitation tones;
    TEST_ASSERT_TRUE(sequential_design(dwell, sequential_sine, 0, &tones));
    for (size_t i = 0; i < sizeof settled / sizeof *settled; i++) {
        struct cubic_state state = {0};
        char claim[80], reference[16];
        const double ours_db = sequential_harmonic_distortion_db(&tones.segments[settled[i].line - 1], &play, &state);
        snprintf(claim, sizeof claim, "harmonic distortion at %.1f Hz, 50 s to settle [dB]",
                 0.1 * (double)settled[i].line);
        snprintf(reference, sizeof reference, "%.2f", settled[i].distortion_db);
        claim_beside(claim, "figure (other)", reference, ours_db, settled[i].distortion_db - 0.1,
                     settled[i].distortion_db + 0.1);
    }
    sequential_free(&tones);
}

static double mean_square_root(size_t count, const double *values)
{
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum += values[i] * values[i];
    }
    return sqrt(sum / (double)count);
}

/// Up to 25 Hz, or up to 2.5 Hz where the test is short: what is claimed does not depend on the number of lines.
static void test_signal_to_noise_ratios_are_equal(void)
{
    enum { runs = 200, judged = 4 };
    static const struct {
        const char *name;
        enum sequential_phases phases;
        const char *lines[2];
        const char *reference;
    } kinds[] = {
        {"one multisine", sequential_schroeder, {"linear:0.1:2.5:0.1", "linear:0.1:25:0.1"}, "0.91 .. 1.02"},
        {"octaves", sequential_schroeder, {"octaves:0.1:2.5:0.1", "octaves:0.1:25:0.1"}, "0.98 .. 1.04"},
        {"sine dwell", sequential_sine, {"dwell:0.1:2.5:0.1", "dwell:0.1:25:0.1"}, "0.91 .. 1.08"},
    };
    static const uint32_t bins[2][judged] = {{1, 7, 13, 25}, {1, 21, 91, 200}};
    const double noise_m = 0.01;
    const double expected = 2.0 * noise_m / sqrt(sequential_samples);
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        struct sequential_excitation excitation;
        double std[judged];
        char claim[80];
        TEST_ASSERT_TRUE(sequential_design(kinds[i].lines[claim_long()], kinds[i].phases, 0, &excitation));
        TEST_ASSERT_TRUE(sequential_scatter(&excitation, judged, bins[claim_long()], noise_m, runs, 20 + i, std));
        snprintf(claim, sizeof claim, "(6.7), (6.8) std of G over 2 sigma / sqrt(5000), %s", kinds[i].name);
        claim_beside(claim, "equal", kinds[i].reference, mean_square_root(judged, std) / expected, 0.9, 1.1);
        sequential_free(&excitation);
    }
}

static void test_two_inputs_at_once(void)
{
    struct sequential_inputs together, apart;
    TEST_ASSERT_TRUE(sequential_two_inputs(true, 10.0, &together));
    TEST_ASSERT_TRUE(sequential_two_inputs(false, 10.0, &apart));
    claim_beside("8: two inputs together, test time [s]", "2580", "2600", together.test_time_s, 2600, 2600);
    claim_beside("8: one after the other, test time [s]", "5160", "5160", apart.test_time_s, 5160, 5160);
    claim_beside("8: together, 10 s to settle, force on mass 1, worst line [dB]", "-", "0.273", together.error_db[0],
                 0.26, 0.29);
    claim_beside("8: together, 10 s to settle, force on mass 2, worst line [dB]", "-", "0.018", together.error_db[1],
                 0.01, 0.025);
    TEST_ASSERT_TRUE(sequential_two_inputs(true, 200.0, &together));
    claim_beside("8: together, 200 s to settle, force on mass 1, worst line [dB]", "0", "2.4e-11", together.error_db[0],
                 0.0, 1e-6);
    claim_beside("8: together, 200 s to settle, force on mass 2, worst line [dB]", "0", "2.4e-11", together.error_db[1],
                 0.0, 1e-6);
}

static void test_detection_lines_show_the_scatter(void)
{
    struct sequential_levels levels[sequential_bands];
    TEST_ASSERT_TRUE(sequential_distortion("random-odd:0.1:25:0.1", &cubic_plant_paper, 1.0, 10, 1, levels));
    const double off_db = levels[sequential_bands - 1].odd_db - levels[sequential_bands - 1].stochastic_db;
    claim_beside("random-odd, A = 1, above 6 Hz: detected minus stochastic [dB]", "-", "0.1", off_db, -4.0, 4.0);
}

static size_t static_draws(void)
{
    return claim_long() ? 100 : 40;
}

static void check_static(const char *name, const char *lines, double a2, double a3, const char *reference,
                         double coherent_db, double stochastic_db)
{
    const double room_db = 0.8; // 40 draws scatter by 0.2 dB, and the reference had other phases
    const double none_db = -250.0;
    struct sequential_levels levels;
    char claim[80];
    TEST_ASSERT_TRUE(sequential_static(lines, a2, a3, static_draws(), 1, &levels));
    const bool none = coherent_db < none_db;
    snprintf(claim, sizeof claim, "u + %g u^2 + %g u^3, %s: coherent [dB]", a2, a3, name);
    claim_beside(claim, none ? "none" : "none (A3)", reference, levels.coherent_db,
                 none ? -INFINITY : coherent_db - room_db, none ? none_db : coherent_db + room_db);
    snprintf(claim, sizeof claim, "u + %g u^2 + %g u^3, %s: stochastic [dB]", a2, a3, name);
    claim_beside(claim, none ? "none" : "none (A3)", reference, levels.stochastic_db,
                 none ? -INFINITY : stochastic_db - room_db, none ? none_db : stochastic_db + room_db);
}

/// In an octave the square leaves nothing; the cube leaves almost as much as in one multisine of all lines.
static void test_polynomial_in_the_band_itself(void)
{
    struct sequential_levels levels;
    TEST_ASSERT_TRUE(sequential_static(all_lines, 0.1, 0.0, static_draws(), 1, &levels));
    claim_beside("u + 0.1 u^2, one multisine: stochastic [dB]", "some", "-21.3", levels.stochastic_db, -21.9, -20.7);
    check_static("octaves", octaves, 0.1, 0.0, "none", -INFINITY, -INFINITY);
    check_static("odd lines", "odd:0.1:25:0.1", 0.1, 0.0, "none", -INFINITY, -INFINITY);
    check_static("one multisine", all_lines, 0.0, 0.1, "-16.4/-19.9", -16.4, -19.9);
    check_static("octaves", octaves, 0.0, 0.1, "-16.6/-21.8", -16.6, -21.8);
}

static void test_products_in_a_band_of_one_octave(void)
{
    static const size_t lowest[] = {4, 16, 64};
    static const double triples[] = {44, 2736, 174784};
    static const double trivial[] = {28, 496, 8128};
    for (size_t i = 0; i < 3; i++) {
        struct sequential_products products;
        char claim[80], reference[24];
        TEST_ASSERT_TRUE(sequential_count_products(lowest[i], &products));
        snprintf(claim, sizeof claim, "[%zu, %zu): lines hit by 2f, 3f, f1 + f2, f1 - f2", lowest[i], 2 * lowest[i]);
        claim_beside(claim, "0", "0", (double)(products.second_order + products.third_harmonics), 0, 0);
        snprintf(claim, sizeof claim, "[%zu, %zu]: lines hit if the upper edge is closed", lowest[i], 2 * lowest[i]);
        claim_beside(claim, "-", "2", (double)products.second_inclusive, 2, 2);
        snprintf(claim, sizeof claim, "[%zu, %zu): triples with f1 + f2 - f3 in the band", lowest[i], 2 * lowest[i]);
        snprintf(reference, sizeof reference, "%.0f", triples[i]);
        claim_beside(claim, "none (A3)", reference, (double)products.triples, triples[i], triples[i]);
        snprintf(claim, sizeof claim, "[%zu, %zu): of those f3 = f1 or f2", lowest[i], 2 * lowest[i]);
        snprintf(reference, sizeof reference, "%.0f", trivial[i]);
        claim_beside(claim, "none (A3)", reference, (double)products.trivial, trivial[i], trivial[i]);
    }
}

int main(void)
{
    UNITY_BEGIN();
    printf("%-64s %14s %14s %12s   %s\n", "claim", "paper", "reference", "ours", "required");
    RUN_TEST(test_plant_is_the_papers);
    RUN_TEST(test_test_times_are_the_papers);
    RUN_TEST(test_peak_grows_with_the_root_of_the_lines);
    RUN_TEST(test_octaves_are_better_above_6_hz_and_worse_around_the_mode);
    RUN_TEST(test_octaves_stand_a_held_force);
    RUN_TEST(test_dwell_is_good_above_6_hz);
    RUN_TEST(test_band_around_the_mode_answers_with_twice_the_period);
    RUN_TEST(test_harmonic_distortion_of_settled_dwell);
    RUN_TEST(test_signal_to_noise_ratios_are_equal);
    RUN_TEST(test_two_inputs_at_once);
    RUN_TEST(test_detection_lines_show_the_scatter);
    RUN_TEST(test_polynomial_in_the_band_itself);
    RUN_TEST(test_products_in_a_band_of_one_octave);
    return UNITY_END();
}
