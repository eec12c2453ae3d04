/* SPDX-License-Identifier: MIT */
/// The formula for the variance of a mean response, (25)-(27) of the first paper and 2.15.1 of the third, as mended:
/// predicted over empirical variance and coverage of the 95 % circle.
///
/// Reading: spectra with circular noise of 40 dB, correlated between output and input, M = 10; then in time a closed
///          loop,
/// u = r - .5 y, G = .3 q / (1 - .9 q), coloured disturbance, sensor noise on both sides, N = 200, 99 lines, M = 10.
#include "lab/estimate/circle.h"
#include "lab/estimate/frf_lpm.h"
#include "lab/estimate/frf_mean.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"
#include "tests/support/claim.h"

#include <complex.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

enum { spectra_lines = 200, periods = 10 };

void setUp(void) {}

void tearDown(void) {}

/// Sums over runs, line by line or all together.
struct tally {
    double predicted;
    double empirical;
    double covered;
    double count;
};

static void add(const struct frf *frf, size_t line, double complex exact, double factor, struct tally *io_tally)
{
    double complex deviation = frf->real[line] + frf->imag[line] * I - exact;
    TEST_ASSERT_TRUE(frf->valid[line]);
    io_tally->predicted += frf->std[line] * frf->std[line];
    io_tally->empirical += cmplx_power(deviation);
    io_tally->covered += cabs(deviation) <= factor * frf->std[line];
    io_tally->count += 1.0;
}

static double complex circular(struct random *random)
{
    double real = random_normal(random);
    double imaginary = random_normal(random);
    return (real + imaginary * I) * sqrt(0.5);
}

struct made_recording {
    struct run run;
    struct periodic periodic;
    uint32_t bins[spectra_lines];
    double complex input[periods * spectra_lines];
    double complex output[periods * spectra_lines];
};

static struct made_recording *make_recording(void)
{
    static char path[] = "made";
    struct made_recording *self = calloc(1, sizeof *self);
    TEST_ASSERT_NOT_NULL(self);
    self->run = (struct run){.path = path, .sample_rate_hz = 1000.0, .period_samples = 1000};
    self->periodic = (struct periodic){.run = &self->run,
                                       .input = "torque_Nm",
                                       .output = "velocity_rad_per_s",
                                       .period_samples = 1000,
                                       .bin_count = spectra_lines,
                                       .bins = self->bins,
                                       .total = periods,
                                       .used = periods,
                                       .input_spectra = self->input,
                                       .output_spectra = self->output};
    for (uint32_t b = 0; b < spectra_lines; b++) {
        self->bins[b] = b + 1;
    }
    return self;
}

/// 20000 runs: 100 recordings of 200 lines; the coverage then scatters by .15 %, the variance by .7 %. Long: 10 times
/// that.
static void check_formula(const char *name, double complex input, double complex output, double complex rho)
{
    struct made_recording *recording = make_recording();
    struct random random;
    struct tally tally = {0};
    char claim[96];
    double rest = sqrt(1.0 - cmplx_power(rho));
    double factor = circle_confidence_factor(0.95, periods - 1);
    random_seed(&random, 24);
    for (int r = 0; r < (claim_long() ? 1000 : 100); r++) {
        struct frf frf;
        struct error error = {0};
        for (size_t i = 0; i < periods * spectra_lines; i++) {
            double complex noise = circular(&random);
            recording->input[i] = input + 0.01 * noise;
            recording->output[i] = output + 0.01 * (rho * noise + rest * circular(&random));
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_mean_estimate(&recording->periodic, NULL, &frf, &error), error.message);
        for (size_t line = 0; line < spectra_lines; line++) {
            add(&frf, line, output / input, factor, &tally);
        }
        frf_free(&frf);
    }
    free(recording);
    snprintf(claim, sizeof claim, "variance over empirical, %s", name);
    claim_within(claim, "1", tally.predicted / tally.empirical, 0.97, 1.03);
    snprintf(claim, sizeof claim, "coverage of the 95 %% circle, %s [%%]", name);
    claim_within(claim, "95", 100.0 * tally.covered / tally.count, 94.5, 95.5);
}

static void test_variance_is_right_whatever_the_correlation(void)
{
    check_formula("no correlation", 1.0, 1.0, 0.0);
    check_formula(".9 at 1.2 rad", 1.0, 1.0, 0.9 * cexp(1.2 * I));
    check_formula(".9, phases 1.0, 2.5", cexp(2.5 * I), cexp(1.0 * I), 0.9);
    check_formula("-.8, phases 1.5, 1.5", cexp(1.5 * I), cexp(1.5 * I), -0.8);
}

enum { length = 200, lines = 99, settle = 2, rows = length * (settle + periods) };

static double complex truth(size_t bin)
{
    double complex q = cexp(-I * two_pi * (double)bin / length);
    return 0.3 * q / (1.0 - 0.9 * q);
}

