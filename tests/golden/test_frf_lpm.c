/* SPDX-License-Identifier: MIT */
/// Third paper, sections 2.9 and 2.14.4: its example system from rest, transient decay, and the local polynomial method
/// beside no window and a Hann window.
///
/// Reading: b = [0, .4096763, .4070321], a = [1, -1.16461859, .98132699] (a resonance at .15 of the rate, damping .01).
/// 2.9: all lines of the period, flat, random phases, RMS 1, noise-free, 20 periods; the paper's N is not said.
/// 2.14.4: N = 16384, P = 2, lines 1 .. 5000 flat with random phases, RMS 1, white noise of .2 on the output, R = 2,
/// n = 6; RMS error over 100 noise runs of one multisine, averaged over windows of 50 lines. Window 49 (lines
/// 2451 .. 2500) is at the resonance; "far away" is the mean over windows 1 .. 20 and 81 .. 100.
#include "lab/estimate/frf_lpm.h"
#include "lab/estimate/frf_mean.h"
#include "lab/estimate/spectra.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/fft.h"
#include "lab/numeric/statistics.h"
#include "tests/support/claim.h"

#include <complex.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

void setUp(void) {}

void tearDown(void) {}

static double complex truth(double bin, double length)
{
    double complex q = cexp(-I * two_pi * bin / length);
    return (0.4096763 * q + 0.4070321 * q * q) / (1.0 - 1.16461859 * q + 0.98132699 * q * q);
}

/// One period of a flat multisine with RMS 1 on bins 1 .. lines.
static void make_multisine(size_t length, size_t lines, struct random *random, double *out_period)
{
    double *in = calloc(4 * length, sizeof *in);
    struct fft_plan *plan = fft_plan_create(length);
    TEST_ASSERT_TRUE(in && plan);
    for (size_t k = 1; k <= lines; k++) {
        double phase = two_pi * random_uniform(random);
        in[2 * k] = sqrt(2.0 / (double)lines) * cos(phase);
        in[2 * k + 1] = sqrt(2.0 / (double)lines) * sin(phase);
    }
    fft_inverse(plan, in, in + 2 * length);
    for (size_t n = 0; n < length; n++) {
        out_period[n] = in[2 * length + 2 * n];
    }
    free(in);
    fft_plan_destroy(plan);
}

static void filter(const double *u, size_t rows, double *out_y)
{
    for (size_t n = 0; n < rows; n++) {
        out_y[n] = 0.0;
        if (n >= 1) {
            out_y[n] += 0.4096763 * u[n - 1] + 1.16461859 * out_y[n - 1];
        }
        if (n >= 2) {
            out_y[n] += 0.4070321 * u[n - 2] - 0.98132699 * out_y[n - 2];
        }
    }
}

static void make_run(size_t length, size_t periods, size_t lines, struct random *random, struct run *out_run)
{
    static char path[] = "example";
    *out_run = (struct run){.path = path,
                            .sample_rate_hz = 2.0,
                            .rows = length * periods,
                            .period_samples = length,
                            .periods = periods,
                            .bin_count = lines};
    out_run->bins = malloc(lines * sizeof *out_run->bins);
    double *u = run_add_column(out_run, "torque_Nm");
    double *y = run_add_column(out_run, "velocity_rad_per_s");
    TEST_ASSERT_TRUE(out_run->bins && u && y);
    for (size_t k = 0; k < lines; k++) {
        out_run->bins[k] = (uint32_t)k + 1;
    }
    make_multisine(length, lines, random, out_run->columns[0].data);
    for (size_t p = 1; p < periods; p++) {
        memcpy(out_run->columns[0].data + p * length, out_run->columns[0].data, length * sizeof(double));
    }
    filter(out_run->columns[0].data, out_run->rows, out_run->columns[1].data);
}

static void free_run(struct run *run)
{
    run->path = NULL;
    run_free(run);
}

static void check_decay(size_t length, const char *paper)
{
    struct random random;
    struct run run;
    struct periodic recording;
    struct error error = {0};
    char claim[80];
    random_seed(&random, 40 + length);
    make_run(length, 20, length / 2 - 1, &random, &run);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error),
                                  error.message);
    double expected = exp(-0.0094248 * (double)length);
    snprintf(claim, sizeof claim, "2.9: transient per period, N = %zu", length);
    claim_within(claim, paper, recording.transient.decay_per_period, 0.99 * expected, 1.01 * expected);
    periodic_free(&recording);
    free_run(&run);
}

