/* SPDX-License-Identifier: MIT */
/* Needs math.h; firmware whose tables are in flash leaves this file out. */
#include "frf/block_table.h"

#include "frf/block_basis.h"
#include "frf/kernel.h"

#include <math.h>
#include <stddef.h>

enum { half_max = FRF_BLOCK_SAMPLES_MAX / 2u };

/* Of a function of unit RMS: keeps most peaks below 1 in Q31. */
static const double basis_scale = 0.25;
/* RMS of what a line has outside the basis. Of signals that lie in it too, that passes with the square only; 1e-4 is
 * what comes through of anything above the lines, at bins N/L apart (-80 dB). */
static const double basis_error_max = 1e-4;

static int32_t q31(double value)
{
    double scaled = round(2147483648.0 * value);
    return scaled > 2147483647.0 ? INT32_MAX : (int32_t)scaled;
}

/* Where the kernel looks for rotation and factor `term` of a row. */
static int32_t *rotation_of(int32_t *rows, uint32_t terms, uint32_t row)
{
    return rows + row / 2u * (4u + 2u * terms) + 2u * terms + row % 2u * 2u;
}

static int32_t *factor_of(int32_t *rows, uint32_t terms, uint32_t row, uint32_t term)
{
    return rows + row / 2u * (4u + 2u * terms) + term / 4u * 8u + row % 2u * 4u + term % 4u;
}

/* Sine and cosine of 2 pi halves / (2 N), reduced exactly. */
static double sine_of_halves(uint64_t halves, uint32_t period)
{
    return frf_sine_of_eighths((uint32_t)(halves % (2u * period)) * 4u, period);
}

static double cosine_of_halves(uint64_t halves, uint32_t period)
{
    uint32_t eighths = (uint32_t)(halves % (2u * period)) * 4u + 2u * period;
    return frf_sine_of_eighths(eighths >= 8u * period ? eighths - 8u * period : eighths, period);
}

/* The line's cosine (part 0) or minus its sine (part 1) from the block's centre outwards. */
static void sample_line(const struct frf_block_table *table, uint32_t bin, unsigned part, double *out_line)
{
    for (uint32_t i = 0; i < table->layout.block_samples / 2u; ++i) {
        uint64_t halves = (uint64_t)bin * (2u * i + 1u);
        out_line[i] = part == 0 ? cosine_of_halves(halves, table->period_samples)
                                : -sine_of_halves(halves, table->period_samples);
    }
}

static void build_basis(int32_t *rows, const struct frf_block_table *table)
{
    uint32_t block = table->layout.block_samples;
    double function[half_max] = {0.0};
    double width = (double)table->bins[table->bin_count - 1u] / (double)table->period_samples;
    for (uint32_t row = 0; row < table->layout.terms / 2u; ++row) {
        rotation_of(rows, block, row)[0] = rotation_of(rows, block, row)[1] = 0;
        for (unsigned part = 0; part < 2; ++part) {
            double peak = 1.0 / basis_scale;
            frf_basis_function(block / 2u, width, part == 0 ? 1 : -1, row, function);
            for (uint32_t i = 0; i < block / 2u; ++i) {
                peak = fmax(peak, fabs(function[i]));
            }
            for (uint32_t i = 0; i < block / 2u; ++i) {
                *factor_of(rows, block, row, 2u * i + part) = q31(function[i] / peak);
            }
        }
    }
}

/* Least squares on the functions as they were rounded, so that rounding them costs nothing: they are orthogonal but for
 * that rounding, and a second projection of the remainder leaves its square. Returns the remainder's RMS. */
static double project(int32_t *basis, const struct frf_block_table *table, double *io_line, unsigned part,
                      double *out_factors)
{
    uint32_t block = table->layout.block_samples, half = block / 2u;
    double squares = 0.0;
    for (uint32_t pass = 0; pass < 2u * (table->layout.terms / 2u); ++pass) {
        uint32_t row = pass % (table->layout.terms / 2u);
        double function[half_max], product = 0.0, norm = 0.0;
        for (uint32_t i = 0; i < half; ++i) {
            function[i] = *factor_of(basis, block, row, 2u * i + part) / 2147483648.0 / basis_scale;
            product += function[i] * io_line[i];
            norm += function[i] * function[i];
        }
        /* A factor is cut to what Q31 holds; what is lost by that stays in the remainder. */
        double before = pass == row ? 0.0 : out_factors[row], factor = fmax(-1.0, fmin(before + product / norm, 1.0));
        out_factors[row] = factor;
        for (uint32_t i = 0; i < half; ++i) {
            io_line[i] -= (factor - before) * function[i];
        }
    }
    for (uint32_t i = 0; i < half; ++i) {
        squares += io_line[i] * io_line[i];
    }
    return sqrt(squares / (double)half);
}

