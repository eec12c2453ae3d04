/* SPDX-License-Identifier: MIT */
#include "lab/estimate/frf_mean.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/method.h"
#include "lab/numeric/clones.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Lines are worked on in blocks whose values of all periods stay in the second cache while they are passed over twice.
enum { block_lines = 512, block_values = 16384, fewest_block_lines = 16 };

enum { few_periods = 3, neighbours = 8 }; ///< periods that tell too little of scatter; lines on each side that help

static const double efficiency_of_median = 0.48;

static size_t lines_in_block(size_t periods)
{
    size_t lines = block_values / periods;
    return lines > block_lines ? block_lines : lines < fewest_block_lines ? fewest_block_lines : lines;
}

struct block {
    double complex input[block_lines]; ///< mean spectra
    double complex output[block_lines];
    double input_scatter[block_lines]; ///< sum |U_m - Ubar|^2
    double residual[block_lines];      ///< sum |(Y_m - Ybar) - G (U_m - Ubar)|^2
};

CLONED_FOR_AVX2 static void sum_means(const struct periodic *recording, size_t first, size_t lines, struct block *out)
{
    memset(out, 0, sizeof *out);
    for (size_t m = 0; m < recording->used; m++) {
        size_t row = m * recording->bin_count + first;
        for (size_t b = 0; b < lines; b++) {
            out->input[b] += recording->input_spectra[row + b];
            out->output[b] += recording->output_spectra[row + b];
        }
    }
    for (size_t b = 0; b < lines; b++) {
        out->input[b] /= (double)recording->used;
        out->output[b] /= (double)recording->used;
    }
}

CLONED_FOR_AVX2 static void sum_scatter(const struct periodic *recording, size_t first, size_t lines,
                                        const double complex *responses, struct block *io_block)
{
    for (size_t m = 0; m < recording->used; m++) {
        size_t row = m * recording->bin_count + first;
        for (size_t b = 0; b < lines; b++) {
            double complex input = recording->input_spectra[row + b] - io_block->input[b];
            double complex output = recording->output_spectra[row + b] - io_block->output[b];
            double complex response = responses[b];
            /* Part by part: a product of complex numbers would look for infinities each time. */
            double real = creal(output) - creal(response) * creal(input) + cimag(response) * cimag(input);
            double imaginary = cimag(output) - creal(response) * cimag(input) - cimag(response) * creal(input);
            io_block->input_scatter[b] += cmplx_power(input);
            io_block->residual[b] += real * real + imaginary * imaginary;
        }
    }
}

/// Two or three periods tell one line's scatter so badly that a line would have to stand 30 dB above it to count; its
/// neighbours' is much the same, and their median is certain. In place of the line's own, by degrees of freedom.
static double pooled_scatter(const struct block *block, size_t lines, size_t b, double own_dof, double *out_dof)
{
    double values[2 * neighbours + 1];
    size_t count = 0;
    for (size_t other = b > neighbours ? b - neighbours : 0; other <= b + neighbours && other < lines; other++) {
        values[count++] = block->input_scatter[other];
    }
    /* Median over mean of chi-square, after Wilson and Hilferty; and how much of the numbers it tells. */
    const double share = 1.0 - 1.0 / (9.0 * own_dof);
    const double dof = efficiency_of_median * own_dof * (double)(count - 1);
    const double median = statistics_median(values, count) / (share * share * share);
    *out_dof = own_dof + dof;
    return (own_dof * block->input_scatter[b] + dof * median) / *out_dof;
}

/// The largest scatter of a block bounds every median in it: most lines need no more to be certain.
static double certain_power_of_few(const struct block *block, size_t lines, double count)
{
    const double own_dof = count - 1.0;
    const double share = 1.0 - 1.0 / (9.0 * own_dof);
    const double fewest = (double)(lines > neighbours ? neighbours : lines - 1);
    const double dof = own_dof * (1.0 + efficiency_of_median * fewest);
    double largest = 0.0;
    for (size_t b = 0; b < lines; b++) {
        largest = block->input_scatter[b] > largest ? block->input_scatter[b] : largest;
    }
    return largest / (share * share * share) / own_dof * dof * expm1(-log(estimate_chance_of_dead_line) / dof);
}

static bool has_power_of_few(const struct block *block, size_t lines, size_t b, double count, double certain_power)
{
    double dof;
    const double power_of_mean = count * cmplx_power(block->input[b]);
    if (power_of_mean > certain_power) {
        return true;
    }
    const double variance = pooled_scatter(block, lines, b, count - 1.0, &dof) / (count - 1.0);
    return power_of_mean > 0.0 && dof * log1p(power_of_mean / variance / dof) > -log(estimate_chance_of_dead_line);
}

static void estimate_block(const struct periodic *recording, size_t first, size_t lines, struct block *io_block,
                           struct frf *io_frf)
{
    double complex responses[block_lines];
    double count = (double)recording->used;
    const bool few = recording->used <= few_periods;
    const double certain_ratio = circle_certain_ratio(estimate_chance_of_dead_line, recording->used);
    double certain_power;
    sum_means(recording, first, lines, io_block);
    for (size_t b = 0; b < lines; b++) {
        /* Part by part: a quotient of complex numbers would look for infinities each time. */
        const double complex u = io_block->input[b];
        const double complex y = io_block->output[b];
        responses[b] = CMPLX((creal(y) * creal(u) + cimag(y) * cimag(u)) / cmplx_power(u),
                             (cimag(y) * creal(u) - creal(y) * cimag(u)) / cmplx_power(u));
    }
    sum_scatter(recording, first, lines, responses, io_block);
    certain_power = few ? certain_power_of_few(io_block, lines, count) : 0.0;
    for (size_t b = 0; b < lines; b++) {
        double input_power = cmplx_power(io_block->input[b]);
        if (few ? has_power_of_few(io_block, lines, b, count, certain_power)
                : count * input_power > certain_ratio * io_block->input_scatter[b] / (count - 1.0)) {
            double variance = io_block->residual[b] / (count * (count - 1.0) * input_power);
            estimate_set_line(io_frf, first + b, responses[b], sqrt(variance));
        }
    }
}

int frf_mean_estimate(const struct periodic *recording, const struct estimate_options *options, struct frf *out_frf,
                      struct error *out_error)
{
    (void)options;
    int status = estimate_begin(recording, "mean", 2.0 * (double)(recording->used - 1), out_frf, out_error);
    struct block *block = status ? NULL : malloc(sizeof *block);
    if (!status && !block) {
        status = estimate_refuse_memory(out_frf, out_error);
    }
    size_t lines = lines_in_block(recording->used);
    for (size_t first = 0; first < recording->bin_count && !status; first += lines) {
        size_t rest = recording->bin_count - first;
        estimate_block(recording, first, rest < lines ? rest : lines, block, out_frf);
    }
    free(block);
    return status ? status : estimate_end(recording, out_frf, out_error);
}
