/* SPDX-License-Identifier: MIT */
#include "lab/estimate/settle.h"

#include "lab/numeric/clones.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { fewest_periods = 4 };

static const double chance_of_false_alarm = 1e-3;
/// Rounding leaves scatter of about this share of a line's power; below it a deviation means nothing.
static const double rounding_power = 1e-28;
/// Products of 1 + F/dof stay below the largest double; a deviation beyond the factor is beyond chance anyhow.
static const double largest_product = 1e100;
static const double largest_factor = 1e90;
static const double largest_step = 1e200;
/// A transient is measured where its power is this many times the scatter's.
static const double measurable = 4.0;

/// Lines are judged in blocks whose values of all periods stay in the second cache while they are passed over.
enum { block_lines = 512, block_values = 16384, fewest_block_lines = 16 };

static size_t lines_in_block(size_t periods)
{
    size_t lines = block_values / periods;
    return lines > block_lines ? block_lines : lines < fewest_block_lines ? fewest_block_lines : lines;
}

/// A block of lines: what a settled period looks like after the usable periods of the later half, line by line.
struct reference {
    double complex mean[block_lines];
    double scale[block_lines]; ///< 1 / ((1 + 1/M) variance dof); 0 without scatter
    double *deviations;        ///< |Y_p - Ybar|^2, periods x lines
};

/// All lines together.
struct totals {
    size_t count;   ///< M, usable periods of the later half
    double signal;  ///< |Ybar|^2
    double scatter; ///< of what a settled period deviates from it
};

/// Everything about one period against the later half, summed over lines.
struct comparison {
    double log_chance; ///< log P
    double deviation;  ///< |Y_p - Ybar|^2
};

/// What a line's settled periods are expected to deviate by, from the sum of their squares.
static double expected_deviation(double scatter, double complex mean, double count)
{
    return (scatter / (count - 1.0) + rounding_power * cmplx_power(mean)) * (1.0 + 1.0 / count);
}

static void subtract_mean(const double complex *spectra, const double complex *mean, size_t lines,
                          double *restrict out_deviations)
{
    for (size_t b = 0; b < lines; b++) {
        out_deviations[b] = cmplx_power(spectra[b] - mean[b]);
    }
}

/// `spectra` begins at the block's first line.
CLONED_FOR_AVX2 static void make_reference(const double complex *spectra, size_t periods, size_t bin_count,
                                           size_t lines, const bool *usable, struct totals *io_totals,
                                           struct reference *io_self)
{
    memset(io_self->mean, 0, sizeof io_self->mean);
    memset(io_self->scale, 0, sizeof io_self->scale);
    for (size_t p = periods / 2; p < periods; p++) {
        for (size_t b = 0; b < lines && usable[p]; b++) {
            io_self->mean[b] += spectra[p * bin_count + b];
        }
    }
    for (size_t b = 0; b < lines; b++) {
        io_self->mean[b] /= (double)io_totals->count;
    }
    for (size_t p = 0; p < periods; p++) {
        double *deviations = io_self->deviations + p * lines;
        subtract_mean(spectra + p * bin_count, io_self->mean, lines, deviations);
        for (size_t b = 0; b < lines && usable[p] && p >= periods / 2; b++) {
            io_self->scale[b] += deviations[b];
        }
    }
    for (size_t b = 0; b < lines; b++) {
        double dof = (double)(io_totals->count - 1);
        double expected = expected_deviation(io_self->scale[b], io_self->mean[b], (double)io_totals->count);
        io_self->scale[b] = expected > 0.0 ? 1.0 / (expected * dof) : 0.0;
        io_totals->signal += cmplx_power(io_self->mean[b]);
        io_totals->scatter += expected;
    }
}

/// 1 + F/dof of one line.
static double chance_factor(double deviation, double scale)
{
    double ratio = deviation * scale;
    return 1.0 + (ratio < largest_factor ? ratio : largest_factor);
}

/// Lines judged in one step, by a tree of products and sums: in a row each would wait for the one before.
enum { step_lines = 8 };

static double sum_of_step(const double x[step_lines])
{
    return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}

static double factor_of_step(const double deviations[step_lines], const double scale[step_lines])
{
    double x[step_lines];
    for (size_t i = 0; i < step_lines; i++) {
        x[i] = 1.0 + deviations[i] * scale[i];
    }
    double product = ((x[0] * x[4]) * (x[2] * x[6])) * ((x[1] * x[5]) * (x[3] * x[7]));
    return product;
}

static void multiply(double factor, double dof, double *io_product, struct comparison *io_period)
{
    *io_product *= factor;
    if (*io_product > largest_product) {
        io_period->log_chance -= dof * log(*io_product);
        *io_product = 1.0;
    }
}

