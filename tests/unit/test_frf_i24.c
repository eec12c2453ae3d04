/* SPDX-License-Identifier: MIT */
/* The DFT of 24-bit samples: exact sums of integers against a sum in 96 bits, for random samples and for those that
 * drive a sum as far as it goes; rails; what 24 bits do not hold; the arithmetic's own noise. */
#include "frf/dft.h"
#include "frf/statistics.h"

#include "tests/support/exact_sum.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { period_max = 65536, bins_max = 2046, channels_max = 4 };

static const long double pi_long = 3.14159265358979323846264338327950288L;

static int32_t table[2u * period_max];
static struct frf_twiddles_q23 twiddles;
static union frf_word storage[FRF_STORAGE_WORDS(bins_max, channels_max)];
static uint32_t bins[bins_max];
static uint32_t bin_count;
static int32_t samples[2u * period_max * channels_max];
static uint64_t random_state, sums;

void setUp(void)
{
    random_state = 24;
}

void tearDown(void) {}

static uint32_t random_u32(void)
{
    return exact_random_u32(&random_state);
}

static void fill_random(uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        samples[i] = (int32_t)(random_u32() >> 8) + FRF_I24_MIN;
}

static void spread_bins(uint32_t period, uint32_t most)
{
    bin_count = exact_spread_bins(period, most, bins);
}

static void build(uint32_t period)
{
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_q23(table, FRF_TWIDDLE_WORDS(period), period, &twiddles));
}

static struct frf_dft_config configuration(uint32_t channels)
{
    struct frf_dft_config config = {bins, bin_count, channels, storage, FRF_STORAGE_WORDS(bin_count, channels), 0, 0};
    return config;
}

static void start(struct frf_dft *dft, uint32_t channels)
{
    struct frf_dft_config config = configuration(channels);
    memset(storage, 0x5A, sizeof storage);
    TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_q23(dft, &config, &twiddles));
}

static void expect_sum(const int32_t *frames, uint32_t channels, const int32_t *wave, uint32_t period, uint32_t bin,
                       int sign, int64_t actual)
{
    struct exact_sum expected = {0, 0};
    for (uint32_t n = 0; n < period; n++)
        exact_sum_add(&expected, sign * (int64_t)frames[n * channels] * wave[(uint64_t)bin * n % period]);
    exact_sum_expect(&expected, actual, period, bin);
    sums++;
}

static void expect_exact(const struct frf_dft *dft)
{
    struct frf_period latched;
    TEST_ASSERT_TRUE(frf_dft_latest(dft, &latched));
    for (uint32_t b = 0; b < bin_count; b++) {
        for (uint32_t c = 0; c < dft->channels; c++) {
            expect_sum(samples + c, dft->channels, twiddles.cosine, dft->period_samples, bins[b], 1,
                       frf_period_real(dft, &latched, b, c));
            expect_sum(samples + c, dft->channels, twiddles.sine, dft->period_samples, bins[b], -1,
                       frf_period_imaginary(dft, &latched, b, c));
        }
    }
}

/* Full scale against the sign of the bin's own cosine or sine: no samples make its sum larger. */
static void fill_worst(uint32_t period, uint32_t bin, bool is_sine, bool negative)
{
    const int32_t *wave = is_sine ? twiddles.sine : twiddles.cosine;
    for (uint32_t n = 0; n < period; n++)
        samples[n] = (wave[(uint64_t)bin * n % period] < 0) == negative ? FRF_I24_MAX : FRF_I24_MIN;
}

static void test_i24_all_bins_each_with_its_worst_input(void)
{
    static const uint32_t larger[] = {97, 100, 127, 128};
    for (uint32_t i = 0; i < 61 + sizeof larger / sizeof *larger; i++) {
        uint32_t period = i < 61 ? 4 + i : larger[i - 61];
        build(period);
        spread_bins(period, bins_max);
        for (uint32_t bin = 1; bin <= (period - 1u) / 2u; bin++) {
            struct frf_dft dft;
            fill_worst(period, bin, bin % 2 != 0, bin % 4 < 2);
            start(&dft, 1);
            frf_dft_add_i24(&dft, samples, period);
            expect_exact(&dft);
        }
    }
}

