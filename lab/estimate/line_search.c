/* SPDX-License-Identifier: MIT */
#include "lab/estimate/line_search.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/columns.h"
#include "lab/estimate/ramp.h"
#include "lab/estimate/spectra.h"
#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { neighbours = 17 }; ///< on each side, as far as there are so many

static const double smallest_line = 0.01;
/// Excited lines stand this far above those that a loop or a nonlinearity makes of them.
static const double clear_gap = 3.0;
static const double chance_of_false_line = 1e-6;
static const double chance_of_doubt = 1e-2;
/// Scatter that is so unlikely to be the neighbours' is a bin's own.
static const double chance_of_own_scatter = 1e-5;
/// A bin with scatter of its own is certain from this chance on: two phases alike within some degrees.
static const double chance_with_own_scatter = 5e-3;
/// How much of what is counted the median tells: 1/(n ln(2)^2) relative variance for exponential numbers.
static const double efficiency_of_median = 0.48;
/// Two medians that differ by more than this chance explains are not those of one level.
static const double chance_of_level = 1e-2;
/// Exponent of a frequency that noise rises with towards the lowest bins, at most.
static const double steepest_noise = -4.0;
static const double rounding = 1e-12;
/// What is so small against the largest line distorts nothing that anybody sees.
static const double smallest_doubt = 1e-6;

struct bin {
    double magnitude; ///< of the mean, drift taken out
    double variance;  ///< of one period
    double noise;     ///< that of its neighbours
    double noise_dof; ///< complex
};

static size_t list_usable(const struct run *run, size_t period_samples, size_t total, size_t *out_numbers)
{
    size_t count = 0;
    for (size_t p = 0; p < total; p++) {
        if (columns_first_lost_row(run, p * period_samples, period_samples) == 0) {
            out_numbers[count++] = p;
        }
    }
    if (count > 2 && out_numbers[0] == 0) {
        memmove(out_numbers, out_numbers + 1, --count * sizeof *out_numbers);
    }
    return count;
}

bool line_search_transform(const struct run *run, const char *column, size_t period_samples, size_t total,
                           struct line_search *out)
{
    const size_t stride = period_samples / 2 + 1;
    const double *signal = run_column(run, column);
    *out = (struct line_search){.spectra = malloc(total * stride * sizeof *out->spectra),
                                .numbers = malloc(total * sizeof *out->numbers),
                                .period_samples = period_samples};
    bool done = out->spectra && out->numbers;
    out->periods = done ? list_usable(run, period_samples, total, out->numbers) : 0;
    for (size_t i = 0; i < out->periods && done; i++) {
        const double *period = signal + out->numbers[i] * period_samples;
        done = spectra_transform_all(period, period_samples, 1, out->spectra + i * stride);
    }
    return done;
}

void line_search_free(struct line_search *self)
{
    free(self->spectra);
    free(self->numbers);
    *self = (struct line_search){.periods = 0};
}

static double square(double x)
{
    return x * x;
}

/// Means and variances of all bins, bin 0 left empty; returns below which magnitude there is only rounding.
static double measure_bins(const struct line_search *self, size_t bin_total, struct bin *out_bins)
{
    const size_t stride = self->period_samples / 2 + 1;
    const double slope = ramp_slope(self->spectra, stride, self->numbers, self->periods, self->period_samples);
    double largest = 0.0;
    for (size_t p = 0; p < self->periods; p++) {
        largest = fmax(largest, cabs(self->spectra[p * stride]));
    }
    for (size_t k = 1; k < bin_total; k++) {
        const struct circle line = circle_of_column(self->spectra, self->periods, stride, k);
        const double complex ramp = slope * ramp_transform(k, self->period_samples);
        out_bins[k] = (struct bin){.magnitude = cabs(line.mean - ramp), .variance = line.variance};
        largest = fmax(largest, fmax(cabs(ramp), out_bins[k].magnitude));
    }
    return rounding * largest;
}

