/* SPDX-License-Identifier: MIT */
#include "lab/estimate/settle.h"

#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdlib.h>

enum { fewest_periods = 4 };

static const double chance_of_false_alarm = 1e-3;
/// Rounding leaves scatter of about this share of a line's power; below it a deviation means nothing.
static const double rounding_power = 1e-28;
/// A transient is measured where its power is this many times the scatter's.
static const double measurable = 4.0;

static double power(double complex z)
{
    return creal(z) * creal(z) + cimag(z) * cimag(z);
}

/// The usable periods of the later half: what a settled period looks like on one line.
struct reference {
    size_t count;
    double complex mean;
    double variance;
};

static struct reference later_half(const double complex *spectra, size_t periods, size_t bin_count, const bool *usable,
                                   size_t bin)
{
    struct reference self = {0};
    for (size_t p = periods / 2; p < periods; p++) {
        if (usable[p]) {
            self.mean += spectra[p * bin_count + bin];
            self.count++;
        }
    }
    self.mean /= self.count > 0 ? (double)self.count : 1.0;
    for (size_t p = periods / 2; p < periods && self.count > 1; p++) {
        if (usable[p]) {
            self.variance += power(spectra[p * bin_count + bin] - self.mean) / (double)(self.count - 1);
        }
    }
    self.variance += rounding_power * power(self.mean);
    return self;
}

/// Everything about one period against the later half, summed over lines.
struct comparison {
    double log_chance; ///< log P
    double deviation;  ///< |Y_p - Ybar|^2
    double scatter;    ///< what that is without a transient
    double signal;     ///< |Ybar|^2
};

static void compare_line(const double complex *spectra, size_t periods, size_t bin_count, const struct reference *line,
                         size_t bin, struct comparison *io_periods)
{
    double expected = line->variance * (1.0 + 1.0 / (double)line->count);
    double dof = (double)line->count - 1.0;
    for (size_t p = 0; p < periods; p++) {
        double deviation = power(spectra[p * bin_count + bin] - line->mean);
        io_periods[p].log_chance -= expected > 0.0 ? dof * log1p(deviation / expected / dof) : 0.0;
        io_periods[p].deviation += deviation;
        io_periods[p].scatter += expected;
        io_periods[p].signal += power(line->mean);
    }
}

static bool is_unsettled(const struct comparison *period, size_t bin_count)
{
    return statistics_chi2_tail(-2.0 * period->log_chance, 2.0 * (double)bin_count) < chance_of_false_alarm;
}

static void judge(const struct comparison *compared, size_t periods, size_t bin_count, const bool *usable,
                  struct settle *out_settle, double *out_level)
{
    double excess[2] = {0.0, 0.0};
    bool leading = true;
    for (size_t p = 0; p < periods; p++) {
        const struct comparison *period = &compared[p];
        out_level[p] = period->signal > 0.0 ? sqrt(period->deviation / period->signal) : 0.0;
        if (p < 2 && usable[p] && period->deviation > measurable * period->scatter) {
            excess[p] = period->deviation - period->scatter;
        }
        leading = leading && p < periods / 2 && (!usable[p] || is_unsettled(period, bin_count));
        out_settle->periods += leading;
    }
    out_settle->settled = out_settle->periods < periods / 2;
    if (excess[0] > 0.0 && excess[1] > 0.0) {
        out_settle->decay_per_period = sqrt(excess[1] / excess[0]);
    }
}

bool settle_measure(const double complex *spectra, size_t periods, size_t bin_count, const bool *usable,
                    struct settle *out_settle, double *out_level)
{
    *out_settle = (struct settle){0};
    size_t usable_late = 0;
    for (size_t p = 0; p < periods; p++) {
        out_level[p] = 0.0;
        usable_late += p >= periods / 2 && usable[p];
    }
    if (periods < fewest_periods || usable_late < 2 || bin_count == 0) {
        return true;
    }
    struct comparison *compared = calloc(periods, sizeof *compared);
    if (!compared) {
        return false;
    }
    for (size_t b = 0; b < bin_count; b++) {
        struct reference line = later_half(spectra, periods, bin_count, usable, b);
        compare_line(spectra, periods, bin_count, &line, b, compared);
    }
    judge(compared, periods, bin_count, usable, out_settle, out_level);
    free(compared);
    return true;
}
