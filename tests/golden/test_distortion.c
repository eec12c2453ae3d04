/* SPDX-License-Identifier: MIT */
/// Second paper's plant at A = 1, as `frf` sees it: what free bins say of the scatter between realisations, the octave
/// that answers with twice the period, and harmonics of a dwell.
///
/// Reading: bench/sequential_study.h; random-odd lines 0.1 .. 25 Hz, ten draws of random phases, four periods after 200
///          s
/// (20 periods). Levels over |G| of the linearised plant, RMS over lines and draws.
#include "bench/sequential_study.h"
#include "lab/estimate/agreement.h"
#include "lab/estimate/distortion.h"
#include "lab/estimate/frf_mean.h"
#include "lab/estimate/harmonics.h"
#include "lab/estimate/repetition.h"
#include "lab/numeric/cmplx.h"
#include "tests/support/claim.h"

#include <math.h>
#include <string.h>

enum { draws = 10 };

static const double above_hz = 6.0;

static struct run run;
static struct periodic recording;
static struct error error;

void setUp(void) {}

void tearDown(void) {}

/// The recording as a run of a linear machine.
static void play(const struct sequential_segment *segment, const struct sequential_play *how)
{
    static char path[] = "plant";
    static struct sequential_recording played;
    struct cubic_state state = {0};
    TEST_ASSERT_TRUE(sequential_record(segment, how, &state, &played));
    run = (struct run){.path = path,
                       .sample_rate_hz = sequential_rate_hz,
                       .period_samples = sequential_samples,
                       .rows = played.periods * sequential_samples};
    double *force = run_add_column(&run, "force_N");
    double *position = run_add_column(&run, "position_m");
    TEST_ASSERT_TRUE(force && position);
    for (size_t n = 0; n < run.rows; n++) {
        force[n] = played.force_N[n % sequential_samples];
        position[n] = played.position_m[n];
    }
    free(played.position_m);
    const struct periodic_options cut = {
        .bins = segment->bins, .bin_count = segment->line_count, .settle = periodic_settle_given, .settle_periods = 0};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &cut, &recording, &error), error.message);
}

static void drop(void)
{
    periodic_free(&recording);
    run.path = NULL;
    run_free(&run);
}

static double relative_power(double level, double frequency_hz)
{
    const double magnitude = cabs(cubic_plant_response(&cubic_plant_paper, frequency_hz));
    return level * level / (magnitude * magnitude);
}

/// Sums over lines above 6 Hz of odd levels; *io_lines counts them.
static double sum_levels(const struct frf *frf, size_t *io_lines)
{
    double sum = 0.0;
    for (size_t k = 0; k < frf->count; k++) {
        if (frf->frequency_hz[k] > above_hz && frf_known(frf->odd_distortion[k])) {
            sum += relative_power(frf->odd_distortion[k], frf->frequency_hz[k]);
            (*io_lines)++;
        }
    }
    return sum;
}