/// Median of the variances of the bins from `first` to `end - 1`, as an estimate of their mean.
static double median_variance(const struct bin *bins, size_t first, size_t end, double dof)
{
    double values[2 * neighbours + 1];
    size_t count = 0;
    for (size_t k = first; k < end; k++) {
        values[count++] = bins[k].variance;
    }
    /* Median over mean of chi-square with 2 dof degrees of freedom, after Wilson and Hilferty. */
    const double share = 1.0 - 1.0 / (9.0 * dof);
    return statistics_median(values, count) / (share * share * share);
}

/// Bins from `first` to `end - 1`.
struct window {
    size_t first, end;
};

static struct window window_around(size_t k, size_t left, size_t right, size_t bin_total)
{
    return (struct window){.first = k > left + 1 ? k - left : 1,
                           .end = k + right < bin_total ? k + right + 1 : bin_total};
}

static bool is_noisier(const struct bin *bins, struct window this, struct window other, double dof)
{
    const double weight = 2.0 * efficiency_of_median * dof;
    const double high = median_variance(bins, this.first, this.end, dof);
    const double low = median_variance(bins, other.first, other.end, dof);
    return high > low &&
           (!(low > 0.0) || statistics_f_tail(high / low, weight * (double)(this.end - this.first),
                                              weight * (double)(other.end - other.first)) < chance_of_level);
}

/// Below the lowest bins there are none to compare with, and noise that falls with frequency is strongest in them:
/// where the farther half of those above is clearly less noisy than the nearer one, the slope is drawn out.
static void draw_out_noise(double dof, size_t k, size_t bin_total, struct bin *io_bins)
{
    const size_t half = neighbours / 2 + 1;
    const struct window near = window_around(k, k, half - 1, bin_total);
    const struct window far = window_around(near.end, 0, half - 1, bin_total);
    const struct window all = {near.first, far.end};
    const double low = median_variance(io_bins, near.first, near.end, dof);
    const double high = median_variance(io_bins, far.first, far.end, dof);
    struct bin *bin = &io_bins[k];
    bin->noise = median_variance(io_bins, all.first, all.end, dof);
    bin->noise_dof = efficiency_of_median * dof * (double)(all.end - all.first);
    if (high > 0.0 && is_noisier(io_bins, near, far, dof)) {
        const double near_middle = 0.5 * (double)(near.first + near.end - 1);
        const double far_middle = 0.5 * (double)(far.first + far.end - 1);
        const double slope = log(high / low) / log(far_middle / near_middle);
        bin->noise = low * fmax(1.0, pow((double)k / near_middle, fmax(steepest_noise, slope)));
        bin->noise_dof = efficiency_of_median * dof * (double)(near.end - near.first);
    }
}

/// The noisier side counts where they differ: the other one would make lines of noise.
static void estimate_noise_at(double dof, size_t k, size_t bin_total, struct bin *io_bins)
{
    const struct window all = window_around(k, neighbours, neighbours, bin_total);
    const struct window left = {all.first, k + 1};
    const struct window right = {k, all.end};
    const bool has_left = left.end - left.first > (size_t)neighbours / 2;
    const bool has_right = right.end - right.first > (size_t)neighbours / 2;
    struct window used = all;
    if (!has_left && k + 2 * neighbours < bin_total) {
        draw_out_noise(dof, k, bin_total, io_bins);
        return;
    }
    if (has_left && has_right) {
        used = is_noisier(io_bins, left, right, dof) ? left : is_noisier(io_bins, right, left, dof) ? right : all;
    }
    io_bins[k].noise = median_variance(io_bins, used.first, used.end, dof);
    io_bins[k].noise_dof = efficiency_of_median * dof * (double)(used.end - used.first);
}

/// Chance that scatter moves a mean of `periods` values so far, with a variance known to `dof` complex numbers.
static double chance_of_mean(double magnitude, double variance, double periods, double dof)
{
    return variance > 0.0 ? exp(-dof * log1p(periods * square(magnitude) / variance / dof)) : 0.0;
}