static void prepare_loop(struct run *run, double *out_reference)
{
    static char path[] = "loop";
    struct random random;
    random_seed(&random, 99);
    *run = (struct run){.path = path,
                        .sample_rate_hz = 1000.0,
                        .rows = rows,
                        .period_samples = length,
                        .periods = periods,
                        .settle_periods = settle,
                        .has_settle_periods = true,
                        .bin_count = lines};
    run->bins = malloc(lines * sizeof *run->bins);
    TEST_ASSERT_NOT_NULL(run->bins);
    memset(out_reference, 0, length * sizeof *out_reference);
    for (uint32_t b = 0; b < lines; b++) {
        double phase = two_pi * random_uniform(&random);
        run->bins[b] = b + 1;
        for (size_t n = 0; n < length; n++) {
            out_reference[n] += cos(two_pi * (double)((b + 1) * n % length) / length + phase);
        }
    }
    TEST_ASSERT_NOT_NULL(run_add_column(run, "torque_Nm"));
    TEST_ASSERT_NOT_NULL(run_add_column(run, "velocity_rad_per_s"));
}

static void simulate_loop(const double *reference, struct random *random, struct run *io_run)
{
    double state = 0.0;
    double disturbance = 0.0;
    for (size_t n = 0; n < io_run->rows; n++) {
        disturbance = 0.8 * disturbance + 0.02 * random_normal(random);
        double measured = state + disturbance + 0.01 * random_normal(random);
        double input = reference[n % length] - 0.5 * measured;
        io_run->columns[0].data[n] = input + 0.01 * random_normal(random);
        io_run->columns[1].data[n] = measured;
        state = 0.9 * state + 0.3 * input;
    }
}

typedef int estimator(const struct periodic *, const struct estimate_options *, struct frf *, struct error *);

static void run_loop(int runs, estimator *estimate, struct tally *out_tallies)
{
    struct run run;
    struct random random;
    double reference[length];
    prepare_loop(&run, reference);
    random_seed(&random, 7);
    memset(out_tallies, 0, lines * sizeof *out_tallies);
    for (int r = 0; r < runs; r++) {
        struct periodic recording;
        struct frf frf;
        struct error error = {0};
        simulate_loop(reference, &random, &run);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, periodic_cut(&run, &(struct periodic_options){0}, &recording, &error),
                                      error.message);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, estimate(&recording, NULL, &frf, &error), error.message);
        double factor = circle_confidence_factor(0.95, frf.degrees_of_freedom / 2.0);
        for (size_t b = 0; b < lines; b++) {
            add(&frf, b, truth(b + 1), factor, &out_tallies[b]);
        }
        frf_free(&frf);
        periodic_free(&recording);
    }
    run.path = NULL;
    run_free(&run);
}

/// Short runs scatter more: one line's empirical variance by 1/sqrt(runs), so that 4 times that is allowed.
static void check_loop(const char *name, estimator *estimate, double coverage_tolerance)
{
    struct tally tallies[lines];
    struct tally all = {0};
    char claim[96];
    int runs = claim_long() ? 3000 : 200;
    double slack = claim_long() ? 0.0 : 4.0 / sqrt(runs) - 0.1;
    double lowest = INFINITY;
    double highest = 0.0;
    run_loop(runs, estimate, tallies);
    for (size_t b = 0; b < lines; b++) {
        double ratio = tallies[b].predicted / tallies[b].empirical;
        lowest = fmin(lowest, ratio);
        highest = fmax(highest, ratio);
        all.predicted += tallies[b].predicted / tallies[b].empirical / lines;
        all.covered += tallies[b].covered;
        all.count += tallies[b].count;
    }
    snprintf(claim, sizeof claim, "%s in closed loop, variance over empirical, lowest line", name);
    claim_within(claim, "1", lowest, 0.90 - slack, INFINITY);
    snprintf(claim, sizeof claim, "%s in closed loop, variance over empirical, highest line", name);
    claim_within(claim, "1", highest, -INFINITY, 1.12 + 2.0 * slack);
    snprintf(claim, sizeof claim, "%s in closed loop, coverage of the 95 %% circle [%%]", name);
    claim_within(claim, "95", 100.0 * all.covered / all.count, 95.0 - coverage_tolerance, 95.0 + coverage_tolerance);
}

static void test_variance_of_mean_is_right_in_closed_loop(void)
{
    check_loop("mean", frf_mean_estimate, claim_long() ? 0.5 : 1.0);
}

/// Here the disturbance is coloured within the window of a line, which the paper's formula takes to be flat.
static void test_variance_of_lpm_is_right_in_closed_loop(void)
{
    check_loop("lpm", frf_lpm_estimate, 1.0);
}

int main(void)
{
    UNITY_BEGIN();
    claim_title();
    RUN_TEST(test_variance_is_right_whatever_the_correlation);
    RUN_TEST(test_variance_of_mean_is_right_in_closed_loop);
    RUN_TEST(test_variance_of_lpm_is_right_in_closed_loop);
    return UNITY_END();
}