static void test_transient_decays_as_the_pole_says(void)
{
    check_decay(40, "0.6859");
    check_decay(100, "0.3897");
}

static void test_frf_of_period_20_has_no_transient_left(void)
{
    enum { length = 100, periods = 20 };
    const struct periodic_options options = {.settle = periodic_settle_given, .settle_periods = periods - 2};
    struct random random;
    struct run run;
    struct periodic recording;
    struct error error = {0};
    random_seed(&random, 1);
    make_run(length, periods, length / 2 - 1, &random, &run);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &options, &recording, &error), error.message);
    double sum = 0.0;
    for (size_t b = 0; b < recording.bin_count; b++) {
        size_t last = recording.bin_count + b;
        double complex response = recording.output_spectra[last] / recording.input_spectra[last];
        sum += cmplx_power(response - truth((double)recording.bins[b], length)) / (double)recording.bin_count;
    }
    claim_within("2.9: FRF error of period 20, N = 100, RMS over lines [dB]", "about -150", 10.0 * log10(sum),
                 -INFINITY, -125.0);
    periodic_free(&recording);
    free_run(&run);
}

enum { length = 16384, periods = 2, rows = length * periods, lines = 5000, windows = 100, width = 50 };
enum { noise_runs = 100, resonance = 48, near_window = 20, far_window = 80 };

enum method { rect, hann, lpm, methods };

/// Sums over noise runs of |error|^2 line by line, and of the variance that lpm predicts.
struct tally {
    double error[methods][lines];
    double predicted[lines];
};

/// Hann window over both periods, from its three lines; the method of that name wants four periods for its variance.
static double complex hann_response(const double complex *input, const double complex *output, size_t centre)
{
    double complex y = 0.5 * output[centre] - 0.25 * (output[centre - 1] + output[centre + 1]);
    double complex u = 0.5 * input[centre] - 0.25 * (input[centre - 1] + input[centre + 1]);
    return y / u;
}

