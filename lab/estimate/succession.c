/* SPDX-License-Identifier: MIT */
#include "lab/estimate/succession.h"

#include "lab/estimate/stretch.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>

enum {
    fewest_block_lines = 8,
    orders = 8000,
    /* So many orders that show as much, and the chance is above what would be believed. */
    enough = 16,
};

static const double believed = 1e-3;
static const double products_max = 67108864.0;
/// Correlation from which on the mean hardly gains from further periods.
static const double correlation_max = 0.95;
/// Of a block, over what random orders scatter by: less is left alone.
static const double notable = 2.0;
static const uint64_t seed = 1;

/// Products of residuals of two periods, summed over a block's lines: blocks x periods x periods.
struct products {
    size_t periods, blocks;
    double *sums;
    double *sizes; ///< of each block: sum over its diagonal
};

struct stretch_lines {
    size_t first; ///< row of the spectra
    size_t periods;
};

/// The last consecutive periods of the longest stretch.
static struct stretch_lines last_periods(const struct periodic *recording)
{
    const struct stretch stretch = stretch_longest(recording);
    struct stretch_lines self = {.periods = stretch.periods};
    while (self.first < recording->used && recording->used_periods[self.first] < stretch.first) {
        self.first++;
    }
    /* With very many lines fewer periods say as much, and the products of all pairs would cost more than the cut. */
    const size_t affordable = (size_t)sqrt(products_max / (double)recording->bin_count);
    size_t most = affordable < succession_most ? affordable : succession_most;
    most = most < succession_fewest ? succession_fewest : most;
    if (self.periods > most) {
        self.first += self.periods - most;
        self.periods = most;
    }
    return self;
}

/// Residuals of one line, over their RMS; false without scatter.
static bool residuals_of(const struct periodic *recording, const struct stretch_lines *span, const struct frf *frf,
                         size_t line, double complex *out)
{
    const double complex response = CMPLX(frf->real[line], frf->imag[line]);
    double complex mean = 0.0;
    double power = 0.0;
    for (size_t m = 0; m < span->periods; m++) {
        const size_t at = (span->first + m) * recording->bin_count + line;
        out[m] = recording->output_spectra[at] - response * recording->input_spectra[at];
        mean += out[m] / (double)span->periods;
    }
    for (size_t m = 0; m < span->periods; m++) {
        out[m] -= mean;
        power += cmplx_power(out[m]) / (double)span->periods;
    }
    for (size_t m = 0; m < span->periods && power > 0.0; m++) {
        out[m] /= sqrt(power);
    }
    return power > 0.0;
}

static void add_products(const double complex *residuals, size_t periods, double *io_sums, double *io_size)
{
    for (size_t a = 0; a < periods; a++) {
        for (size_t b = 0; b < periods; b++) {
            io_sums[a * periods + b] += creal(residuals[a]) * creal(residuals[b]);
            io_sums[a * periods + b] += cimag(residuals[a]) * cimag(residuals[b]);
        }
    }
    *io_size += (double)periods;
}

/// Correlations of each block, and of all together as the last one, for one order of the periods.
static void correlate(const struct products *self, const size_t *order, double *out)
{
    const double others = (double)(self->periods - 1);
    double all = 0.0;
    double size = 0.0;
    for (size_t block = 0; block < self->blocks; block++) {
        const double *sums = self->sums + block * self->periods * self->periods;
        double sum = 0.0;
        for (size_t m = 1; m < self->periods; m++) {
            sum += sums[order[m - 1] * self->periods + order[m]];
        }
        const double mean_square = self->sizes[block] / (double)self->periods;
        out[block] = mean_square > 0.0 ? (sum / mean_square + 1.0) / others : 0.0;
        all += sum;
        size += self->sizes[block];
    }
    out[self->blocks] = size > 0.0 ? (all / (size / (double)self->periods) + 1.0) / others : 0.0;
}

static double largest_of(const double *correlations, size_t blocks)
{
    double largest = 0.0;
    for (size_t block = 0; block < blocks; block++) {
        largest = fmax(largest, fabs(correlations[block]));
    }
    return largest;
}

static void shuffle(size_t *order, size_t count, struct random *random)
{
    for (size_t i = count - 1; i > 0; i--) {
        const size_t other = (size_t)(random_uniform(random) * (double)(i + 1));
        const size_t kept = order[i];
        order[i] = order[other];
        order[other] = kept;
    }
}

static void judge(const struct products *products, struct succession *io_self)
{
    size_t order[succession_most];
    double own[succession_blocks + 1];
    double other[succession_blocks + 1];
    double squares[succession_blocks] = {0.0};
    size_t as_large[2] = {1, 1};
    size_t tried = 1;
    struct random random;
    random_seed(&random, seed);
    for (size_t m = 0; m < products->periods; m++) {
        order[m] = m;
    }
    correlate(products, order, own);
    const double largest = largest_of(own, products->blocks);
    const double mean = fabs(own[products->blocks]);
    for (; tried <= orders && (as_large[0] < enough || as_large[1] < enough); tried++) {
        shuffle(order, products->periods, &random);
        correlate(products, order, other);
        as_large[0] += largest_of(other, products->blocks) >= largest;
        as_large[1] += fabs(other[products->blocks]) >= mean;
        for (size_t block = 0; block < products->blocks; block++) {
            squares[block] += other[block] * other[block];
        }
    }
    const size_t fewer = as_large[0] < as_large[1] ? as_large[0] : as_large[1];
    io_self->chance = fmin(1.0, 2.0 * (double)fewer / (double)tried);
    io_self->certain = io_self->chance < believed;
    io_self->correlation = own[products->blocks];
    for (size_t block = 0; block < products->blocks; block++) {
        const double r = fmin(own[block], correlation_max);
        const double usual = sqrt(squares[block] / (double)tried);
        const bool enlarges = io_self->certain && r > notable * usual;
        io_self->factor[block] = enlarges ? sqrt((1.0 + r) / (1.0 - r)) : 1.0;
    }
}

bool succession_test(const struct periodic *recording, const struct frf *frf, struct succession *out)
{
    const struct stretch_lines span = last_periods(recording);
    const size_t lines = recording->bin_count;
    *out = (struct succession){.chance = 1.0};
    if (span.periods < succession_fewest) {
        return true;
    }
    size_t blocks = lines / fewest_block_lines;
    blocks = blocks < 1 ? 1 : blocks > succession_blocks ? succession_blocks : blocks;
    out->periods = span.periods;
    out->block_lines = (lines + blocks - 1) / blocks;
    out->block_count = (lines + out->block_lines - 1) / out->block_lines;
    double sizes[succession_blocks] = {0.0};
    struct products products = {.periods = span.periods, .blocks = out->block_count, .sizes = sizes};
    products.sums = calloc(products.blocks * span.periods * span.periods, sizeof *products.sums);
    if (!products.sums) {
        return false;
    }
    for (size_t line = 0; line < lines; line++) {
        double complex residuals[succession_most];
        const size_t block = line / out->block_lines;
        if (frf->valid[line] && residuals_of(recording, &span, frf, line, residuals)) {
            add_products(residuals, span.periods, products.sums + block * span.periods * span.periods, &sizes[block]);
        }
    }
    judge(&products, out);
    free(products.sums);
    return true;
}

void succession_enlarge(const struct succession *self, struct frf *io_frf)
{
    for (size_t line = 0; line < io_frf->count && self->certain; line++) {
        const double factor = self->factor[line / self->block_lines];
        if (io_frf->valid[line] && factor > 1.0) {
            io_frf->std[line] *= factor;
            io_frf->noise_std[line] *= factor;
        }
    }
}
