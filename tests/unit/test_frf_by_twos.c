/* SPDX-License-Identifier: MIT */
/* The exact DFT with Q15 factors as a core without a long multiply computes it, compiled into this program beside the
 * library's: the same sums for every channel count, cut and period. */
#define SERVOSCOPE_FRF_LONG_MULTIPLY 0
#define frf_dft_init_q15             init_by_twos
#include "frf/dft_q15.c"
#undef frf_dft_init_q15
enum core_status frf_dft_init_q15(struct frf_dft *self, const struct frf_dft_config *config,
                                  const struct frf_twiddles_q15 *twiddles);

#include "unity.h"

#include <stdio.h>

enum { period_max = 1009, bins_max = 7, channels_max = 4 };

static int16_t table[2 * period_max];
static int16_t samples[2 * period_max * channels_max];
static const uint32_t bins[bins_max] = {1, 2, 3, 7, 11, 30, 48};

void setUp(void)
{
    uint32_t state = 7;
    for (unsigned i = 0; i < sizeof samples / sizeof *samples; i++) {
        state = state * 1664525u + 1013904223u;
        samples[i] = state >> 31 ? INT16_MIN : (int16_t)((int32_t)(state >> 15 & 0xFFFFu) - 32768);
    }
}

void tearDown(void) {}

static void expect_same(uint32_t period, uint32_t channels, uint32_t chunk)
{
    static union frf_word words[2][FRF_STORAGE_WORDS(bins_max, channels_max)];
    struct frf_twiddles_q15 twiddles;
    struct frf_dft dft[2];
    struct frf_period latched[2];
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_q15(table, FRF_TWIDDLE_WORDS(period), period, &twiddles));
    for (unsigned i = 0; i < 2; i++) {
        struct frf_dft_config config = {bins, bins_max, channels, words[i], FRF_STORAGE_WORDS(bins_max, channels_max),
                                        0,    0};
        TEST_ASSERT_EQUAL_INT(core_ok, (i == 0 ? frf_dft_init_q15 : init_by_twos)(&dft[i], &config, &twiddles));
        for (uint32_t at = 0; at < 2 * period; at += chunk)
            frf_dft_add_i16(&dft[i], samples + at * channels, chunk < 2 * period - at ? chunk : 2 * period - at);
        TEST_ASSERT_TRUE(frf_dft_latest(&dft[i], &latched[i]));
        TEST_ASSERT_EQUAL_UINT32(2, latched[i].sequence);
    }
    for (uint32_t b = 0; b < bins_max; b++) {
        for (uint32_t c = 0; c < channels; c++) {
            TEST_ASSERT_EQUAL_INT64(frf_period_real(&dft[0], &latched[0], b, c),
                                    frf_period_real(&dft[1], &latched[1], b, c));
            TEST_ASSERT_EQUAL_INT64(frf_period_imaginary(&dft[0], &latched[0], b, c),
                                    frf_period_imaginary(&dft[1], &latched[1], b, c));
        }
    }
}

static void test_by_twos_equals_the_exact_sums(void)
{
    static const uint32_t periods[] = {97, 100, 1009}, chunks[] = {1, 2, 7, 64, 5000};
    for (unsigned p = 0; p < 3; p++)
        for (uint32_t channels = 1; channels <= channels_max; channels++)
            for (unsigned c = 0; c < 5; c++)
                expect_same(periods[p], channels, chunks[c]);
}

static void test_by_twos_refuses_as_the_other(void)
{
    struct frf_twiddles_q15 twiddles = {table, table, 100};
    struct frf_dft dft;
    TEST_ASSERT_EQUAL_INT(core_err_argument, init_by_twos(&dft, NULL, &twiddles));
    TEST_ASSERT_EQUAL_INT(core_err_argument, init_by_twos(&dft, NULL, NULL));
    twiddles.sine = NULL;
    TEST_ASSERT_EQUAL_INT(core_err_argument, init_by_twos(&dft, NULL, &twiddles));
    twiddles = (struct frf_twiddles_q15){table, NULL, 100};
    TEST_ASSERT_EQUAL_INT(core_err_argument, init_by_twos(&dft, NULL, &twiddles));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_by_twos_equals_the_exact_sums);
    RUN_TEST(test_by_twos_refuses_as_the_other);
    return UNITY_END();
}
