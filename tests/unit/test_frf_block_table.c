/* SPDX-License-Identifier: MIT */
/* Which layout the block DFT's coefficients get, and that they are what their header says. */
#include "frf/block_table.h"

#include "unity.h"

#include <math.h>
#include <string.h>

enum { bins_max = 200, words_max = FRF_BLOCK_TABLE_WORDS(bins_max, 64u, 64u) };

/* Required: what the shared functions do not hold of a line, RMS over a block. */
static const double basis_error_max = 1e-4;
/* Rounding of at most 64 factors of the line to Q31. */
static const double rounding = 64 / 2147483648.0;

static const double two_pi = 6.28318530717958647692;

static int32_t coefficients[words_max], again[words_max];
static uint32_t bins[bins_max];

void setUp(void) {}

void tearDown(void) {}

/* `count` bins: step, 2 step, ... */
static void multiples_of(uint32_t step, uint32_t count)
{
    for (uint32_t b = 0; b < count; b++)
        bins[b] = (b + 1u) * step;
}

static void expect_choice(uint32_t bin_count, uint32_t period, uint32_t part_max, struct frf_block_layout expected)
{
    struct frf_block_layout layout;
    frf_block_choose(bins, bin_count, period, part_max, &layout);
    TEST_ASSERT_EQUAL_UINT32(expected.block_samples, layout.block_samples);
    TEST_ASSERT_EQUAL_UINT32(expected.terms, layout.terms);
    TEST_ASSERT_EQUAL_UINT32(expected.repeats, layout.repeats);
}

/* Instructions a sample and bin: (11/4 R + 28) / 2L, and with a basis R/2 rows of (11/4 L + 28) / 2L among the bins.
 * Folded in blocks of 32: 1.81. Up to bin 1000 of 50000, L = 128, R = 12: 0.24 + 8.91/K, so 2.02 at five bins and 1.72
 * at six. */
static void test_choice_shares_a_basis_where_bins_pay_for_it(void)
{
    multiples_of(200, 5);
    expect_choice(5, 50000, 0, (struct frf_block_layout){32, 32, 1});
    multiples_of(166, 6);
    expect_choice(6, 50000, 0, (struct frf_block_layout){128, 12, 1});
}

/* Of 190 samples blocks of 64 are two and a rest: 0.73 + 19.1/19 = 1.74. */
static void test_choice_has_at_least_two_blocks_in_a_period(void)
{
    multiples_of(1, 19);
    expect_choice(19, 190, 0, (struct frf_block_layout){64, 24, 1});
    multiples_of(1, 5);
    expect_choice(5, 64, 0, (struct frf_block_layout){32, 32, 1});
    expect_choice(5, 63, 0, (struct frf_block_layout){0, 0, 1});
}

static void test_choice_folds_down_to_two_blocks(void)
{
    multiples_of(2, 3);
    expect_choice(3, 128, 64, (struct frf_block_layout){32, 32, 2});
    expect_choice(3, 128, 63, (struct frf_block_layout){32, 32, 1});
    expect_choice(3, 126, 64, (struct frf_block_layout){32, 32, 1});
}

/* An odd number of bins leaves half a pair of rows empty: that is nothing too, and not what was in memory. */
static void test_table_is_the_same_whatever_was_in_memory(void)
{
    static const struct frf_block_layout layouts[] = {{32, 32, 1}, {32, 16, 1}};
    multiples_of(3, 7);
    for (unsigned i = 0; i < sizeof layouts / sizeof layouts[0]; i++) {
        uint32_t words = FRF_BLOCK_TABLE_WORDS(7u, 32u, layouts[i].terms);
        struct frf_block_table table;
        memset(coefficients, 0x5A, sizeof coefficients);
        memset(again, 0xA5, sizeof again);
        TEST_ASSERT_EQUAL_INT(core_ok, frf_block_build(coefficients, words, bins, 7, 400, &layouts[i], &table));
        TEST_ASSERT_EQUAL_INT(core_ok, frf_block_build(again, words, bins, 7, 400, &layouts[i], &table));
        TEST_ASSERT_EQUAL_MEMORY(coefficients, again, words * sizeof *again);
    }
}

/* Factor `term` of a row of `terms` (frf/block_kernel.h), as a number. */
static double factor_of(const int32_t *rows, uint32_t terms, uint32_t row, uint32_t term)
{
    const int32_t *pair = rows + row / 2u * (4u + 2u * terms);
    return pair[term / 4u * 8u + row % 2u * 4u + term % 4u] / 2147483648.0;
}

/* RMS over a block of the line less what the shared functions, a quarter of unit RMS each, make of it. */
static double error_of_line(const struct frf_block_table *table, uint32_t b, unsigned is_sine)
{
    uint32_t block = table->layout.block_samples, terms = table->layout.terms;
    double squares = 0;
    for (uint32_t i = 0; i < block / 2u; i++) {
        double angle = two_pi * table->bins[b] * (i + 0.5) / table->period_samples;
        double error = is_sine ? -sin(angle) : cos(angle);
        for (uint32_t row = 0; row < terms / 2u; row++) {
            error -= factor_of(table->rows, terms, b, 2u * row + is_sine) *
                     factor_of(table->basis, block, row, 2u * i + is_sine) * 4.0;
        }
        squares += error * error;
    }
    return sqrt(squares / (block / 2u));
}

/* However many functions there are: what is built holds every line, what does not is refused. */
static void test_table_with_a_basis_holds_its_lines_or_is_refused(void)
{
    unsigned built = 0, refused = 0;
    for (uint32_t block = 16; block <= 64; block *= 2u) {
        for (uint32_t terms = 4; terms < block; terms += 4) {
            for (uint32_t step = 1; step <= 19; step++) {
                struct frf_block_layout layout = {block, terms, 1};
                struct frf_block_table table;
                multiples_of(step, 10);
                enum core_status status = frf_block_build(coefficients, words_max, bins, 10, 400, &layout, &table);
                if (status != core_ok) {
                    TEST_ASSERT_EQUAL_INT(core_err_frf_block, status);
                    refused++;
                    continue;
                }
                built++;
                for (uint32_t b = 0; b < 10; b++) {
                    TEST_ASSERT_TRUE(error_of_line(&table, b, 0) <= basis_error_max + rounding);
                    TEST_ASSERT_TRUE(error_of_line(&table, b, 1) <= basis_error_max + rounding);
                }
            }
        }
    }
    TEST_ASSERT_TRUE(built > 50 && refused > 50);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_choice_shares_a_basis_where_bins_pay_for_it);
    RUN_TEST(test_choice_has_at_least_two_blocks_in_a_period);
    RUN_TEST(test_choice_folds_down_to_two_blocks);
    RUN_TEST(test_table_is_the_same_whatever_was_in_memory);
    RUN_TEST(test_table_with_a_basis_holds_its_lines_or_is_refused);
    return UNITY_END();
}