static void test_i24_long_and_prime_periods(void)
{
    static const uint32_t periods[] = {251, 509, 1009, 1002, 2000, 2003, 4093, 16384, 65521, 65536};
    for (unsigned p = 0; p < sizeof periods / sizeof *periods; p++) {
        uint32_t period = periods[p];
        struct frf_dft dft;
        build(period);
        spread_bins(period, period > 5000 ? 12 : bins_max);
        fill_worst(period, bins[bin_count / 3u], p % 2 == 0, true);
        start(&dft, 1);
        frf_dft_add_i24(&dft, samples, period);
        expect_exact(&dft);
        for (uint32_t channels = 1; channels <= channels_max && period <= 2003; channels++) {
            spread_bins(period, 16);
            fill_random(period * channels);
            start(&dft, channels);
            frf_dft_add_i24(&dft, samples, period);
            expect_exact(&dft);
        }
    }
    printf("i24: %llu sums against 96-bit sums, worst inputs and random ones, all bins to N = 4093\n",
           (unsigned long long)sums);
}

/* 2^23 (2^23 - 1) N times the mean of |cos|, 2/pi: near 2^61.35 of the 2^63 that a sum holds. */
static void test_i24_largest_sum_is_where_it_was_reckoned(void)
{
    static const int32_t rails[2] = {FRF_I24_MIN, FRF_I24_MAX};
    const double reckoned = 8388608.0 * 8388607.0 * 65536.0 * 2.0 / 3.14159265358979;
    int64_t largest = 0;
    build(period_max);
    bin_count = 3;
    bins[0] = 1;
    bins[1] = 12345;
    bins[2] = period_max / 2 - 1;
    for (unsigned kind = 0; kind < 7; kind++) {
        struct frf_dft dft;
        struct frf_period latched;
        for (uint32_t n = 0; n < period_max; n++) {
            uint32_t index = (uint32_t)((uint64_t)bins[kind % 3] * n % period_max);
            samples[n] = kind < 3   ? rails[twiddles.cosine[index] < 0]
                         : kind < 4 ? rails[twiddles.sine[index] >= 0]
                         : kind < 5 ? FRF_I24_MIN
                         : kind < 6 ? rails[n % 2]
                                    : FRF_I24_MAX;
        }
        start(&dft, 1);
        frf_dft_add_i24(&dft, samples, period_max);
        expect_exact(&dft);
        TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
        TEST_ASSERT_EQUAL_UINT32(frf_reason_saturated, latched.reasons);
        TEST_ASSERT_EQUAL_UINT32(period_max, dft.err.saturated);
        for (uint32_t b = 0; b < bin_count; b++) {
            int64_t sum = frf_period_real(&dft, &latched, b, 0);
            largest = sum > largest ? sum : -sum > largest ? -sum : largest;
        }
    }
    printf("worst case Q23, N = 65536: |sum| up to 2^%.3f of 2^63\n", log2((double)largest));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4 * reckoned, reckoned, (double)largest);
}

static void test_i24_does_not_depend_on_chunks(void)
{
    static const uint32_t chunks[] = {1, 2, 7, 31, 32, 33, 100, 101, 500};
    static union frf_word expected[FRF_STORAGE_WORDS(16u, 3u)];
    const uint32_t period = 100;
    build(period);
    spread_bins(period, 16);
    fill_random(2 * period * 3);
    for (unsigned i = 0; i < sizeof chunks / sizeof *chunks; i++) {
        struct frf_dft dft;
        struct frf_period latched;
        start(&dft, 3);
        for (uint32_t at = 0; at < 2 * period; at += chunks[i])
            frf_dft_add_i24(&dft, samples + at * 3u, 2 * period - at < chunks[i] ? 2 * period - at : chunks[i]);
        TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
        TEST_ASSERT_EQUAL_UINT32(2, latched.sequence);
        if (i == 0)
            memcpy(expected, latched.sums, sizeof *expected * 2 * bin_count * 3);
        TEST_ASSERT_EQUAL_MEMORY(expected, latched.sums, sizeof *expected * 2 * bin_count * 3);
    }
}

