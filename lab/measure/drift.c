/* SPDX-License-Identifier: MIT */
#include "lab/measure/drift.h"

#include "lab/numeric/fft.h"
#include "lab/numeric/statistics.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>

enum { compared = measure_velocity + 1, halves = 2 };

/// Sums over the periods of each half, for each quantity and line.
struct sums {
    double complex *mean[halves][compared]; ///< the sum until it is divided
    double *square[halves][compared];       ///< of the sizes
};

static bool counts(const struct measure_summary *summary, size_t period)
{
    const size_t length = summary->run->period_samples;
    for (size_t n = period * length; summary->valid && n < (period + 1) * length; n++) {
        if (!(summary->valid[n] > 0.0)) {
            return false;
        }
    }
    return true;
}

/// Two real signals in one transform: what belongs to each is even or odd under conjugation.
static void add_period(const struct measure_summary *summary, struct fft_plan *plan, size_t period, size_t half,
                       double *spectrum, struct sums *io)
{
    const size_t length = summary->run->period_samples;
    fft_forward_pair(plan, summary->column[measure_torque] + period * length, 1.0,
                     summary->column[measure_velocity] + period * length, 1.0, spectrum);
    for (size_t i = 0; i < summary->line_count; i++) {
        const size_t bin = msgen_table_bin(summary->table, (uint32_t)i);
        const double complex up = spectrum[2 * bin] + I * spectrum[2 * bin + 1];
        const double complex down = spectrum[2 * (length - bin)] - I * spectrum[2 * (length - bin) + 1];
        const double complex values[compared] = {0.5 * (up + down), -0.5 * I * (up - down)};
        for (size_t q = 0; q < compared; q++) {
            io->mean[half][q][i] += values[q];
            io->square[half][q][i] += creal(values[q] * conj(values[q]));
        }
    }
}

static double distance(const struct sums *sums, const size_t periods[halves], size_t quantity, size_t line)
{
    double scatter = 0.0;
    double complex mean[halves];
    for (size_t h = 0; h < halves; h++) {
        const double n = (double)periods[h];
        mean[h] = sums->mean[h][quantity][line] / n;
        scatter += sums->square[h][quantity][line] - n * creal(mean[h] * conj(mean[h]));
    }
    const double variance = scatter / (double)(periods[0] + periods[1] - halves);
    const double std = sqrt(variance * (1.0 / (double)periods[0] + 1.0 / (double)periods[1]));
    return std > 0.0 ? cabs(mean[1] - mean[0]) / (2.0 * std) : NAN;
}

static void judge(const struct sums *sums, struct measure_drift *io)
{
    for (size_t q = 0; q < compared; q++) {
        for (size_t i = 0; i < io->line_count; i++) {
            io->over_two_std[q][i] = distance(sums, io->periods, q, i);
            io->beyond[q] += io->over_two_std[q][i] > 1.0;
        }
    }
    io->chance = statistics_f_tail(4.0, 2.0, 2.0 * (double)(io->periods[0] + io->periods[1] - halves));
}

static size_t count_periods(const struct measure_summary *summary)
{
    size_t count = 0;
    for (size_t p = summary->run->settle_periods; p < summary->whole; p++) {
        count += counts(summary, p);
    }
    return count;
}

static void take_periods(const struct measure_summary *summary, struct fft_plan *plan,
                         const struct measure_drift *drift, double *spectrum, struct sums *io)
{
    size_t taken = 0;
    for (size_t p = summary->run->settle_periods; p < summary->whole; p++) {
        if (counts(summary, p)) {
            add_period(summary, plan, p, taken >= drift->periods[0], spectrum, io);
            taken++;
        }
    }
}

bool measure_drift_find(const struct measure_summary *summary, struct measure_drift *out)
{
    const size_t lines = summary->line_count;
    const size_t periods = count_periods(summary);
    struct sums sums;
    *out = (struct measure_drift){.periods = {periods / 2, periods - periods / 2}, .line_count = lines};
    if (out->periods[0] < 2) {
        return true;
    }
    out->over_two_std[0] = malloc(compared * lines * sizeof(double) + 1);
    double complex *means = calloc(halves * compared * lines + 1, sizeof *means);
    double *squares = calloc(halves * compared * lines + 1, sizeof *squares);
    double *spectrum = malloc(2 * summary->run->period_samples * sizeof *spectrum);
    struct fft_plan *plan = fft_plan_create(summary->run->period_samples);
    const bool done = out->over_two_std[0] && means && squares && spectrum && plan;
    for (size_t h = 0; h < halves && done; h++) {
        for (size_t q = 0; q < compared; q++) {
            sums.mean[h][q] = means + (h * compared + q) * lines;
            sums.square[h][q] = squares + (h * compared + q) * lines;
        }
    }
    if (done) {
        out->over_two_std[1] = out->over_two_std[0] + lines;
        take_periods(summary, plan, out, spectrum, &sums);
        judge(&sums, out);
    } else {
        measure_drift_free(out);
    }
    fft_plan_destroy(plan);
    free(spectrum);
    free(squares);
    free(means);
    return done;
}

void measure_drift_free(struct measure_drift *self)
{
    free(self->over_two_std[0]);
    *self = (struct measure_drift){0};
}