CLONED_FOR_AVX2 static void compare_period(const double *deviations, size_t lines, const double *scale, double dof,
                                           struct comparison *io_period)
{
    /* A logarithm of a product now and then in place of one for each line: most of the time went there. */
    double product = 1.0;
    size_t b = 0;
    while (b < lines) {
        if (b + step_lines <= lines) {
            double factor = factor_of_step(deviations + b, scale + b);
            if (factor < largest_step) {
                multiply(factor, dof, &product, io_period);
                io_period->deviation += sum_of_step(deviations + b);
                b += step_lines;
                continue;
            }
        }
        multiply(chance_factor(deviations[b], scale[b]), dof, &product, io_period);
        io_period->deviation += deviations[b];
        b++;
    }
    io_period->log_chance -= dof * log(product);
}

static bool is_unsettled(const struct comparison *period, size_t bin_count)
{
    return statistics_chi2_tail(-2.0 * period->log_chance, 2.0 * (double)bin_count) < chance_of_false_alarm;
}

static void judge(const struct comparison *compared, const struct totals *totals, size_t periods, size_t bin_count,
                  const bool *usable, struct settle *out_settle, double *out_level)
{
    double excess[2] = {0.0, 0.0};
    bool leading = true;
    for (size_t p = 0; p < periods; p++) {
        const struct comparison *period = &compared[p];
        const double level = totals->signal > 0.0 ? sqrt(period->deviation / totals->signal) : 0.0;
        out_level[p] = usable[p] ? level : NAN;
        if (p < 2 && usable[p] && period->deviation > measurable * totals->scatter) {
            excess[p] = period->deviation - totals->scatter;
        }
        leading = leading && p < periods / 2 && (!usable[p] || is_unsettled(period, bin_count));
        out_settle->periods = leading && usable[p] ? p + 1 : out_settle->periods;
    }
    out_settle->settled = out_settle->periods < periods / 2;
    if (excess[0] > 0.0 && excess[1] > 0.0) {
        out_settle->decay_per_period = sqrt(excess[1] / excess[0]);
    }
}

bool settle_measure(const double complex *spectra, size_t periods, size_t bin_count, const bool *usable,
                    struct settle *out_settle, double *out_level)
{
    struct totals totals = {0};
    *out_settle = (struct settle){0};
    for (size_t p = 0; p < periods; p++) {
        out_level[p] = usable[p] ? 0.0 : NAN;
        totals.count += p >= periods / 2 && usable[p];
    }
    if (periods < fewest_periods || totals.count < 2 || bin_count == 0) {
        return true;
    }
    size_t block = lines_in_block(periods);
    struct reference *reference = malloc(sizeof *reference);
    struct comparison *compared = calloc(periods, sizeof *compared);
    double *deviations = malloc(block * periods * sizeof *deviations);
    bool done = reference && compared && deviations;
    for (size_t first = 0; first < bin_count && done; first += block) {
        size_t lines = bin_count - first < block ? bin_count - first : block;
        reference->deviations = deviations;
        make_reference(spectra + first, periods, bin_count, lines, usable, &totals, reference);
        for (size_t p = 0; p < periods; p++) {
            compare_period(deviations + p * lines, lines, reference->scale, (double)(totals.count - 1), &compared[p]);
        }
    }
    if (done) {
        judge(compared, &totals, periods, bin_count, usable, out_settle, out_level);
    }
    free(reference);
    free(compared);
    free(deviations);
    return done;
}

bool settle_differs(const double complex *period, const struct settle_reference *reference, double *out_level,
                    double *out_excess)
{
    const double count = (double)reference->count;
    struct comparison compared = {0.0, 0.0};
    double signal = 0.0;
    double scatter = 0.0;
    double product = 1.0;
    for (size_t b = 0; b < reference->bin_count; b++) {
        const double expected = expected_deviation(reference->scatter[b], reference->mean[b], count);
        const double deviation = cmplx_power(period[b] - reference->mean[b]);
        product *= chance_factor(deviation, expected > 0.0 ? 1.0 / (expected * (count - 1.0)) : 0.0);
        if (product > largest_product) {
            compared.log_chance -= (count - 1.0) * log(product);
            product = 1.0;
        }
        compared.deviation += deviation;
        signal += cmplx_power(reference->mean[b]);
        scatter += expected;
    }
    compared.log_chance -= (count - 1.0) * log(product);
    *out_level = signal > 0.0 ? sqrt(compared.deviation / signal) : 0.0;
    *out_excess = compared.deviation > measurable * scatter ? compared.deviation - scatter : 0.0;
    return is_unsettled(&compared, reference->bin_count);
}