static void test_i24_saturation_at_the_rail_and_one_below(void)
{
    static const int32_t at_rail[4] = {500000, -600000, 499999, -599999};
    static const int32_t at_end[4] = {FRF_I24_MAX, FRF_I24_MIN, FRF_I24_MAX - 1, FRF_I24_MIN + 1};
    const uint32_t period = 16;
    build(period);
    spread_bins(period, 3);
    for (unsigned given = 0; given < 2; given++) {
        struct frf_dft dft;
        struct frf_period latched;
        struct frf_dft_config config = configuration(2);
        config.rail_low = given ? -600000 : 0;
        config.rail_high = given ? 500000 : 0;
        TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_q23(&dft, &config, &twiddles));
        for (unsigned i = 0; i < 4; i++) {
            memset(samples, 0, sizeof *samples * 6 * period);
            samples[4 * period - 1] = given ? at_rail[i] : at_end[i]; /* second period, last frame, second channel */
            frf_dft_add_i24(&dft, samples, 2 * period);
            TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
            TEST_ASSERT_EQUAL_UINT32(i < 2 ? frf_reason_saturated : 0, latched.reasons);
            TEST_ASSERT_NOT_EQUAL_INT64(0, frf_period_real(&dft, &latched, 0, 1)); /* and has been added */
            frf_dft_add_i24(&dft, samples, period);
            TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
            TEST_ASSERT_EQUAL_UINT32(0, latched.reasons);
        }
        TEST_ASSERT_EQUAL_UINT32(2, dft.err.saturated);
    }
}

/* A sample that 24 bits do not hold, anywhere in three periods: its frame counts as zeros, its period as saturated. */
static void test_i24_frame_that_does_not_fit_counts_as_zeros(void)
{
    static const int32_t beyond[4] = {FRF_I24_MAX + 1, FRF_I24_MIN - 1, INT32_MAX, INT32_MIN};
    const uint32_t period = 10, total = 30;
    build(period);
    spread_bins(period, 4);
    for (uint32_t at = 0; at < total; at++) {
        for (unsigned i = 0; i < 8; i++) {
            struct frf_dft dft;
            static int32_t given[2 * 30];
            fill_random(total * 2);
            memcpy(given, samples, sizeof given);
            given[2 * at + i % 2] = beyond[i / 2];
            samples[2 * at] = samples[2 * at + 1] = 0;
            start(&dft, 2);
            for (uint32_t p = 0; p < 3; p++) {
                struct frf_period latched;
                frf_dft_add_i24(&dft, given + p * period * 2, period);
                TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
                TEST_ASSERT_EQUAL_UINT32(p + 1, latched.sequence);
                TEST_ASSERT_EQUAL_UINT32(at / period == p ? frf_reason_saturated : 0, latched.reasons);
                for (uint32_t b = 0; b < bin_count; b++) {
                    for (uint32_t c = 0; c < 2; c++) {
                        const int32_t *frames = samples + p * period * 2 + c;
                        expect_sum(frames, 2, twiddles.cosine, period, bins[b], 1,
                                   frf_period_real(&dft, &latched, b, c));
                        expect_sum(frames, 2, twiddles.sine, period, bins[b], -1,
                                   frf_period_imaginary(&dft, &latched, b, c));
                    }
                }
            }
            TEST_ASSERT_EQUAL_UINT32(1, dft.err.saturated);
        }
    }
}