static void add_run(const struct run *run, const struct estimate_options *options, double complex *spectra,
                    struct tally *io_tally)
{
    const struct periodic_options cut = {.settle = periodic_settle_keep};
    struct periodic recording;
    struct frf rectangular;
    struct frf local;
    struct error error = {0};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(run, &cut, &recording, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_mean_estimate(&recording, NULL, &rectangular, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_lpm_estimate(&recording, options, &local, &error), error.message);
    double complex *output = spectra + rows / 2 + 1;
    TEST_ASSERT_TRUE(spectra_transform_two(run->columns[0].data, run->columns[1].data, rows, spectra, output));
    for (size_t b = 0; b < lines; b++) {
        double complex exact = truth((double)(b + 1), length);
        io_tally->error[rect][b] += cmplx_power(rectangular.real[b] + rectangular.imag[b] * I - exact);
        io_tally->error[lpm][b] += cmplx_power(local.real[b] + local.imag[b] * I - exact);
        io_tally->error[hann][b] += cmplx_power(hann_response(spectra, output, periods * (b + 1)) - exact);
        io_tally->predicted[b] += local.std[b] * local.std[b];
    }
    frf_free(&rectangular);
    frf_free(&local);
    periodic_free(&recording);
}

static void simulate(uint64_t seed, const struct estimate_options *options, struct tally *out_tally)
{
    struct random random;
    struct run run;
    double *clean = malloc(rows * sizeof *clean);
    double complex *spectra = malloc(2 * (rows / 2 + 1) * sizeof *spectra);
    TEST_ASSERT_TRUE(clean && spectra);
    memset(out_tally, 0, sizeof *out_tally);
    random_seed(&random, seed);
    make_run(length, periods, lines, &random, &run);
    memcpy(clean, run.columns[1].data, rows * sizeof *clean);
    for (int r = 0; r < noise_runs; r++) {
        for (size_t n = 0; n < rows; n++) {
            run.columns[1].data[n] = clean[n] + 0.2 * random_normal(&random);
        }
        add_run(&run, options, spectra, out_tally);
    }
    free(clean);
    free(spectra);
    free_run(&run);
}

/// Mean over a window of the RMS error, in dB.
static double level_db(const struct tally *tally, enum method method, size_t window)
{
    double sum = 0.0;
    for (size_t b = window * width; b < (window + 1) * width; b++) {
        sum += sqrt(tally->error[method][b] / noise_runs) / width;
    }
    return 20.0 * log10(sum);
}

struct figures {
    double lowest_lpm_db;
    double highest_lpm_db;
    double gain_over_rect_db;   ///< at the resonance
    double smallest_gain_db;    ///< over Hann, of all windows
    double far_lpm_db;          ///< mean of the windows far from the resonance
    double predicted_over_true; ///< variance, all lines
};

static struct figures judge(const struct tally *tally)
{
    struct figures self = {.lowest_lpm_db = INFINITY, .highest_lpm_db = -INFINITY, .smallest_gain_db = INFINITY};
    double far = 0.0;
    for (size_t w = 0; w < windows; w++) {
        double level = level_db(tally, lpm, w);
        self.lowest_lpm_db = fmin(self.lowest_lpm_db, level);
        self.highest_lpm_db = fmax(self.highest_lpm_db, level);
        self.smallest_gain_db = fmin(self.smallest_gain_db, level_db(tally, hann, w) - level);
        if (w < near_window || w >= far_window) {
            self.far_lpm_db += level;
            far += 1.0;
        }
    }
    self.far_lpm_db /= far;
    self.gain_over_rect_db = level_db(tally, rect, resonance) - level_db(tally, lpm, resonance);
    double predicted = 0.0;
    double empirical = 0.0;
    for (size_t b = 0; b < lines; b++) {
        predicted += tally->predicted[b];
        empirical += tally->error[lpm][b];
    }
    self.predicted_over_true = predicted / empirical;
    return self;
}

static void check_example(uint64_t seed, const struct estimate_options *options)
{
    struct tally *tally = malloc(sizeof *tally);
    TEST_ASSERT_NOT_NULL(tally);
    simulate(seed, options, tally);
    struct figures figures = judge(tally);
    printf("multisine of seed %u, order %d; rect/Hann/LPM at the resonance %.2f/%.2f/%.2f dB\n", (unsigned)seed,
           options->order, level_db(tally, rect, resonance), level_db(tally, hann, resonance),
           level_db(tally, lpm, resonance));
    free(tally);
    const double floor_db = -19.134;
    claim_within("2.14.4: LPM level, lowest of 100 windows [dB]", "-18.4", figures.lowest_lpm_db, -18.75, -18.05);
    claim_within("2.14.4: LPM level, highest of 100 windows [dB]", "-18.4", figures.highest_lpm_db, -18.75, -18.05);
    claim_within("2.14.4: gain over rect at the resonance [dB]", "significant", figures.gain_over_rect_db, 5.0,
                 INFINITY);
    claim_within("2.14.4: LPM loss far away against the noise floor [dB]", "about 1", figures.far_lpm_db - floor_db,
                 0.654, 0.854);
    claim_within("2.14.4: gain over Hann, smallest of 100 windows [dB]", "slight", figures.smallest_gain_db, 0.0,
                 INFINITY);
    claim_within("(2.12) with 1 + leverage: variance over empirical", "(0.839)", figures.predicted_over_true, 0.97,
                 1.03);
}

static void test_lpm_keeps_its_level_through_the_resonance(void)
{
    const struct estimate_options paper = {.order = 2, .half_width = 6};
    int multisines = claim_long() ? 15 : 1;
    for (int m = 0; m < multisines; m++) {
        check_example((uint64_t)(11 + m), &paper);
    }
}

/// The order by the variance rule must cost neither level nor honesty.
static void test_lpm_of_automatic_order_is_as_good(void)
{
    check_example(11, &(struct estimate_options){.order = estimate_order_auto});
}

int main(void)
{
    UNITY_BEGIN();
    claim_title();
    RUN_TEST(test_transient_decays_as_the_pole_says);
    RUN_TEST(test_frf_of_period_20_has_no_transient_left);
    RUN_TEST(test_lpm_keeps_its_level_through_the_resonance);
    if (claim_long()) {
        RUN_TEST(test_lpm_of_automatic_order_is_as_good);
    }
    return UNITY_END();
}
