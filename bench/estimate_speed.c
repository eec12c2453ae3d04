/* SPDX-License-Identifier: MIT */
/// Times method mean and method lpm on recordings that it writes for numpy too (bench/estimate.sh).
/// usage: estimate_speed FOLDER
/// For every case METHOD-N-PERIODS a file .f64 with input then output, periods x N doubles each (unless it is there
/// from the run before), and one -result.f64 with real, imaginary part and standard deviation, lines each; on standard
/// output one line of JSON per case.
#include "lab/estimate/frf_lpm.h"
#include "lab/estimate/frf_mean.h"
#include "lab/numeric/fft.h"
#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { repeats = 15, rows_at_least = 2000000, lpm_periods = 8, many_periods = 200 };

static const double two_pi = 6.283185307179586476925;

static double now_s(void)
{
    struct timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static void stop(const char *what)
{
    fprintf(stderr, "estimate_speed: %s\n", what);
    exit(1);
}

/// One period of a flat multisine with random phases on bins 1 .. lines.
static void make_period(size_t length, size_t lines, struct random *random, double *out)
{
    double *in = calloc(4 * length, sizeof *in);
    struct fft_plan *plan = fft_plan_create(length);
    if (!in || !plan) {
        stop("memory is short");
    }
    for (size_t k = 1; k <= lines; k++) {
        double phase = two_pi * random_uniform(random);
        in[2 * k] = cos(phase) / sqrt((double)lines);
        in[2 * k + 1] = sin(phase) / sqrt((double)lines);
    }
    fft_inverse(plan, in, in + 2 * length);
    for (size_t n = 0; n < length; n++) {
        out[n] = in[2 * length + 2 * n];
    }
    free(in);
    fft_plan_destroy(plan);
}

/// From rest through a resonance, noise on both sides.
static void make_run(size_t length, size_t periods, size_t lines, struct run *out_run)
{
    static char path[] = "speed";
    struct random random;
    double state[2] = {0.0, 0.0};
    random_seed(&random, length);
    *out_run = (struct run){
        .path = path, .sample_rate_hz = 1000.0, .rows = length * periods, .period_samples = length, .bin_count = lines};
    out_run->bins = malloc(lines * sizeof *out_run->bins);
    double *period = malloc(length * sizeof *period);
    if (!out_run->bins || !period || !run_add_column(out_run, "torque_Nm") ||
        !run_add_column(out_run, "velocity_rad_per_s")) {
        stop("memory is short");
    }
    for (size_t k = 0; k < lines; k++) {
        out_run->bins[k] = (uint32_t)k + 1;
    }
    make_period(length, lines, &random, period);
    for (size_t n = 0; n < out_run->rows; n++) {
        double input = period[n % length];
        double output = state[0];
        out_run->columns[0].data[n] = input + 0.01 * random_normal(&random);
        out_run->columns[1].data[n] = output + 0.1 * random_normal(&random);
        state[0] = 1.16461859 * output + state[1] + 0.4096763 * input;
        state[1] = -0.98132699 * output + 0.4070321 * input;
    }
    free(period);
}

static void write_doubles(const char *folder, const char *name, const double *const *parts, size_t part_count,
                          size_t count)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/%s.f64", folder, name);
    FILE *stream = fopen(path, "rb");
    if (stream) {
        fclose(stream);
        return;
    }
    stream = fopen(path, "wb");
    for (size_t i = 0; i < part_count; i++) {
        if (!stream || fwrite(parts[i], sizeof(double), count, stream) != count) {
            stop("cannot write");
        }
    }
    fclose(stream);
}

typedef int estimator(const struct periodic *, const struct estimate_options *, struct frf *, struct error *);

/// The best of a few runs: cutting into periods and the estimate, from rows in memory to the response.
static void time_method(const char *folder, const char *name, estimator *estimate, const struct run *run, size_t settle)
{
    const struct periodic_options cut = {.settle = periodic_settle_given, .settle_periods = settle};
    const struct estimate_options tuning = {.order = 2, .half_width = 6};
    double best = INFINITY;
    for (int r = 0; r < repeats; r++) {
        struct periodic recording;
        struct frf frf;
        struct error error;
        double start = now_s();
        if (periodic_cut(run, &cut, &recording, &error) || estimate(&recording, &tuning, &frf, &error)) {
            stop(error.message);
        }
        best = fmin(best, now_s() - start);
        if (r == 0) {
            const double *const parts[] = {frf.real, frf.imag, frf.std};
            char file[64];
            snprintf(file, sizeof file, "%s-%zu-%zu-result", name, run->period_samples,
                     run->rows / run->period_samples);
            write_doubles(folder, file, parts, 3, frf.count);
        }
        frf_free(&frf);
        periodic_free(&recording);
    }
    printf("{\"method\": \"%s\", \"period_samples\": %zu, \"periods\": %zu, \"lines\": %zu, \"settle\": %zu, "
           "\"seconds\": %.6g}\n",
           name, run->period_samples, run->rows / run->period_samples, run->bin_count, settle, best);
}

static void measure(const char *folder, const char *method, estimator *estimate, size_t length, size_t periods,
                    size_t settle)
{
    struct run run;
    char name[64];
    make_run(length, periods, length * 2 / 5, &run);
    const double *const parts[] = {run.columns[0].data, run.columns[1].data};
    snprintf(name, sizeof name, "%s-%zu-%zu", method, length, periods);
    write_doubles(folder, name, parts, 2, run.rows);
    time_method(folder, method, estimate, &run, settle);
    run.path = NULL;
    run_free(&run);
}

int main(int argc, char **argv)
{
    /* Multiples of four with small prime factors; a prime, one with many factors, an odd one, one twice an odd one. */
    static const size_t lengths[] = {2000, 10000, 16384, 65536, 10007, 10010, 3125, 1250};
    enum { sizes = sizeof lengths / sizeof lengths[0], with_lpm = 4 };
    static const size_t few_periods[] = {3, 6, 20};
    if (argc != 2) {
        stop("expected one folder");
    }
    for (size_t i = 0; i < sizes; i++) {
        measure(argv[1], "mean", frf_mean_estimate, lengths[i], rows_at_least / lengths[i] + 2, 1);
        if (i < with_lpm) {
            measure(argv[1], "lpm", frf_lpm_estimate, lengths[i], lpm_periods, 0);
        }
    }
    for (size_t i = 0; i < sizeof few_periods / sizeof few_periods[0]; i++) {
        measure(argv[1], "mean", frf_mean_estimate, lengths[1], few_periods[i], 1);
    }
    /* Many periods and few lines: numpy's cost is in the lines, ours in the rows. */
    measure(argv[1], "lpm", frf_lpm_estimate, lengths[0], many_periods, 0);
    return 0;
}
