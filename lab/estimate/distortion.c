/* SPDX-License-Identifier: MIT */
#include "lab/estimate/distortion.h"

#include "lab/estimate/spectra.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>

enum { fewest_of_found_grid = 8 };

static const double two_pi = 6.283185307179586476925;

static const double false_alarms = 0.05;
/// Rounding leaves about this share of the strongest output line's power in every bin, the same in every period.
static const double rounding_power = 1e-28;
/// Logarithms of smaller chances are not told apart.
static const double smallest_chance = 1e-300;

/// Free bins, those of one kind after the other: kind k has first[k] .. first[k + 1] - 1, ascending.
struct free_bins {
    size_t first[distortion_kinds + 1];
    uint32_t *bins;
    double *excess; ///< |Ebar|^2 - s^2/M
    double *noise;  ///< s^2/M
};

static uint32_t common_divisor(uint32_t a, uint32_t b)
{
    while (b != 0) {
        const uint32_t rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

/// What is excited, in multiples of the greatest common divisor of all lines.
struct grid {
    uint32_t spacing;
    bool odd_only;
    uint32_t lowest, highest;
    bool *excited; ///< highest + 1
};

/// Where lines were found by their power, a bin with power may be one that was missed, and is not called distortion;
/// nor does a handful of lines that happen to be odd make a grid of odd ones.
static void keep_doubtful(const struct periodic *recording, struct grid *io_grid)
{
    for (size_t b = 0; io_grid->excited && b < recording->doubtful_count; b++) {
        const uint32_t bin = recording->doubtful[b];
        if (bin % io_grid->spacing == 0 && bin / io_grid->spacing <= io_grid->highest) {
            io_grid->excited[bin / io_grid->spacing] = true;
        }
    }
    if (recording->bins_found && recording->bin_count < fewest_of_found_grid) {
        io_grid->odd_only = false;
    }
}

static bool make_grid(const struct periodic *recording, const struct distortion_options *options, struct grid *out)
{
    *out = (struct grid){.odd_only = true};
    for (size_t b = 0; b < recording->bin_count; b++) {
        out->spacing = common_divisor(out->spacing, recording->bins[b]);
    }
    for (size_t b = 0; b < options->other_count; b++) {
        out->spacing = common_divisor(out->spacing, options->other_bins[b]);
    }
    out->lowest = recording->bins[0] / out->spacing;
    out->highest = recording->bins[recording->bin_count - 1] / out->spacing;
    out->excited = calloc((size_t)out->highest + 1, sizeof *out->excited);
    for (size_t b = 0; out->excited && b < recording->bin_count; b++) {
        const uint32_t multiple = recording->bins[b] / out->spacing;
        out->excited[multiple] = true;
        out->odd_only = out->odd_only && multiple % 2 == 1;
    }
    for (size_t b = 0; out->excited && b < options->other_count; b++) {
        const uint32_t multiple = options->other_bins[b] / out->spacing;
        if (multiple <= out->highest) {
            out->excited[multiple] = true;
        }
        out->odd_only = out->odd_only && multiple % 2 == 1;
    }
    keep_doubtful(recording, out);
    return out->excited != NULL;
}

static enum distortion_kind kind_of(const struct grid *grid, uint32_t multiple)
{
    if (!grid->odd_only) {
        return distortion_mixed;
    }
    return multiple % 2 == 1 ? distortion_odd : distortion_even;
}

static bool find_free(const struct periodic *recording, const struct distortion_options *options, struct free_bins *out)
{
    struct grid grid;
    if (!make_grid(recording, options, &grid)) {
        return false;
    }
    const size_t most = (size_t)grid.highest - grid.lowest + 1;
    size_t count = 0;
    out->bins = malloc(most * sizeof *out->bins);
    out->excess = calloc(2 * most, sizeof *out->excess);
    bool done = out->bins && out->excess;
    for (int kind = 0; kind < distortion_kinds && done; kind++) {
        out->first[kind] = count;
        for (uint32_t multiple = grid.lowest; multiple <= grid.highest; multiple++) {
            if (!grid.excited[multiple] && kind_of(&grid, multiple) == (enum distortion_kind)kind) {
                out->bins[count++] = multiple * grid.spacing;
            }
        }
    }
    out->first[distortion_kinds] = count;
    out->noise = done ? out->excess + most : NULL;
    free(grid.excited);
    return done;
}

static void free_free_bins(struct free_bins *self)
{
    free(self->bins);
    free(self->excess);
}

/// Index of the first of `count` ascending bins that is not below `bin`.
static size_t first_from(const uint32_t *bins, size_t count, uint32_t bin)
{
    size_t low = 0;
    while (count > 0) {
        const size_t half = count / 2;
        const bool right = bins[low + half] < bin;
        low += right ? half + 1 : 0;
        count = right ? count - half - 1 : half;
    }
    return low;
}

/// The response at a bin between lines, on a straight line between the two valid ones beside it.
static double complex response_at(const struct periodic *recording, const struct frf *frf, uint32_t bin)
{
    size_t above = first_from(recording->bins, frf->count, bin);
    size_t below = above;
    while (above < frf->count && !frf->valid[above]) {
        above++;
    }
    while (below > 0 && !frf->valid[below - 1]) {
        below--;
    }
    if (above == frf->count && below == 0) {
        return 0.0;
    }
    below = below > 0 ? below - 1 : above;
    above = above < frf->count ? above : below;
    const double complex low = CMPLX(frf->real[below], frf->imag[below]);
    const double complex high = CMPLX(frf->real[above], frf->imag[above]);
    const double width = (double)recording->bins[above] - (double)recording->bins[below];
    return width > 0.0 ? low + (high - low) * (((double)bin - (double)recording->bins[below]) / width) : low;
}

/// Sums of E over the periods, shifted by the first one so that no digits of the scatter are lost.
struct sums {
    size_t count;
    double complex *input, *output; ///< of the period at hand
    double complex *response, *ramp, *first, *sum;
    double *square;
};

/// Slope of the line through the means of periods `first` .. used - 1. What a drift leaks is the same in every period,
/// as distortion is; of a speed that wanders this takes out the greater part.
static double trend_of_output(const struct periodic *recording, size_t first)
{
    const double *output = run_column(recording->run, recording->output);
    const size_t length = recording->period_samples;
    double centre = 0.0;
    double product = 0.0;
    double square = 0.0;
    for (size_t i = first; i < recording->used; i++) {
        centre += (double)recording->used_periods[i] / (double)(recording->used - first);
    }
    for (size_t i = first; i < recording->used; i++) {
        const double distance = (double)recording->used_periods[i] - centre;
        double mean = 0.0;
        for (size_t n = 0; n < length; n++) {
            mean += output[recording->used_periods[i] * length + n] / (double)length;
        }
        product += distance * mean;
        square += distance * distance;
    }
    return product / square / (double)length;
}

static bool make_sums(const struct periodic *recording, const struct frf *frf, const struct free_bins *free_bins,
                      double trend_per_sample, struct sums *out)
{
    const size_t count = free_bins->first[distortion_kinds];
    const double length = (double)recording->period_samples;
    *out = (struct sums){.count = count};
    out->input = calloc(6 * count + 1, sizeof *out->input);
    out->square = calloc(count + 1, sizeof *out->square);
    if (!out->input || !out->square) {
        return false;
    }
    out->output = out->input + count;
    out->response = out->output + count;
    out->ramp = out->response + count;
    out->first = out->ramp + count;
    out->sum = out->first + count;
    for (size_t i = 0; i < count; i++) {
        const uint32_t bin = free_bins->bins[i];
        out->response[i] = response_at(recording, frf, bin);
        out->ramp[i] = trend_per_sample * length / (cexp(-I * two_pi * (double)bin / length) - 1.0);
    }
    return true;
}

static bool add_period(const struct periodic *recording, size_t period, bool is_first, const uint32_t *bins,
                       struct sums *io_sums)
{
    const size_t length = recording->period_samples;
    const double *input = run_column(recording->run, recording->input) + period * length;
    const double *output = run_column(recording->run, recording->output) + period * length;
    if (!spectra_transform_both(input, output, length, 1, bins, io_sums->count, io_sums->input, io_sums->output)) {
        return false;
    }
    for (size_t i = 0; i < io_sums->count; i++) {
        const double complex rest = io_sums->output[i] - io_sums->ramp[i] - io_sums->response[i] * io_sums->input[i];
        io_sums->first[i] = is_first ? rest : io_sums->first[i];
        const double complex shifted = rest - io_sums->first[i];
        io_sums->sum[i] += shifted;
        io_sums->square[i] += cmplx_power(shifted);
    }
    return true;
}

/// Periods that have not settled look like noise to those that have; without them the test sees more.
static size_t first_settled(const struct periodic *recording)
{
    size_t first = 0;
    while (first < recording->used && recording->used_periods[first] < recording->transient.periods) {
        first++;
    }
    return recording->used - first >= 2 ? first : 0;
}

static double strongest_line(const struct periodic *recording)
{
    double strongest = 0.0;
    for (size_t i = 0; i < recording->used * recording->bin_count; i++) {
        strongest = fmax(strongest, cmplx_power(recording->output_spectra[i]));
    }
    return strongest;
}

/// Fills in excess and noise; *out_periods is M.
static bool measure(const struct periodic *recording, const struct frf *frf, struct free_bins *io_bins,
                    size_t *out_periods)
{
    struct sums sums;
    const size_t first = first_settled(recording);
    const double periods = (double)(recording->used - first);
    const double rounding = rounding_power * strongest_line(recording);
    bool done = make_sums(recording, frf, io_bins, trend_of_output(recording, first), &sums);
    for (size_t i = first; i < recording->used && done; i++) {
        done = add_period(recording, recording->used_periods[i], i == first, io_bins->bins, &sums);
    }
    for (size_t i = 0; i < sums.count && done; i++) {
        const double complex mean = sums.sum[i] / periods;
        const double scatter = fmax(sums.square[i] - periods * cmplx_power(mean), 0.0) / (periods - 1.0);
        io_bins->noise[i] = scatter / periods + rounding;
        io_bins->excess[i] = cmplx_power(sums.first[i] + mean) - io_bins->noise[i];
    }
    free(sums.input);
    free(sums.square);
    *out_periods = recording->used - first;
    return done;
}

/// Range of the free bins of a kind that are nearest to a bin.
struct neighbours {
    size_t first, count;
};

static bool within_octave(uint32_t a, uint32_t b)
{
    return a <= 2 * (uint64_t)b && b <= 2 * (uint64_t)a;
}

static struct neighbours nearest(const struct free_bins *free_bins, int kind, uint32_t bin)
{
    const uint32_t *bins = free_bins->bins;
    const size_t low = free_bins->first[kind];
    const size_t high = free_bins->first[kind + 1];
    struct neighbours self = {.first = low + first_from(bins + low, high - low, bin)};
    while (self.count < distortion_neighbours) {
        const size_t next = self.first + self.count;
        const bool below = self.first > low && within_octave(bins[self.first - 1], bin);
        const bool above = next < high && within_octave(bins[next], bin);
        if (!below && !above) {
            break;
        }
        const bool take_below = below && (!above || bin - bins[self.first - 1] <= bins[next] - bin);
        self.first -= take_below;
        self.count++;
    }
    return self;
}

static double mean_input(const struct periodic *recording, size_t line)
{
    double complex sum = 0.0;
    for (size_t m = 0; m < recording->used; m++) {
        sum += recording->input_spectra[m * recording->bin_count + line];
    }
    return cabs(sum) / (double)recording->used;
}

/// A line's level, and the one that noise alone stays below, both in the units of the response.
static double level_of_line(const struct free_bins *free_bins, struct neighbours near, double quantile, double input,
                            double *out_limit)
{
    double excess = 0.0;
    double noise = 0.0;
    const double count = (double)near.count;
    for (size_t i = near.first; i < near.first + near.count; i++) {
        excess += free_bins->excess[i];
        noise += free_bins->noise[i];
    }
    *out_limit = sqrt(fmax(quantile - 1.0, 0.0) * noise / count) / input;
    return excess > (quantile - 1.0) * noise ? sqrt(excess / count) / input : 0.0;
}

static double median_or_nan(double *values, size_t count)
{
    return count > 0 ? statistics_median(values, count) : NAN;
}

/// out_levels: one for each line, FRF_UNKNOWN where there are too few neighbours; work: 2 x lines.
static void level_lines(const struct periodic *recording, const struct frf *frf, const struct free_bins *free_bins,
                        int kind, double periods, double *out_levels, double *work, struct distortion_level *out)
{
    double *levels = work;
    double *limits = work + frf->count;
    double quantiles[distortion_neighbours + 1];
    size_t known = 0;
    for (int count = 1; count <= distortion_neighbours; count++) {
        quantiles[count] = statistics_f_quantile(1.0 - false_alarms, 2.0 * count, 2.0 * count * (periods - 1.0));
    }
    for (size_t line = 0; line < frf->count; line++) {
        const struct neighbours near = nearest(free_bins, kind, recording->bins[line]);
        const double magnitude = hypot(frf->real[line], frf->imag[line]);
        const double input = mean_input(recording, line);
        out_levels[line] = FRF_UNKNOWN;
        if (!frf->valid[line] || near.count < distortion_fewest_neighbours || !(input > 0.0)) {
            continue;
        }
        double limit;
        out_levels[line] = level_of_line(free_bins, near, quantiles[near.count], input, &limit);
        if (magnitude > 0.0) {
            levels[known] = out_levels[line] / magnitude;
            limits[known++] = limit / magnitude;
        }
    }
    out->median = median_or_nan(levels, known);
    out->limit = median_or_nan(limits, known);
}

static void test_bins(const struct free_bins *free_bins, int kind, double periods, struct distortion_level *out)
{
    out->bins = free_bins->first[kind + 1] - free_bins->first[kind];
    for (size_t i = free_bins->first[kind]; i < free_bins->first[kind + 1]; i++) {
        const double ratio = 1.0 + free_bins->excess[i] / free_bins->noise[i];
        const double log_chance = -(periods - 1.0) * log1p(ratio / (periods - 1.0));
        out->fisher -= 2.0 * fmax(log_chance, log(smallest_chance));
    }
}

static bool level_all(const struct periodic *recording, const struct free_bins *free_bins, double periods,
                      struct frf *io_frf, struct distortion *out)
{
    double *work = malloc(3 * io_frf->count * sizeof *work);
    double *mixed = work ? work + 2 * io_frf->count : NULL;
    double *const columns[distortion_kinds] = {io_frf->odd_distortion, io_frf->even_distortion, mixed};
    for (int kind = 0; kind < distortion_kinds && work; kind++) {
        struct distortion_level *level = &out->kind[kind];
        if (free_bins->first[kind + 1] > free_bins->first[kind]) {
            test_bins(free_bins, kind, periods, level);
            level_lines(recording, io_frf, free_bins, kind, periods, columns[kind], work, level);
        }
    }
    free(work);
    return work != NULL;
}

bool distortion_estimate(const struct periodic *recording, const struct distortion_options *options, struct frf *io_frf,
                         struct distortion *out)
{
    static const struct distortion_options nothing = {NULL, 0};
    struct free_bins free_bins = {.bins = NULL};
    size_t periods = 0;
    *out = (struct distortion){0};
    if (io_frf->count != recording->bin_count || io_frf->count == 0) {
        return true;
    }
    bool done = find_free(recording, options ? options : &nothing, &free_bins);
    if (done && free_bins.first[distortion_kinds] > 0) {
        done = measure(recording, io_frf, &free_bins, &periods) &&
               level_all(recording, &free_bins, (double)periods, io_frf, out);
    }
    free_free_bins(&free_bins);
    return done;
}

double distortion_chance(const struct distortion_level *self)
{
    return self->bins > 0 ? statistics_chi2_tail(self->fisher, 2.0 * (double)self->bins) : 1.0;
}

void distortion_merge(struct distortion *self, const struct distortion *other)
{
    for (int kind = 0; kind < distortion_kinds; kind++) {
        struct distortion_level *one = &self->kind[kind];
        const struct distortion_level *two = &other->kind[kind];
        if (two->bins == 0) {
            continue;
        }
        const bool alone = one->bins == 0;
        one->limit = alone ? two->limit : fmax(one->limit, two->limit);
        one->median = alone ? two->median : fmax(one->median, two->median);
        one->bins += two->bins;
        one->fisher += two->fisher;
    }
}
