/* SPDX-License-Identifier: MIT */
#include "lab/numeric/tall_qr.h"

#include "lab/numeric/statistics.h"
#include "unity.h"

#include <math.h>

enum { columns = 5, many_rows = 1000 };

/// Relative to the columns' lengths: sums of 1000 products.
static const double exact = 1e-12;

static double A[many_rows][columns];
static double R[columns * columns];

void setUp(void)
{
    struct random random;
    random_seed(&random, 3);
    for (size_t i = 0; i < many_rows; i++) {
        for (size_t j = 0; j < columns; j++) {
            A[i][j] = random_normal(&random) * pow(10.0, 3.0 * (double)j);
        }
    }
}

void tearDown(void) {}

static bool factorise(size_t rows)
{
    struct tall_qr qr;
    TEST_ASSERT_TRUE(tall_qr_init(&qr, columns));
    for (size_t i = 0; i < rows; i++) {
        tall_qr_add(&qr, A[i]);
    }
    bool good = tall_qr_finish(&qr, R);
    tall_qr_free(&qr);
    return good;
}

static void check_gram(size_t rows)
{
    for (size_t i = 0; i < columns; i++) {
        for (size_t j = 0; j < columns; j++) {
            double wanted = 0.0, found = 0.0, size_i = 0.0, size_j = 0.0;
            for (size_t r = 0; r < rows; r++) {
                wanted += A[r][i] * A[r][j];
                size_i += A[r][i] * A[r][i];
                size_j += A[r][j] * A[r][j];
            }
            for (size_t r = 0; r < columns; r++) {
                found += R[i * columns + r] * R[j * columns + r];
            }
            TEST_ASSERT_DOUBLE_WITHIN(exact * sqrt(size_i * size_j), wanted, found);
        }
    }
}

static void test_tall_qr_keeps_the_gram_matrix_over_many_blocks(void)
{
    TEST_ASSERT_TRUE(factorise(many_rows));
    check_gram(many_rows);
    for (size_t j = 0; j < columns; j++) {
        for (size_t i = j + 1; i < columns; i++) {
            TEST_ASSERT_EQUAL_DOUBLE(0.0, R[j * columns + i]);
        }
    }
}

static void test_tall_qr_pads_with_zero_rows_when_rows_are_few(void)
{
    TEST_ASSERT_TRUE(factorise(3));
    check_gram(3);
    for (size_t j = 0; j < columns; j++) {
        for (size_t i = 3; i < columns; i++) {
            TEST_ASSERT_EQUAL_DOUBLE(0.0, R[j * columns + i]);
        }
    }
    TEST_ASSERT_TRUE(factorise(0));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, R[0]);
}

static void test_tall_qr_refuses_what_is_not_finite(void)
{
    A[17][2] = NAN;
    TEST_ASSERT_FALSE(factorise(many_rows));
    A[17][2] = INFINITY;
    TEST_ASSERT_FALSE(factorise(20));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_tall_qr_keeps_the_gram_matrix_over_many_blocks);
    RUN_TEST(test_tall_qr_pads_with_zero_rows_when_rows_are_few);
    RUN_TEST(test_tall_qr_refuses_what_is_not_finite);
    return UNITY_END();
}
