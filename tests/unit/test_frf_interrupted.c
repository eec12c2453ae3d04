/* SPDX-License-Identifier: MIT */
/* The reader of the DFT interrupted by its writer, at every place where the two meet: the memory barriers. Here they
 * are the interrupt, which feeds as many periods as are planned; nothing torn may pass as a period. */
static void interrupt_now(void);
#define SERVOSCOPE_MEMORY_BARRIER() interrupt_now()
#include "frf/dft.c"

#include "frf/statistics.h"

#include "unity.h"

enum { period = 8, bin_count = 2, channels = 2 };

static const uint32_t bins[bin_count] = {1, 3};
static int16_t sines[FRF_TWIDDLE_WORDS(8u)];
static union frf_word words[FRF_STORAGE_WORDS(bin_count, channels)];
static struct frf_twiddles_q15 twiddles;
static struct frf_dft dft;
static int32_t barriers_until, periods_due, amplitude;

/* The writer: period after period a larger sample, so that each period's sums are its own. */
static void feed_period(void)
{
    int16_t frames[period * channels];
    ++amplitude;
    for (unsigned i = 0; i < period * channels; i++)
        frames[i] = (int16_t)(i / channels == 0 ? amplitude : 0);
    frf_dft_add_i16(&dft, frames, period);
}

static void interrupt_now(void)
{
    int32_t due = periods_due;
    if (due == 0 || barriers_until-- > 0)
        return;
    periods_due = 0; /* the writer meets barriers too, and is not interrupted by itself */
    while (due-- > 0)
        feed_period();
}

void setUp(void)
{
    struct frf_dft_config config = {bins, bin_count, channels, words, FRF_STORAGE_WORDS(bin_count, channels), 0, 0};
    periods_due = 0;
    amplitude = 0;
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_q15(sines, FRF_TWIDDLE_WORDS(8u), period, &twiddles));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_q15(&dft, &config, &twiddles));
}

void tearDown(void) {}

/* Of a pulse at n = 0 every bin is its height. */
static void expect_whole(const struct frf_period *latched)
{
    for (uint32_t b = 0; b < bin_count; b++)
        for (uint32_t c = 0; c < channels; c++)
            TEST_ASSERT_EQUAL_INT64((int64_t)latched->sequence * FRF_Q15_ONE, frf_period_real(&dft, latched, b, c));
}

static void test_interrupted_reader_never_takes_a_torn_period(void)
{
    unsigned taken = 0, refused = 0;
    for (int32_t due = 0; due <= 3; due++) {
        for (int32_t until = 0; until < 4; until++) {
            struct frf_period latched;
            setUp();
            feed_period();
            barriers_until = until;
            periods_due = due;
            bool is_there = frf_dft_latest(&dft, &latched);
            if (is_there)
                expect_whole(&latched);
            if (is_there && frf_dft_is_intact(&dft, &latched)) {
                TEST_ASSERT_EQUAL_UINT32(dft.sequence, latched.sequence);
                taken++;
            } else {
                TEST_ASSERT_EQUAL_UINT32(due + 1, dft.sequence);
                refused++;
            }
        }
    }
    TEST_ASSERT_EQUAL_UINT(16, taken + refused);
    TEST_ASSERT_GREATER_THAN_UINT(0, taken);
    TEST_ASSERT_GREATER_THAN_UINT(0, refused);
}

/* frf_statistics_add_period() meets three barriers: two in looking, one in asking afterwards. */
static void test_interrupted_statistics_count_the_period_as_overrun(void)
{
    static struct frf_pair pairs[bin_count];
    struct frf_statistics statistics;
    for (int32_t until = 0; until < 3; until++) {
        setUp();
        TEST_ASSERT_EQUAL_INT(core_ok, frf_statistics_init(&statistics, pairs, bin_count));
        feed_period();
        barriers_until = until;
        periods_due = 1;
        TEST_ASSERT_FALSE(frf_statistics_add_period(&statistics, &dft, 0, 1));
        TEST_ASSERT_EQUAL_UINT32(2, dft.sequence);
        TEST_ASSERT_EQUAL_UINT32(until == 2 ? 1 : 0, statistics.excluded.overrun);
        TEST_ASSERT_EQUAL_UINT32(0, statistics.periods);
        TEST_ASSERT_TRUE(frf_statistics_add_period(&statistics, &dft, 0, 1));
        TEST_ASSERT_EQUAL_UINT32(until == 2 ? 0 : 1, statistics.excluded.missed);
        TEST_ASSERT_TRUE(pairs[0].input_mean.real == 2);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_interrupted_reader_never_takes_a_torn_period);
    RUN_TEST(test_interrupted_statistics_count_the_period_as_overrun);
    return UNITY_END();
}