static void test_i24_refuses_samples_and_rails_of_another_width(void)
{
    static int16_t narrow[16];
    static float fractions[16];
    struct frf_dft dft;
    struct frf_period latched;
    const uint32_t period = 16;
    build(period);
    spread_bins(period, 3);
    start(&dft, 1);
    frf_dft_add_i16(&dft, narrow, period);
    frf_dft_add_f32(&dft, fractions, period);
    TEST_ASSERT_EQUAL_UINT32(2, dft.err.wrong_type);
    TEST_ASSERT_FALSE(frf_dft_latest(&dft, &latched));
    memset(samples, 0, sizeof *samples * period);
    frf_dft_add_i24(&dft, samples, period);
    TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
    TEST_ASSERT_EQUAL_UINT32(frf_reason_wrong_type, latched.reasons);

    static int16_t table_q15[FRF_TWIDDLE_WORDS(16u)];
    struct frf_twiddles_q15 q15;
    struct frf_dft_config config = configuration(1);
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_q15(table_q15, FRF_TWIDDLE_WORDS(16u), period, &q15));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_q15(&dft, &config, &q15));
    frf_dft_add_i24(&dft, samples, period);
    TEST_ASSERT_EQUAL_UINT32(1, dft.err.wrong_type);
    TEST_ASSERT_EQUAL_UINT32(frf_reason_wrong_type, dft.reasons);

    static const int32_t rails[][2] = {{FRF_I24_MIN, FRF_I24_MAX + 1}, {FRF_I24_MIN - 1, FRF_I24_MAX}, {7, 7}, {7, 6}};
    for (unsigned i = 0; i < 4; i++) {
        config.rail_low = rails[i][0];
        config.rail_high = rails[i][1];
        TEST_ASSERT_EQUAL_INT(core_err_frf_rails, frf_dft_init_q23(&dft, &config, &twiddles));
    }
    config.rail_low = FRF_I24_MIN;
    config.rail_high = FRF_I24_MAX;
    TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_q23(&dft, &config, &twiddles));
    TEST_ASSERT_EQUAL_INT(core_err_frf_rails, frf_dft_init_q15(&dft, &config, &q15));
    config.rail_high = INT16_MAX + 1;
    config.rail_low = INT16_MIN;
    TEST_ASSERT_EQUAL_INT(core_err_frf_rails, frf_dft_init_q15(&dft, &config, &q15));
    config.rail_high = INT16_MAX;
    TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_q15(&dft, &config, &q15));
    config = configuration(1);
    struct frf_twiddles_q23 bad = twiddles;
    bad.sine = NULL;
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_q23(&dft, &config, &bad));
    bad = twiddles;
    bad.cosine = NULL;
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_q23(&dft, &config, &bad));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_q23(&dft, &config, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_storage, frf_twiddles_build_q23(table, FRF_TWIDDLE_WORDS(8u) - 1u, 8, &bad));
    TEST_ASSERT_EQUAL_INT(core_err_frf_period, frf_twiddles_build_q23(table, 100, 3, &bad));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_twiddles_build_q23(table, 100, 8, NULL));
}

static void test_i24_table_is_correctly_rounded(void)
{
    static const uint32_t periods[] = {4, 5, 6, 97, 2000, 65536};
    for (unsigned p = 0; p < sizeof periods / sizeof *periods; p++) {
        build(periods[p]);
        for (uint32_t n = 0; n < periods[p]; n++) {
            long double angle = 2 * pi_long * (long double)n / (long double)periods[p];
            TEST_ASSERT_TRUE(fabsl(twiddles.sine[n] - FRF_Q23_ONE * sinl(angle)) <= 0.5L + 1e-6L);
            TEST_ASSERT_TRUE(fabsl(twiddles.cosine[n] - FRF_Q23_ONE * cosl(angle)) <= 0.5L + 1e-6L);
        }
    }
}

static uint32_t common_divisor(uint32_t a, uint32_t b)
{
    return b == 0 ? a : common_divisor(b, a % b);
}

