/* SPDX-License-Identifier: MIT */
#include "frf/block_kernel.h"

/* Sums are kept unsigned: they are modulo 2^32 by definition, and only the last has to be in range. */
static inline uint32_t high_word(int64_t product)
{
    return (uint32_t)(((uint64_t)product + 0x80000000u) >> 32);
}

/* The conversion of an unsigned value above the signed maximum is implementation-defined in C99, hence the detour. */
static inline int32_t as_signed(uint32_t value)
{
    return value < 0x80000000u ? (int32_t)value : (int32_t)(value - 0x80000000u) + INT32_MIN;
}

static inline uint32_t add_product(uint32_t sum, int32_t a, int32_t b)
{
    return sum + high_word((int64_t)a * b);
}

/* sum * 2^32 - product, rounded: minus a product is not the rounded product subtracted where that is a half */
static inline uint32_t subtract_product(uint32_t sum, int32_t a, int32_t b)
{
    return sum + high_word(-((int64_t)a * b));
}

/* value / 16, rounded down */
static inline uint32_t sixteenth(uint32_t value)
{
    return value >> 4 | (value >> 31) * 0xF0000000u;
}

/* The two sums of a row. */
struct sums {
    uint32_t real, imaginary;
};

static inline struct sums sum_row(struct sums sums, const int32_t *factors, const int32_t *data, uint32_t groups)
{
    for (uint32_t g = 0; g < groups; ++g) {
        sums.real = add_product(sums.real, data[4u * g], factors[8u * g]);
        sums.imaginary = add_product(sums.imaginary, data[4u * g + 1u], factors[8u * g + 1u]);
        sums.real = add_product(sums.real, data[4u * g + 2u], factors[8u * g + 2u]);
        sums.imaginary = add_product(sums.imaginary, data[4u * g + 3u], factors[8u * g + 3u]);
    }
    return sums;
}

static void accumulate_row(int32_t *accumulator, const int32_t *rotation, const int32_t *factors, const int32_t *data,
                           uint32_t groups)
{
    struct sums sums = {8u, 8u};
    sums = sum_row(sums, factors, data, groups);
    int32_t cosine = rotation[0], sine = rotation[1];
    int32_t real_2 = as_signed(2u * (uint32_t)accumulator[0]), imaginary_2 = as_signed(2u * (uint32_t)accumulator[1]);
    uint32_t real = subtract_product(add_product(0, real_2, cosine), imaginary_2, sine) + sixteenth(sums.real);
    uint32_t imaginary = add_product(add_product(0, real_2, sine), imaginary_2, cosine) + sixteenth(sums.imaginary);
    accumulator[0] = as_signed(real);
    accumulator[1] = as_signed(imaginary);
}

void frf_block_accumulate_portable(int32_t *accumulators, const int32_t *rows, const int32_t *data, uint32_t row_pairs,
                                   uint32_t groups)
{
    for (uint32_t p = 0; p < row_pairs; ++p) {
        const int32_t *row = rows + p * (8u * groups + 4u);
        accumulate_row(accumulators + 4u * p, row + 8u * groups, row, data, groups);
        accumulate_row(accumulators + 4u * p + 2u, row + 8u * groups + 2, row + 4, data, groups);
    }
}

void frf_block_sum_portable(int32_t *sums, const int32_t *rows, const int32_t *data, uint32_t groups, bool first)
{
    for (uint32_t row = 0; row < 2u; ++row) {
        struct sums row_sums = {8u, 8u};
        if (!first) {
            row_sums.real = (uint32_t)sums[2u * row];
            row_sums.imaginary = (uint32_t)sums[2u * row + 1u];
        }
        row_sums = sum_row(row_sums, rows + 4u * row, data, groups);
        sums[2u * row] = as_signed(row_sums.real);
        sums[2u * row + 1u] = as_signed(row_sums.imaginary);
    }
}

void frf_block_end_sum(int32_t *sums)
{
    for (uint32_t i = 0; i < 4u; ++i) {
        sums[i] = as_signed(sixteenth((uint32_t)sums[i]));
    }
}