static void test_free_bins_show_the_scatter_between_realisations(void)
{
    const struct sequential_play how = {
        .plant = &cubic_plant_paper, .amplitude_N = 1.0, .settle_periods = 20, .periods = 4};
    struct frf responses[draws];
    struct distortion distortion;
    struct agreement agreement;
    double detected = 0.0;
    size_t levels = 0;
    size_t late = 0;
    for (size_t d = 0; d < draws; d++) {
        struct sequential_excitation excitation;
        struct repetition repetition;
        TEST_ASSERT_TRUE(sequential_design("random-odd:0.1:25:0.1", sequential_random, 1 + d, &excitation));
        play(&excitation.segments[0], &how);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_mean_estimate(&recording, NULL, &responses[d], &error), error.message);
        TEST_ASSERT_TRUE(distortion_estimate(&recording, NULL, &responses[d], &distortion));
        TEST_ASSERT_TRUE(repetition_test(&recording, &repetition));
        late += repetition.multiple > 1;
        detected += sum_levels(&responses[d], &levels);
        drop();
        sequential_free(&excitation);
    }
    double stochastic = 0.0;
    size_t lines = 0;
    for (size_t k = 0; k < responses[0].count; k++) {
        double complex mean = 0.0;
        if (responses[0].frequency_hz[k] <= above_hz) {
            continue;
        }
        for (size_t d = 0; d < draws; d++) {
            mean += CMPLX(responses[d].real[k], responses[d].imag[k]) / draws;
        }
        for (size_t d = 0; d < draws; d++) {
            const double distance = cabs(CMPLX(responses[d].real[k], responses[d].imag[k]) - mean);
            stochastic += relative_power(distance, responses[0].frequency_hz[k]) / (draws - 1);
        }
        lines++;
    }
    TEST_ASSERT_TRUE(agreement_measure(responses, draws, &agreement));
    TEST_ASSERT_TRUE(agreement_differs(&agreement));
    const double detected_db = 10.0 * log10(detected / (double)levels);
    const double stochastic_db = 10.0 * log10(stochastic / (double)lines);
    printf("stochastic %.2f dB, detected %.2f dB; %zu of %d draws repeat after several periods only\n", stochastic_db,
           detected_db, late, draws);
    claim_within("random-odd, A = 1, > 6 Hz: detected over stochastic level, dB", "-", detected_db - stochastic_db,
                 -4.0, 4.0);
    for (size_t d = 0; d < draws; d++) {
        frf_free(&responses[d]);
    }
}

static struct repetition repetition_at(double amplitude_N)
{
    const struct sequential_play how = {
        .plant = &cubic_plant_paper, .amplitude_N = amplitude_N, .settle_periods = 50, .periods = 8};
    struct sequential_excitation sequence;
    struct repetition repetition;
    TEST_ASSERT_TRUE(sequential_design("octaves:0.1:25:0.1", sequential_schroeder, 0, &sequence));
    play(&sequence.segments[4], &how);
    TEST_ASSERT_TRUE(repetition_test(&recording, &repetition));
    drop();
    sequential_free(&sequence);
    return repetition;
}

static void test_octave_around_the_mode_repeats_after_two_periods(void)
{
    const struct repetition strong = repetition_at(1.0);
    claim_within("1.6..3.1 Hz, A = 1: repeats after so many periods", "-", strong.multiple, 2, 2);
    /* Consecutive periods differ by 2 b, their RMS is sqrt(a^2 + b^2): 0.619 is b / a = 0.325. */
    const double difference = 2.0 * strong.level / sqrt(1.0 + strong.level * strong.level);
    claim_within("1.6..3.1 Hz, A = 1: difference between periods over RMS", "-", difference, 0.5, 0.75);
    claim_within("1.6..3.1 Hz, A = 0.5: repeats after so many periods", "-", repetition_at(0.5).multiple, 1, 1);
}

static void test_dwell_has_the_harmonics_of_the_prototype(void)
{
    static const struct {
        size_t line; ///< 0.1 Hz
        double thd_db;
    } settled[] = {{1, -77.56}, {7, -23.67}, {15, -29.47}, {22, -15.83}, {91, -108.65}};
    const struct sequential_play how = {
        .plant = &cubic_plant_paper, .amplitude_N = 1.0, .settle_periods = 20, .periods = 2};
    struct sequential_excitation tones;
    TEST_ASSERT_TRUE(sequential_design("dwell:0.1:25:0.1", sequential_sine, 0, &tones));
    for (size_t i = 0; i < sizeof settled / sizeof *settled; i++) {
        struct harmonics harmonics;
        char claim[64];
        play(&tones.segments[settled[i].line - 1], &how);
        TEST_ASSERT_TRUE(harmonics_measure(&recording, &harmonics));
        drop();
        snprintf(claim, sizeof claim, "THD at %.1f Hz, dB", harmonics.frequency_hz);
        claim_within(claim, "-", harmonics.output_db, settled[i].thd_db - 0.1, settled[i].thd_db + 0.1);
    }
    sequential_free(&tones);
}

int main(void)
{
    UNITY_BEGIN();
    claim_title();
    RUN_TEST(test_free_bins_show_the_scatter_between_realisations);
    RUN_TEST(test_octave_around_the_mode_repeats_after_two_periods);
    RUN_TEST(test_dwell_has_the_harmonics_of_the_prototype);
    return UNITY_END();
}