/* What 24 bits of arithmetic leave of 24-bit data. A factor is off by up to half a step, 1/12 of a step squared on
 * average in each of its parts. Bin k sees M = N/g entries of the table, g = gcd(k, N): the errors repeat after M
 * samples, so only lines at multiples of g reach the bin. A quarter of a turn makes j of a factor and of its error, so
 * if 4 divides M it is every fourth of these multiples (if 2 does, every second), four times as much of each. A line is
 * N A / 2, as the bin's own is, and with its mirror image two: if s of them reach the bin,
 *
 *     mean SNR = 6 M F^2 / (q s),    q = 4, 2, 1;    F = 2^23 - 1;    over all bins about 3 N F^2 / K
 *
 * for K lines: 160.8, 169.7, 175.6 dB for 35, 37, 38 of them. About its mean the error scatters as a normal variable:
 * four standard deviations are 12 dB. A bin with few entries has a gain error at worst, of half a step in both parts:
 * above 20 log10(sqrt(2) F) = 141.5 dB whatever its entries are. That is what is required of N = 2000, where the last
 * bin, 800, sees five of them; of the powers of two Q15's required figures are, by the 8 bits that Q23 has more. */
enum { scatter_dB = 12 };

static double mean_snr_dB(uint32_t bin, uint32_t period)
{
    uint32_t divisor = common_divisor(bin, period), entries = period / divisor, reaching = 0;
    int32_t kinds = entries % 4 == 0 ? 4 : entries % 2 == 0 ? 2 : 1;
    for (uint32_t b = 0; b < bin_count; b++) {
        int32_t line = (int32_t)(bins[b] / divisor), own = (int32_t)(bin / divisor);
        reaching += bins[b] % divisor == 0 && (line - own) % kinds == 0;
        reaching += bins[b] % divisor == 0 && (line + own) % kinds == 0;
    }
    return 10 * log10(6.0 * entries * FRF_Q23_ONE * FRF_Q23_ONE / (kinds * (double)reaching));
}

static void test_i24_signal_to_noise_of_the_arithmetic(void)
{
    static const uint32_t periods[3] = {2000, 16384, 65536};
    static const double required_dB[3] = {141, 156, 163};
    static long double sine[period_max];
    static double signal[period_max];
    for (unsigned run = 0; run < 6; run++) {
        uint32_t period = periods[run / 2];
        double peak = 0, worst = INFINITY, mean = 0;
        build(period);
        bin_count = 0;
        for (unsigned i = 0; i < 40; i++) {
            uint32_t bin = (uint32_t)lround(pow(0.4 * period, i / 39.0));
            if (bin_count == 0 || bin > bins[bin_count - 1u])
                bins[bin_count++] = bin;
        }
        random_state = 1 + run;
        for (uint32_t n = 0; n < period; n++)
            sine[n] = sinl(2 * pi_long * (long double)n / (long double)period);
        memset(signal, 0, sizeof signal);
        for (uint32_t b = 0; b < bin_count; b++) {
            uint32_t phase = random_u32() % period;
            for (uint32_t n = 0; n < period; n++)
                signal[n] += (double)sine[((uint64_t)bins[b] * n + phase) % period];
        }
        for (uint32_t n = 0; n < period; n++)
            peak = fmax(peak, fabs(signal[n]));
        for (uint32_t n = 0; n < period; n++)
            samples[n] = (int32_t)lround(0.95 * FRF_I24_MAX * signal[n] / peak);
        struct frf_dft dft;
        struct frf_period latched;
        start(&dft, 1);
        frf_dft_add_i24(&dft, samples, period);
        TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
        TEST_ASSERT_EQUAL_UINT32(0, latched.reasons);
        for (uint32_t b = 0; b < bin_count; b++) {
            long double real = 0, imaginary = 0, one = FRF_Q23_ONE;
            for (uint32_t n = 0; n < period; n++) {
                uint32_t index = (uint32_t)((uint64_t)bins[b] * n % period);
                real += samples[n] * sine[(index + period / 4u) % period];
                imaginary -= samples[n] * sine[index];
            }
            long double error = hypotl((long double)frf_period_real(&dft, &latched, b, 0) / one - real,
                                       (long double)frf_period_imaginary(&dft, &latched, b, 0) / one - imaginary);
            double snr_dB = (double)(20 * log10l(hypotl(real, imaginary) / error));
            struct frf_complex value = frf_period_value(&dft, &latched, b, 0);
            TEST_ASSERT_DOUBLE_WITHIN(1e-6 * (double)hypotl(real, imaginary), (double)real, value.real);
            TEST_ASSERT_DOUBLE_WITHIN(1e-6 * (double)hypotl(real, imaginary), (double)imaginary, value.imaginary);
            TEST_ASSERT_TRUE(snr_dB >= mean_snr_dB(bins[b], period) - scatter_dB);
            worst = fmin(worst, snr_dB);
            mean += snr_dB / bin_count;
        }
        printf("SNR N = %5u, %u bins, seed %u, Q23 of 24 bits worst %6.1f dB, mean %6.1f dB, required %.0f dB\n",
               (unsigned)period, (unsigned)bin_count, 1 + run, worst, mean, required_dB[run / 2]);
        TEST_ASSERT_TRUE(worst >= required_dB[run / 2]);
    }
}