static double chance_of_noise(const struct line_search *self, const struct bin *bin)
{
    const double own_dof = (double)(self->periods - 1);
    const double dof = own_dof + bin->noise_dof;
    const double variance = (own_dof * bin->variance + bin->noise_dof * bin->noise) / dof;
    return chance_of_mean(bin->magnitude, variance, (double)self->periods, dof);
}

static bool is_certain(const struct line_search *self, const struct bin *bin)
{
    const double own_dof = (double)(self->periods - 1);
    if (!(chance_of_noise(self, bin) < chance_of_false_line)) {
        return false;
    }
    const double ratio = bin->noise > 0.0 ? bin->variance / bin->noise : 0.0;
    return statistics_f_tail(ratio, 2.0 * own_dof, 2.0 * bin->noise_dof) > chance_of_own_scatter ||
           chance_of_mean(bin->magnitude, bin->variance, (double)self->periods, own_dof) < chance_with_own_scatter;
}

static int compare_falling(const void *left, const void *right)
{
    double a = *(const double *)left;
    double b = *(const double *)right;
    return (a < b) - (a > b);
}

/// The magnitude in the middle of the widest gap between lines; 0 if no gap is as wide as `clear_gap`.
static double gap_below_excited(double *magnitudes, size_t count)
{
    double widest = clear_gap;
    double middle = 0.0;
    qsort(magnitudes, count, sizeof *magnitudes, compare_falling);
    for (size_t i = 1; i < count; i++) {
        if (magnitudes[i - 1] > widest * magnitudes[i]) {
            widest = magnitudes[i - 1] / magnitudes[i];
            middle = sqrt(magnitudes[i - 1] * magnitudes[i]);
        }
    }
    return middle;
}

/// Magnitude from which on a certain bin is an excited one.
static double least_of_excited(const struct line_search *self, const struct bin *bins, size_t bin_total, double rounded,
                               double *scratch)
{
    double largest = 0.0;
    size_t count = 0;
    for (size_t k = 1; k < bin_total; k++) {
        if (bins[k].magnitude > rounded && is_certain(self, &bins[k])) {
            scratch[count++] = bins[k].magnitude;
            largest = fmax(largest, bins[k].magnitude);
        }
    }
    size_t kept = 0;
    for (size_t i = 0; i < count; i++) {
        if (scratch[i] >= smallest_line * largest) {
            scratch[kept++] = scratch[i];
        }
    }
    return fmax(gap_below_excited(scratch, kept), smallest_line * largest);
}

bool line_search_run(const struct line_search *self, struct line_search_result *out)
{
    const size_t bin_total = (self->period_samples + 1) / 2;
    struct bin *bins = calloc(bin_total, sizeof *bins);
    double *scratch = malloc(bin_total * sizeof *scratch);
    *out = (struct line_search_result){.bins = malloc(bin_total * sizeof *out->bins),
                                       .doubtful = malloc(bin_total * sizeof *out->doubtful)};
    const bool done = bins && scratch && out->bins && out->doubtful;
    if (done) {
        const double rounded = measure_bins(self, bin_total, bins);
        for (size_t k = 1; k < bin_total; k++) {
            estimate_noise_at((double)(self->periods - 1), k, bin_total, bins);
        }
        const double least = least_of_excited(self, bins, bin_total, rounded, scratch);
        for (size_t k = 1; k < bin_total; k++) {
            if (bins[k].magnitude > rounded && bins[k].magnitude >= least && is_certain(self, &bins[k])) {
                out->bins[out->count++] = (uint32_t)k;
            } else if (bins[k].magnitude > fmax(rounded, smallest_doubt / smallest_line * least) &&
                       chance_of_noise(self, &bins[k]) < chance_of_doubt) {
                out->doubtful[out->doubtful_count++] = (uint32_t)k;
            }
        }
    }
    free(bins);
    free(scratch);
    return done;
}

void line_search_result_free(struct line_search_result *self)
{
    free(self->bins);
    free(self->doubtful);
    *self = (struct line_search_result){0};
}