/* One row; false if the basis does not hold the line. */
static bool build_row(int32_t *rows, int32_t *basis, const struct frf_block_table *table, uint32_t row)
{
    uint32_t bin = table->bins[row], terms = table->layout.terms;
    double line[half_max] = {0.0}, factors[half_max] = {0.0};
    uint64_t block_halves = 2u * (uint64_t)bin * table->layout.block_samples;
    rotation_of(rows, terms, row)[0] = q31(cosine_of_halves(block_halves, table->period_samples));
    rotation_of(rows, terms, row)[1] = q31(sine_of_halves(block_halves, table->period_samples));
    for (unsigned part = 0; part < 2; ++part) {
        const double *values = line;
        sample_line(table, bin, part, line);
        if (basis) {
            if (!(project(basis, table, line, part, factors) <= basis_error_max)) {
                return false;
            }
            values = factors;
        }
        for (uint32_t t = 0; t < terms / 2u; ++t) {
            *factor_of(rows, terms, row, 2u * t + part) = q31(values[t]);
        }
    }
    return true;
}

/* The last block's centre is (blocks - 1) L + (L - 1)/2 samples after the first one's begin, which is the zeros in
 * front before n = 0 of the folded period. */
static void build_restore(int32_t *restore, const struct frf_block_table *table)
{
    uint32_t block = table->layout.block_samples, period = table->period_samples;
    uint32_t last = (table->part_samples + table->lead_samples - 1u) / block * block - table->lead_samples;
    uint64_t halves = 2u * (uint64_t)last + block - 1u;
    for (uint32_t b = 0; b < table->bin_count; ++b) {
        restore[2u * b] = q31(cosine_of_halves(halves * table->bins[b], period));
        restore[2u * b + 1u] = q31(sine_of_halves(halves * table->bins[b], period));
    }
}

/* |sum over any part of a period| <= 2^15 N / sqrt(2), the mean of |cos| over any three or more equal steps of a circle
 * being at most that (four steps); it has to stay below 2^30, twice an accumulator being rotated: N 2^shift up to 92681
 * at half counts, of which 92000 leave room for the rounding errors. A block's own sum, up to 2^15 L Q counts, is kept
 * 16 times finer in 32 bits; on its way to a basis function of unit RMS it is 2^9 times finer. */
static bool gain_fits(const struct frf_block_table *table, uint32_t shift)
{
    uint64_t gain = (uint64_t)1 << shift, block = (uint64_t)table->layout.block_samples * table->layout.repeats;
    bool has_basis = table->layout.terms < table->layout.block_samples;
    return table->period_samples * gain <= 92000u && block * gain <= (has_basis ? 256u : 8192u);
}

/* Functions that hold all lines below `width` to basis_error_max within a block: twice the block's length in periods of
 * the highest line, and more the sharper the edge [found with frf_block_build(), tests/unit/test_frf_block.c]. */
static uint32_t terms_for(uint32_t block, double width)
{
    double turns = (double)block * width;
    uint32_t terms = (uint32_t)ceil((2.0 * turns + 4.0 + 2.2 * log1p(turns)) / 4.0) * 4u;
    return terms < block ? terms : block;
}

/* Instructions per sample and bin of the Cortex-M4 kernel: of two rows, 11 a group of four terms and 28 more. */
static double cost_of(uint32_t block, uint32_t terms, uint32_t bin_count)
{
    double bins = (2.75 * (double)terms + 28.0) / (2.0 * (double)block);
    double basis = terms == block ? 0.0 : (double)terms / 2.0 * (2.75 * (double)block + 28.0) / (2.0 * (double)block);
    return bins + basis / (double)bin_count;
}