/* The statistics on the target take it as any other: y = 0.5 u, with noise of known scatter. */
static void test_i24_statistics_give_the_response(void)
{
    const uint32_t period = 200;
    static struct frf_pair pairs[3];
    struct frf_statistics statistics;
    struct frf_estimate estimate;
    struct frf_dft dft;
    build(period);
    bin_count = 1;
    bins[0] = 3;
    start(&dft, 2);
    TEST_ASSERT_EQUAL_INT(core_ok, frf_statistics_init(&statistics, pairs, 1));
    for (unsigned m = 0; m < 8; m++) {
        for (uint32_t n = 0; n < period; n++) {
            long double wave = 4000000.0L * cosl(2 * pi_long * 3 * (long double)n / period);
            samples[2 * n] = (int32_t)lroundl(wave);
            samples[2 * n + 1] = (int32_t)lroundl(0.5L * wave) + (int32_t)(random_u32() % 2001u) - 1000;
        }
        if (m == 5)
            samples[7] = FRF_I24_MAX + 1;
        frf_dft_add_i24(&dft, samples, period);
        TEST_ASSERT_EQUAL(m != 5, frf_statistics_add_period(&statistics, &dft, 0, 1));
    }
    TEST_ASSERT_EQUAL_UINT32(7, statistics.periods);
    TEST_ASSERT_EQUAL_UINT32(1, statistics.excluded.by_reason[1]);
    frf_statistics_estimate(&statistics, 0, 0, &estimate);
    /* Noise uniform in +-1000: variance of Y_k N 10^6 / 3; |U| = N A / 2; of the mean of 7. */
    double expected = sqrt(period * 1e6 / 3.0 / 7.0) / (period * 4e6 / 2.0);
    TEST_ASSERT_EQUAL_INT(frf_valid, estimate.validity);
    TEST_ASSERT_DOUBLE_WITHIN(5 * expected, 0.5, (double)estimate.real);
    TEST_ASSERT_DOUBLE_WITHIN(5 * expected, 0.0, (double)estimate.imaginary);
    TEST_ASSERT_TRUE(estimate.std > 0.3 * expected && estimate.std < 2.5 * expected);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_i24_all_bins_each_with_its_worst_input);
    RUN_TEST(test_i24_long_and_prime_periods);
    RUN_TEST(test_i24_largest_sum_is_where_it_was_reckoned);
    RUN_TEST(test_i24_does_not_depend_on_chunks);
    RUN_TEST(test_i24_saturation_at_the_rail_and_one_below);
    RUN_TEST(test_i24_frame_that_does_not_fit_counts_as_zeros);
    RUN_TEST(test_i24_refuses_samples_and_rails_of_another_width);
    RUN_TEST(test_i24_table_is_correctly_rounded);
    RUN_TEST(test_i24_signal_to_noise_of_the_arithmetic);
    RUN_TEST(test_i24_statistics_give_the_response);
    return UNITY_END();
}
