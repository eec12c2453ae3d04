/* SPDX-License-Identifier: MIT */
/* Needs math.h; firmware whose tables are in flash leaves this file out. */
#include "frf/block_table.h"

#include "frf/block_basis.h"
#include "frf/kernel.h"

#include <math.h>
#include <stddef.h>

enum { half_max = FRF_BLOCK_SAMPLES_MAX / 2u };

/* A function of the basis has unit RMS; a quarter of that keeps its peaks below 1 in Q31. */
static const double basis_scale = 0.25;
/* What of a line lies outside the basis falls on bins N/L apart: -108 dB of a line, as the products' rounding. */
static const double basis_error_max = 4e-6;

static int32_t q31(double value)
{
    double scaled = round(2147483648.0 * value);
    return scaled > 2147483647.0 ? INT32_MAX : (int32_t)scaled;
}

/* Where the kernel looks for rotation and factor `term` of a row. */
static int32_t *rotation_of(int32_t *rows, uint32_t terms, uint32_t row)
{
    return rows + row / 2u * (4u + 2u * terms) + row % 2u * 2u;
}

static int32_t *factor_of(int32_t *rows, uint32_t terms, uint32_t row, uint32_t term)
{
    return rows + row / 2u * (4u + 2u * terms) + 4u + term / 4u * 8u + row % 2u * 4u + term % 4u;
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
    double function[half_max];
    double width = (double)table->bins[table->bin_count - 1u] / (double)table->period_samples;
    for (uint32_t row = 0; row < table->layout.terms / 2u; ++row) {
        rotation_of(rows, block, row)[0] = rotation_of(rows, block, row)[1] = 0;
        for (unsigned part = 0; part < 2; ++part) {
            frf_basis_function(block / 2u, width, part == 0 ? 1 : -1, row, function);
            for (uint32_t i = 0; i < block / 2u; ++i) {
                *factor_of(rows, block, row, 2u * i + part) = q31(basis_scale * function[i]);
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
        out_factors[row] = product / norm + (pass == row ? 0.0 : out_factors[row]);
        for (uint32_t i = 0; i < half; ++i) {
            io_line[i] -= product / norm * function[i];
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
    double line[half_max], factors[half_max];
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

/* The last block's centre is (blocks - 1) L + (L - 1)/2 samples after n = 0. */
static void build_restore(int32_t *restore, const struct frf_block_table *table)
{
    uint32_t block = table->layout.block_samples, period = table->period_samples;
    uint64_t halves = 2u * (uint64_t)((period - 1u) / block) * block + block - 1u;
    for (uint32_t b = 0; b < table->bin_count; ++b) {
        restore[2u * b] = q31(cosine_of_halves(halves * table->bins[b], period));
        restore[2u * b + 1u] = q31(sine_of_halves(halves * table->bins[b], period));
    }
}

/* |sum over any part of a period| <= 2^15 N / sqrt(2), the mean of |cos| over any three or more equal steps of a circle
 * being at most that (four steps). 92000 of the 92681 that fill 31 bits leave room for N rounding errors. Block's own
 * words: a basis function of unit RMS takes at most 2^15 L out of a block. */
static uint32_t gain_shift_of(uint32_t period, uint32_t block)
{
    uint32_t shift = 0;
    while ((period << (shift + 1u)) <= 92000u && (block << (shift + 2u)) <= 65536u && shift < 10u) {
        ++shift;
    }
    return shift;
}

static enum core_status check(const struct frf_block_layout *layout, const uint32_t *bins, uint32_t bin_count,
                              uint32_t period)
{
    uint32_t block = layout->block_samples, terms = layout->terms;
    if (period < 4u || period > SERVOSCOPE_FRF_PERIOD_MAX) {
        return core_err_frf_period;
    }
    if (block < 8u || block > FRF_BLOCK_SAMPLES_MAX || block % 4u != 0u || block > period || terms < 4u ||
        terms > block || terms % 4u != 0u) {
        return core_err_frf_block;
    }
    return frf_check_bins(bins, bin_count, period);
}

enum core_status frf_block_build(int32_t *storage, uint32_t words, const uint32_t *bins, uint32_t bin_count,
                                 uint32_t period_samples, const struct frf_block_layout *layout,
                                 struct frf_block_table *out_table)
{
    if (!storage || !bins || !layout || !out_table) {
        return core_err_argument;
    }
    enum core_status status = check(layout, bins, bin_count, period_samples);
    if (status != core_ok) {
        return status;
    }
    uint32_t rows = FRF_BLOCK_ROWS(bin_count), terms = layout->terms, block = layout->block_samples;
    if (words < FRF_BLOCK_TABLE_WORDS(bin_count, block, terms)) {
        return core_err_storage;
    }
    int32_t *restore = storage + rows * (2u + terms), *basis = terms == block ? NULL : restore + 2u * bin_count;
    struct frf_block_table table = {storage, restore, basis, bins, bin_count, period_samples, *layout, 0};
    table.gain_shift = gain_shift_of(period_samples, block);
    if (basis) {
        build_basis(basis, &table);
    }
    for (uint32_t b = 0; b < bin_count; ++b) {
        if (!build_row(storage, basis, &table, b)) {
            return core_err_frf_block;
        }
    }
    if (rows > bin_count) {
        rotation_of(storage, terms, bin_count)[0] = rotation_of(storage, terms, bin_count)[1] = 0;
        for (uint32_t t = 0; t < terms; ++t) {
            *factor_of(storage, terms, bin_count, t) = 0;
        }
    }
    build_restore(restore, &table);
    *out_table = table;
    return core_ok;
}