static uint32_t greatest_divisor(uint32_t a, uint32_t b)
{
    while (b != 0) {
        uint32_t rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

/* Whether all bins leave `rest` when divided by `repeats`. */
static bool all_leave(const uint32_t *bins, uint32_t bin_count, uint32_t repeats, uint32_t rest)
{
    for (uint32_t b = 0; b < bin_count; ++b) {
        if (bins[b] % repeats != rest) {
            return false;
        }
    }
    return true;
}

/* The largest Q that the lines allow and that divides the period. */
static uint32_t repeats_for(const uint32_t *bins, uint32_t bin_count, uint32_t period)
{
    uint32_t divisor = period;
    for (uint32_t b = 0; b < bin_count; ++b) {
        divisor = greatest_divisor(divisor, bins[b]);
    }
    bool odd = period % (2u * divisor) == 0 && all_leave(bins, bin_count, 2u * divisor, divisor);
    return odd ? 2u * divisor : divisor;
}

void frf_block_choose(const uint32_t *bins, uint32_t bin_count, uint32_t period_samples, uint32_t part_samples_max,
                      struct frf_block_layout *out_layout)
{
    struct frf_block_layout folded = {32u, 32u, 1u}, exact = {0, 0, 1u};
    *out_layout = exact;
    if (!SERVOSCOPE_FRF_LONG_MULTIPLY || frf_check_bins(bins, bin_count, period_samples) != core_ok) {
        return;
    }
    /* Of the bounds on L Q the basis's is the narrow one: four parts leave L = 64. */
    uint32_t repeats = repeats_for(bins, bin_count, period_samples);
    if (period_samples / repeats > part_samples_max || period_samples / repeats < 64u || repeats > 256u) {
        repeats = 1u;
    }
    uint32_t part = period_samples / repeats;
    if (part < 64u) {
        return;
    }
    folded.repeats = repeats;
    *out_layout = folded;
    double width = (double)bins[bin_count - 1u] / (double)period_samples, least = cost_of(32u, 32u, bin_count);
    for (uint32_t block = 32u; block <= FRF_BLOCK_SAMPLES_MAX && 2u * block <= part && block * repeats <= 256u;
         block *= 2u) {
        struct frf_block_layout layout = {block, terms_for(block, width), repeats};
        double cost = cost_of(block, layout.terms, bin_count);
        if (layout.terms < block && cost < least) {
            least = cost;
            *out_layout = layout;
        }
    }
}

static enum core_status check(const struct frf_block_table *table)
{
    uint32_t block = table->layout.block_samples, terms = table->layout.terms, repeats = table->layout.repeats;
    if (table->period_samples < 4u || table->period_samples > SERVOSCOPE_FRF_PERIOD_MAX) {
        return core_err_frf_period;
    }
    if (block < 8u || block > FRF_BLOCK_SAMPLES_MAX || block % 4u != 0u || terms < 4u || terms > block ||
        terms % 4u != 0u || table->period_samples % repeats != 0u || block > table->part_samples ||
        !gain_fits(table, 0)) {
        return core_err_frf_block;
    }
    enum core_status status = frf_check_bins(table->bins, table->bin_count, table->period_samples);
    if (status == core_ok && !all_leave(table->bins, table->bin_count, repeats, table->alternate ? repeats / 2u : 0u)) {
        return core_err_frf_block;
    }
    return status;
}

/* Everything but the storage; a status as frf_block_build() gives it. */
static enum core_status set_up(struct frf_block_table *self, const uint32_t *bins, uint32_t bin_count,
                               uint32_t period_samples, const struct frf_block_layout *layout)
{
    struct frf_block_table table = {NULL, NULL, NULL, bins, bin_count, period_samples, 0, 0, false, *layout, 0};
    table.layout.repeats = layout->repeats > 1u ? layout->repeats : 1u;
    table.part_samples = period_samples / table.layout.repeats;
    table.alternate = bin_count > 0 && bins[0] % table.layout.repeats != 0u && table.layout.repeats % 2u == 0u;
    enum core_status status = check(&table);
    if (status != core_ok) {
        return status;
    }
    /* What the blocks have more than there are samples is cut off the first and the last in halves: then each is filled
     * in at least half of L, which is the time for the work on the one before. */
    uint32_t rest = table.part_samples % layout->block_samples;
    table.lead_samples = rest == 0 ? 0 : (layout->block_samples - rest) / 2u;
    while (gain_fits(&table, table.gain_shift + 1u)) {
        ++table.gain_shift;
    }
    *self = table;
    return core_ok;
}

static void build_empty_row(int32_t *rows, uint32_t terms, uint32_t row)
{
    rotation_of(rows, terms, row)[0] = rotation_of(rows, terms, row)[1] = 0;
    for (uint32_t t = 0; t < terms; ++t) {
        *factor_of(rows, terms, row, t) = 0;
    }
}

enum core_status frf_block_build(int32_t *storage, uint32_t words, const uint32_t *bins, uint32_t bin_count,
                                 uint32_t period_samples, const struct frf_block_layout *layout,
                                 struct frf_block_table *out_table)
{
    if (!storage || !bins || !layout || !out_table) {
        return core_err_argument;
    }
    struct frf_block_table table;
    enum core_status status = set_up(&table, bins, bin_count, period_samples, layout);
    if (status != core_ok) {
        return status;
    }
    uint32_t rows = FRF_BLOCK_ROWS(bin_count), terms = layout->terms, block = layout->block_samples;
    if (words < FRF_BLOCK_TABLE_WORDS(bin_count, block, terms)) {
        return core_err_storage;
    }
    int32_t *restore = storage + rows * (2u + terms), *basis = terms == block ? NULL : restore + 2u * bin_count;
    if (basis) {
        build_basis(basis, &table);
    }
    for (uint32_t b = 0; b < bin_count; ++b) {
        if (!build_row(storage, basis, &table, b)) {
            return core_err_frf_block;
        }
    }
    if (rows > bin_count) {
        build_empty_row(storage, terms, bin_count);
    }
    build_restore(restore, &table);
    table.rows = storage;
    table.restore = restore;
    table.basis = basis;
    *out_table = table;
    return core_ok;
}
