/* SPDX-License-Identifier: MIT */
/* The DFT at the excited bins against two references that share no code with it: a big-integer sum over the same
 * table, which the integer variants have to equal bit for bit, and a long double DFT of the same samples. */
#include "frf/dft.h"
#include "frf/statistics.h"

#include "tests/support/exact_sum.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PERIOD_MAX 65536u
enum { bins_max = 64, channels_max = 3, canary_words = 4 };
enum { canary = 0x5A }; /* a large number whether read as an integer or as a float: what is not cleared is seen */

/* Required by reference: SNR of the arithmetic alone at the worst bin, dB, for N = 2000, 16384, 65536. */
static const uint32_t snr_periods[3] = {2000, 16384, 65536};
static const double snr_q15_dB[3] = {100, 108, 115};
static const double snr_q31_dB[3] = {190, 200, 205};
static const double snr_f32_dB[3] = {125, 118, 115};

static const long double pi_long = 3.14159265358979323846264338327950288L;

static int16_t table_q15[FRF_TWIDDLE_WORDS(PERIOD_MAX - 1u) + 1u];
static int32_t table_q31[FRF_TWIDDLE_WORDS(PERIOD_MAX - 1u) + 1u];
static float table_f32[FRF_TWIDDLE_WORDS(PERIOD_MAX - 1u) + 1u];
static struct frf_twiddles_q15 twiddles_q15;
static struct frf_twiddles_q31 twiddles_q31;
static struct frf_twiddles_f32 twiddles_f32;
static union frf_word storage[FRF_STORAGE_WORDS(bins_max, channels_max) + canary_words];
static uint32_t bins[bins_max];
static uint32_t bin_count;
static int16_t samples[PERIOD_MAX * channels_max + 8];
static float samples_f32[PERIOD_MAX * channels_max + 8];
static long double sine_long[PERIOD_MAX];
static uint64_t random_state;

static uint32_t random_u32(void)
{
    return exact_random_u32(&random_state);
}

void setUp(void)
{
    random_state = 1;
}

void tearDown(void) {}

static void build_tables(uint32_t period)
{
    uint32_t words = FRF_TWIDDLE_WORDS(period);
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_q15(table_q15, words, period, &twiddles_q15));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_q31(table_q31, words, period, &twiddles_q31));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_f32(table_f32, words, period, &twiddles_f32));
    for (uint32_t n = 0; n < period; n++)
        sine_long[n] = sinl(2 * pi_long * (long double)n / (long double)period);
}

static struct frf_dft_config configuration(uint32_t channels)
{
    struct frf_dft_config config = {.bins = bins, .bin_count = bin_count, .channels = channels, .storage = storage};
    config.storage_words = FRF_STORAGE_WORDS(bin_count, channels);
    return config;
}

static void start(struct frf_dft *dft, enum frf_number number, uint32_t channels)
{
    struct frf_dft_config config = configuration(channels);
    memset(storage, canary, sizeof storage);
    enum core_status status = number == frf_number_q15   ? frf_dft_init_q15(dft, &config, &twiddles_q15)
                              : number == frf_number_q31 ? frf_dft_init_q31(dft, &config, &twiddles_q31)
                                                         : frf_dft_init_f32(dft, &config, &twiddles_f32);
    TEST_ASSERT_EQUAL_INT_MESSAGE(core_ok, status, core_status_str(status));
}

static void expect_canaries(uint32_t channels)
{
    const uint8_t *behind = (const uint8_t *)(storage + FRF_STORAGE_WORDS(bin_count, channels));
    for (size_t i = 0; i < canary_words * sizeof *storage; i++)
        TEST_ASSERT_EQUAL_HEX8(canary, behind[i]);
}

static void spread_bins(uint32_t period, uint32_t most)
{
    bin_count = exact_spread_bins(period, most, bins);
}

/* sum of x[n] w[(k n + offset) mod N] for the table's sine (offset 0) or cosine */
static void big_sum(const int16_t *frames, uint32_t channels, uint32_t period, uint32_t bin, const int32_t *w31,
                    const int16_t *w15, int sign, struct exact_sum *out_sum)
{
    *out_sum = (struct exact_sum){0, 0};
    for (uint32_t n = 0; n < period; n++) {
        size_t index = (size_t)((uint64_t)bin * n % period);
        int64_t w = w31 ? w31[index] : w15[index];
        exact_sum_add(out_sum, sign * (int64_t)frames[(size_t)n * channels] * w);
    }
}

static void expect_bit_exact(struct frf_dft *dft, uint32_t channels)
{
    struct frf_period period;
    TEST_ASSERT_TRUE(frf_dft_latest(dft, &period));
    bool is_q15 = dft->number == frf_number_q15;
    for (uint32_t b = 0; b < bin_count; b++) {
        for (uint32_t c = 0; c < channels; c++) {
            struct exact_sum sum;
            big_sum(samples + c, channels, dft->period_samples, bins[b], is_q15 ? NULL : twiddles_q31.cosine,
                    twiddles_q15.cosine, 1, &sum);
            exact_sum_expect(&sum, frf_period_real(dft, &period, b, c), dft->period_samples, bins[b]);
            big_sum(samples + c, channels, dft->period_samples, bins[b], is_q15 ? NULL : twiddles_q31.sine,
                    twiddles_q15.sine, -1, &sum);
            exact_sum_expect(&sum, frf_period_imaginary(dft, &period, b, c), dft->period_samples, bins[b]);
        }
    }
}

static void fill_random(uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        samples[i] = (int16_t)((int32_t)(random_u32() >> 16) - 32768);
}

static void test_dft_integer_equals_big_integer_sum(void)
{
    static const uint32_t periods[] = {4,   5,    6,    7,    12,   16,    97,    100,  127,
                                       128, 1000, 1009, 2000, 4093, 16384, 65521, 65536};
    unsigned sums = 0;
    for (unsigned p = 0; p < sizeof periods / sizeof periods[0]; p++) {
        uint32_t period = periods[p];
        build_tables(period);
        spread_bins(period, period > 4096 ? 8 : bins_max);
        for (uint32_t channels = 1; channels <= channels_max; channels++) {
            fill_random(period * channels);
            for (int number = frf_number_q15; number <= frf_number_q31; number++) {
                struct frf_dft dft;
                start(&dft, (enum frf_number)number, channels);
                frf_dft_add_i16(&dft, samples, period);
                expect_bit_exact(&dft, channels);
                expect_canaries(channels);
                sums += 2u * bin_count * channels;
            }
        }
    }
    printf("integer DFT: %u accumulators bit-exact against big integers, %u periods N = 4 .. 65536\n", sums,
           (unsigned)(sizeof periods / sizeof periods[0]));
}

static void test_dft_integer_is_exact_for_worst_inputs(void)
{
    build_tables(PERIOD_MAX);
    bin_count = 3;
    bins[0] = 1;
    bins[1] = 12345;
    bins[2] = PERIOD_MAX / 2 - 1;
    int64_t largest = 0;
    for (unsigned kind = 0; kind < 7; kind++) {
        for (uint32_t n = 0; n < PERIOD_MAX; n++) {
            uint32_t index = (uint32_t)((uint64_t)bins[kind % 3] * n % PERIOD_MAX);
            /* L1 bound: every product as large as it gets, all of one sign; then all lowest, alternating, and DC. */
            bool positive = kind < 3   ? twiddles_q31.cosine[index] < 0
                            : kind < 4 ? twiddles_q31.sine[index] < 0
                            : kind < 5 ? false
                            : kind < 6 ? n % 2 == 0
                                       : true;
            samples[n] = positive ? INT16_MAX : INT16_MIN;
        }
        struct frf_dft dft;
        start(&dft, frf_number_q31, 1);
        frf_dft_add_i16(&dft, samples, PERIOD_MAX);
        expect_bit_exact(&dft, 1);
        struct frf_period period;
        TEST_ASSERT_TRUE(frf_dft_latest(&dft, &period));
        for (uint32_t b = 0; b < bin_count; b++) {
            int64_t sum = frf_period_real(&dft, &period, b, 0);
            largest = sum < 0 ? (-sum > largest ? -sum : largest) : (sum > largest ? sum : largest);
        }
        TEST_ASSERT_EQUAL_UINT32(frf_reason_saturated, period.reasons);
        TEST_ASSERT_EQUAL_UINT32(PERIOD_MAX, dft.err.saturated);
    }
    printf("worst case Q31, N = 65536: |sum| up to 2^%.3f of 2^63\n", log2((double)largest));
    TEST_ASSERT_GREATER_THAN_INT64(INT64_C(1) << 61, largest); /* the inputs did come near the bound */
}

static void reference_dft(const int16_t *frames, uint32_t period, uint32_t bin, long double *out_real,
                          long double *out_imaginary)
{
    *out_real = *out_imaginary = 0;
    for (uint32_t n = 0; n < period; n++) {
        uint32_t index = (uint32_t)((uint64_t)bin * n % period);
        /* cos x = sin(x + pi/2); a table of its own where N/4 is no whole number */
        long double cosine = period % 4u == 0u ? sine_long[(index + period / 4u) % period]
                                               : cosl(2 * pi_long * (long double)index / (long double)period);
        *out_real += (long double)frames[n] * cosine;
        *out_imaginary -= (long double)frames[n] * sine_long[index];
    }
}

/* The same bins as the reference's: log-spaced in 1 .. 0.4 N. */
static void log_bins(uint32_t period)
{
    bin_count = 0;
    for (unsigned i = 0; i < 40; i++) {
        uint32_t bin = (uint32_t)lround(pow(0.4 * period, i / 39.0));
        if (bin_count == 0 || bin > bins[bin_count - 1u])
            bins[bin_count++] = bin;
    }
}

/* Equal amplitudes, random phases, scaled to 0.95 of full scale, rounded to 16 bits. */
static void fill_multisine(uint32_t period)
{
    static double signal[PERIOD_MAX];
    double peak = 0;
    memset(signal, 0, sizeof signal);
    for (uint32_t b = 0; b < bin_count; b++) {
        uint32_t phase = random_u32() % period;
        for (uint32_t n = 0; n < period; n++)
            signal[n] += (double)sine_long[(uint32_t)(((uint64_t)bins[b] * n + phase) % period)];
    }
    for (uint32_t n = 0; n < period; n++)
        peak = fmax(peak, fabs(signal[n]));
    for (uint32_t n = 0; n < period; n++) {
        samples[n] = (int16_t)lround(0.95 * 32767 * signal[n] / peak);
        samples_f32[n] = samples[n];
    }
}

/* Runs one period through a variant and returns the worst bin's SNR, dB. */
static double worst_snr(enum frf_number number, uint32_t period, double *out_mean)
{
    struct frf_dft dft;
    struct frf_period latched;
    double worst = INFINITY, sum = 0;
    start(&dft, number, 1);
    if (number == frf_number_f32)
        frf_dft_add_f32(&dft, samples_f32, period);
    else
        frf_dft_add_i16(&dft, samples, period);
    TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
    for (uint32_t b = 0; b < bin_count; b++) {
        long double real, imaginary, got_real, got_imaginary;
        reference_dft(samples, period, bins[b], &real, &imaginary);
        if (number == frf_number_f32) {
            got_real = latched.sums[b].pair[0];
            got_imaginary = latched.sums[b].pair[1];
        } else { /* not through double, which would cost Q31 its last bits */
            long double one = number == frf_number_q15 ? FRF_Q15_ONE : FRF_Q31_ONE;
            got_real = (long double)frf_period_real(&dft, &latched, b, 0) / one;
            got_imaginary = (long double)frf_period_imaginary(&dft, &latched, b, 0) / one;
        }
        double snr = 20 * log10((double)(hypotl(real, imaginary) / hypotl(got_real - real, got_imaginary - imaginary)));
        worst = fmin(worst, snr);
        sum += snr / bin_count;
    }
    *out_mean = sum;
    return worst;
}

static void test_dft_signal_to_noise_of_the_arithmetic(void)
{
    static const char *const names[3] = {"Q15", "Q31", "f32 blocks"};
    const double *const required[3] = {snr_q15_dB, snr_q31_dB, snr_f32_dB};
    for (unsigned p = 0; p < 3; p++) {
        build_tables(snr_periods[p]);
        log_bins(snr_periods[p]);
        for (uint64_t realisation = 1; realisation <= 2; realisation++) {
            random_state = realisation;
            fill_multisine(snr_periods[p]);
            for (int number = frf_number_q15; number <= frf_number_f32; number++) {
                double mean, worst = worst_snr((enum frf_number)number, snr_periods[p], &mean);
                printf("SNR N = %5u, %u bins, seed %u, %-10s worst %6.1f dB, mean %6.1f dB, required %.0f dB\n",
                       (unsigned)snr_periods[p], (unsigned)bin_count, (unsigned)realisation, names[number], worst, mean,
                       required[number][p]);
                TEST_ASSERT_TRUE(worst >= required[number][p]);
            }
        }
    }
}

/* A period that is no multiple of 4 has a cosine table of its own; prime periods cannot be reduced at all. Bound of
 * Q15: half a table step on every product, so 0.5 / 32767 * sum |x|. */
static void test_dft_error_is_within_half_a_table_step(void)
{
    static const uint32_t periods[] = {5, 6, 97, 1009, 1002, 2000, 65521};
    for (unsigned p = 0; p < sizeof periods / sizeof periods[0]; p++) {
        build_tables(periods[p]);
        spread_bins(periods[p], 9);
        fill_random(periods[p]);
        long double bound = 0;
        for (uint32_t n = 0; n < periods[p]; n++)
            bound += 0.5L * (samples[n] < 0 ? -(long double)samples[n] : (long double)samples[n]);
        for (int number = frf_number_q15; number <= frf_number_q31; number++) {
            struct frf_dft dft;
            struct frf_period latched;
            long double one = number == frf_number_q15 ? FRF_Q15_ONE : FRF_Q31_ONE;
            start(&dft, (enum frf_number)number, 1);
            frf_dft_add_i16(&dft, samples, periods[p]);
            TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
            for (uint32_t b = 0; b < bin_count; b++) {
                long double real, imaginary;
                reference_dft(samples, periods[p], bins[b], &real, &imaginary);
                TEST_ASSERT_TRUE(fabsl((long double)frf_period_real(&dft, &latched, b, 0) - real * one) <= bound);
                TEST_ASSERT_TRUE(fabsl((long double)frf_period_imaginary(&dft, &latched, b, 0) - imaginary * one) <=
                                 bound);
            }
        }
    }
}

/* A tone 80 dB below its neighbour keeps its level within 0.01 dB; the large one within 1e-4 dB, which is what takes a
 * wrong factor of the table (32768 for 32767: 2.6e-4 dB). */
static void test_dft_small_tone_beside_a_large_one_keeps_its_level(void)
{
    const uint32_t period = 16384;
    build_tables(period);
    bin_count = 2;
    bins[0] = 700;
    bins[1] = 701;
    for (uint32_t n = 0; n < period; n++) {
        long double large = sine_long[(uint64_t)bins[0] * n % period],
                    small = sine_long[(uint64_t)bins[1] * n % period];
        samples[n] = (int16_t)lroundl(32760 * (large * 0.9999L + small * 1e-4L));
        samples_f32[n] = samples[n];
    }
    for (int number = frf_number_q15; number <= frf_number_f32; number++) {
        struct frf_dft dft;
        struct frf_period latched;
        start(&dft, (enum frf_number)number, 1);
        if (number == frf_number_f32)
            frf_dft_add_f32(&dft, samples_f32, period);
        else
            frf_dft_add_i16(&dft, samples, period);
        TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
        for (uint32_t b = 0; b < bin_count; b++) {
            long double real, imaginary;
            reference_dft(samples, period, bins[b], &real, &imaginary);
            struct frf_complex value = frf_period_value(&dft, &latched, b, 0);
            double error_dB = 20 * log10(hypot(value.real, value.imaginary) / (double)hypotl(real, imaginary));
            TEST_ASSERT_TRUE(fabs(error_dB) < (b == 0 ? 1e-4 : 0.01));
        }
    }
}

/* The sign convention, by hand: x = cos gives a positive real part, x = sin a negative imaginary one. */
static void test_dft_of_cosine_is_real_and_of_sine_is_minus_imaginary(void)
{
    const uint32_t period = 20;
    build_tables(period);
    bin_count = 2;
    bins[0] = 3;
    bins[1] = 4;
    for (uint32_t n = 0; n < period; n++) {
        samples[2 * n] = (int16_t)lroundl(10000 * cosl(2 * pi_long * 3 * n / period));
        samples[2 * n + 1] = (int16_t)lroundl(10000 * sinl(2 * pi_long * 3 * n / period));
    }
    for (uint32_t i = 0; i < 2 * period; i++)
        samples_f32[i] = samples[i];
    for (int number = frf_number_q15; number <= frf_number_f32; number++) {
        struct frf_dft dft;
        struct frf_period latched;
        start(&dft, (enum frf_number)number, 2);
        if (number == frf_number_f32)
            frf_dft_add_f32(&dft, samples_f32, period);
        else
            frf_dft_add_i16(&dft, samples, period);
        TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
        struct frf_complex cosine = frf_period_value(&dft, &latched, 0, 0),
                           sine = frf_period_value(&dft, &latched, 0, 1);
        struct frf_complex other = frf_period_value(&dft, &latched, 1, 0);
        const double rounding = period * 1.0; /* half a count per sample and half a table step */
        TEST_ASSERT_DOUBLE_WITHIN(rounding, 10000 * 10, cosine.real);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, 0, cosine.imaginary);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, 0, sine.real);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, -10000 * 10, sine.imaginary);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, 0, other.real);
        TEST_ASSERT_DOUBLE_WITHIN(rounding, 0, other.imaginary);
    }
}

static void feed_in_chunks(struct frf_dft *dft, uint32_t channels, uint32_t total, uint32_t chunk)
{
    for (uint32_t at = 0; at < total; at += chunk) {
        uint32_t count = total - at < chunk ? total - at : chunk;
        if (dft->number == frf_number_f32)
            frf_dft_add_f32(dft, samples_f32 + (size_t)at * channels, count);
        else
            frf_dft_add_i16(dft, samples + (size_t)at * channels, count);
    }
}

static void test_dft_does_not_depend_on_chunks(void)
{
    static const uint32_t periods[] = {200, 97};
    static union frf_word kept[2u * bins_max * channels_max];
    for (unsigned p = 0; p < 2; p++) {
        uint32_t period = periods[p], total = 3 * period, channels = 3;
        const uint32_t chunks[] = {total, 1, 2, 7, 63, 64, 65, period - 1, period, period + 1};
        build_tables(period);
        spread_bins(period, bins_max);
        fill_random(total * channels);
        for (uint32_t i = 0; i < total * channels; i++)
            samples_f32[i] = (float)samples[i] * 1.7e-3f;
        for (int number = frf_number_q15; number <= frf_number_f32; number++) {
            size_t bytes = sizeof(union frf_word) * bin_count * channels * (number == frf_number_f32 ? 1 : 2);
            for (unsigned i = 0; i < sizeof chunks / sizeof chunks[0]; i++) {
                struct frf_dft dft;
                struct frf_period latched;
                start(&dft, (enum frf_number)number, channels);
                feed_in_chunks(&dft, channels, total, chunks[i]);
                TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
                TEST_ASSERT_EQUAL_UINT32(3, latched.sequence);
                if (i == 0)
                    memcpy(kept, latched.sums, bytes);
                TEST_ASSERT_EQUAL_MEMORY(kept, latched.sums, bytes);
                expect_canaries(channels);
            }
        }
    }
}

/* Both banks are used again and again: nothing of an earlier period is left in a later one. */
static void test_dft_equal_periods_have_equal_sums(void)
{
    const uint32_t period = 100, channels = 2;
    static union frf_word first[2u * bins_max * 2u];
    build_tables(period);
    spread_bins(period, bins_max);
    fill_random(period * channels);
    for (uint32_t i = 0; i < period * channels; i++)
        samples_f32[i] = samples[i];
    for (int number = frf_number_q15; number <= frf_number_f32; number++) {
        size_t bytes = sizeof(union frf_word) * bin_count * channels * (number == frf_number_f32 ? 1 : 2);
        struct frf_dft dft;
        start(&dft, (enum frf_number)number, channels);
        for (unsigned p = 0; p < 5; p++) {
            struct frf_period latched;
            feed_in_chunks(&dft, channels, period, 33);
            TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
            if (p == 0)
                memcpy(first, latched.sums, bytes);
            TEST_ASSERT_EQUAL_MEMORY(first, latched.sums, bytes);
        }
    }
}

/* Lost samples count as zeros, also where a period begins with them. */
static void test_dft_gap_counts_as_zeros(void)
{
    const uint32_t period = 40;
    build_tables(period);
    spread_bins(period, 7);
    for (uint32_t at = 0; at < period; at++) {
        for (uint32_t lost = 1; at + lost < period; lost++) {
            struct frf_dft dft;
            fill_random(period);
            start(&dft, frf_number_q31, 1);
            frf_dft_add_i16(&dft, samples, at);
            frf_dft_skip(&dft, lost);
            frf_dft_add_i16(&dft, samples + at + lost, period - at - lost);
            memset(samples + at, 0, lost * sizeof *samples);
            expect_bit_exact(&dft, 1);
        }
    }
}

static void test_dft_keeps_a_period_while_the_next_one_arrives(void)
{
    const uint32_t period = 64;
    build_tables(period);
    spread_bins(period, 5);
    fill_random(3 * period);
    struct frf_dft dft;
    struct frf_period first, later;
    start(&dft, frf_number_q31, 1);
    TEST_ASSERT_FALSE(frf_dft_latest(&dft, &first));
    frf_dft_add_i16(&dft, samples, period - 1);
    TEST_ASSERT_FALSE(frf_dft_latest(&dft, &first));
    frf_dft_add_i16(&dft, samples + period - 1, 1);
    TEST_ASSERT_TRUE(frf_dft_latest(&dft, &first));
    int64_t before = frf_period_real(&dft, &first, 2, 0);
    frf_dft_add_i16(&dft, samples + period, period - 1);
    TEST_ASSERT_TRUE(frf_dft_is_intact(&dft, &first));
    TEST_ASSERT_EQUAL_INT64(before, frf_period_real(&dft, &first, 2, 0));
    frf_dft_add_i16(&dft, samples + 2 * period - 1, 1);
    TEST_ASSERT_FALSE(frf_dft_is_intact(&dft, &first));
    TEST_ASSERT_TRUE(frf_dft_latest(&dft, &later));
    TEST_ASSERT_EQUAL_UINT32(2, later.sequence);
    TEST_ASSERT_TRUE(later.sums != first.sums);
}

/* A gap of any length at any place: the periods it touches are invalid, all others are what they are without it. */
static void test_dft_gap_anywhere_spoils_only_its_periods(void)
{
    const uint32_t period = 12, total = 60;
    build_tables(period);
    spread_bins(period, 5);
    fill_random(total);
    struct frf_dft whole;
    static union frf_word whole_storage[FRF_STORAGE_WORDS(5u, 1u)];
    for (uint32_t at = 0; at < total; at++) {
        for (uint32_t lost = 1; at + lost <= total; lost++) {
            struct frf_dft dft;
            struct frf_dft_config config = configuration(1);
            start(&dft, frf_number_q31, 1);
            config.storage = whole_storage;
            TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_q31(&whole, &config, &twiddles_q31));
            for (uint32_t n = 0; n < total; n++) {
                if (n == at)
                    frf_dft_skip(&dft, lost);
                if (n < at || n >= at + lost)
                    frf_dft_add_i16(&dft, samples + n, 1);
                frf_dft_add_i16(&whole, samples + n, 1);
                struct frf_period got, expected;
                /* After the call that skipped, dft is ahead of whole until the gap is over. */
                if ((n + 1) % period != 0 || (n >= at && n + 1 < at + lost))
                    continue;
                TEST_ASSERT_TRUE(frf_dft_latest(&dft, &got) && frf_dft_latest(&whole, &expected));
                TEST_ASSERT_EQUAL_UINT32(expected.sequence, got.sequence);
                bool touched = at <= n && at + lost > n + 1 - period;
                TEST_ASSERT_EQUAL_UINT32(touched ? frf_reason_gap : 0, got.reasons);
                if (!touched)
                    TEST_ASSERT_EQUAL_MEMORY(expected.sums, got.sums, sizeof(union frf_word) * 2 * bin_count);
            }
            TEST_ASSERT_EQUAL_UINT32(lost, dft.err.lost);
        }
    }
}

static void test_dft_marks_hold_for_one_period(void)
{
    const uint32_t period = 16;
    build_tables(period);
    spread_bins(period, 3);
    memset(samples, 0, sizeof samples);
    struct frf_dft dft;
    struct frf_period latched;
    start(&dft, frf_number_q15, 1);
    frf_dft_add_i16(&dft, samples, 5);
    frf_dft_mark(&dft, frf_reason_late);
    frf_dft_mark(&dft, frf_reason_application);
    frf_dft_add_i16(&dft, samples, 11);
    TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
    TEST_ASSERT_EQUAL_UINT32(frf_reason_late | frf_reason_application, latched.reasons);
    TEST_ASSERT_EQUAL_UINT32(1, dft.err.late);
    frf_dft_add_i16(&dft, samples, period);
    TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
    TEST_ASSERT_EQUAL_UINT32(0, latched.reasons);
    frf_dft_add_f32(&dft, samples_f32, period);
    TEST_ASSERT_EQUAL_UINT32(1, dft.err.wrong_type);
    frf_dft_add_i16(&dft, samples, period);
    TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
    TEST_ASSERT_EQUAL_UINT32(frf_reason_wrong_type, latched.reasons);
}

static void test_dft_saturation_at_the_rail_and_one_below(void)
{
    const uint32_t period = 16;
    build_tables(period);
    spread_bins(period, 3);
    struct frf_dft dft;
    struct frf_period latched;
    struct frf_dft_config config = configuration(2);
    config.rail_low = -2048;
    config.rail_high = 2047;
    TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_q31(&dft, &config, &twiddles_q31));
    static const int16_t at_rail[4] = {2047, -2048, 2046, -2047};
    for (unsigned i = 0; i < 4; i++) {
        memset(samples, 0, sizeof samples);
        samples[2 * period - 1] = at_rail[i]; /* last sample of the second channel */
        frf_dft_add_i16(&dft, samples, period);
        TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
        TEST_ASSERT_EQUAL_UINT32(i < 2 ? frf_reason_saturated : 0, latched.reasons);
    }
    TEST_ASSERT_EQUAL_UINT32(2, dft.err.saturated);
}

/* Two periods in one call: the rail that the second one's first sample reaches is its own, and counts once. */
static void test_dft_saturation_belongs_to_its_period(void)
{
    const uint32_t period = 16;
    build_tables(period);
    spread_bins(period, 3);
    struct frf_dft dft;
    struct frf_period latched;
    struct frf_dft_config config = configuration(2);
    TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_q31(&dft, &config, &twiddles_q31));
    memset(samples, 0, sizeof samples);
    samples[2 * period] = INT16_MAX;
    frf_dft_add_i16(&dft, samples, period + 1u);
    TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
    TEST_ASSERT_EQUAL_UINT32(0, latched.reasons);
    TEST_ASSERT_EQUAL_UINT32(1, dft.err.saturated);
    frf_dft_add_i16(&dft, samples, period - 1u);
    TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
    TEST_ASSERT_EQUAL_UINT32(frf_reason_saturated, latched.reasons);
}

static void test_dft_float_leaves_out_what_is_not_finite(void)
{
    const uint32_t period = 16;
    build_tables(period);
    spread_bins(period, 3);
    struct frf_dft dft;
    struct frf_period latched;
    static const float bad[3] = {NAN, INFINITY, -INFINITY};
    for (unsigned i = 0; i < 3; i++) {
        start(&dft, frf_number_f32, 1);
        for (uint32_t n = 0; n < period; n++)
            samples_f32[n] = n == 9 ? bad[i] : 1.0f;
        frf_dft_add_f32(&dft, samples_f32, period);
        TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
        TEST_ASSERT_EQUAL_UINT32(frf_reason_not_finite, latched.reasons);
        TEST_ASSERT_EQUAL_UINT32(1, dft.err.not_finite);
        struct frf_complex value = frf_period_value(&dft, &latched, 0, 0);
        /* All ones but one: the DFT is minus that one's phasor. */
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, -cos(2 * (double)pi_long * 9 / 16), value.real);
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, sin(2 * (double)pi_long * 9 / 16), value.imaginary);
    }
}

static void test_dft_restart_begins_a_clean_period(void)
{
    const uint32_t period = 32;
    build_tables(period);
    spread_bins(period, 6);
    fill_random(period);
    for (uint32_t at = 0; at < period; at++) {
        struct frf_dft dft;
        start(&dft, frf_number_q31, 1);
        frf_dft_mark(&dft, frf_reason_gap);
        frf_dft_add_i16(&dft, samples, at);
        frf_dft_restart(&dft);
        frf_dft_add_i16(&dft, samples, period);
        struct frf_period latched;
        TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
        TEST_ASSERT_EQUAL_UINT32(0, latched.reasons & frf_reason_gap);
        expect_bit_exact(&dft, 1);
    }
}

static void test_twiddles_are_symmetric_and_correctly_rounded(void)
{
    static const uint32_t periods[] = {4, 5, 6, 7, 8, 97, 2000, 65536};
    for (unsigned p = 0; p < sizeof periods / sizeof periods[0]; p++) {
        uint32_t period = periods[p];
        build_tables(period);
        for (uint32_t n = 0; n < period; n++) {
            long double sine = sine_long[n], cosine = cosl(2 * pi_long * (long double)n / (long double)period);
            TEST_ASSERT_TRUE(fabsl(twiddles_q31.sine[n] - FRF_Q31_ONE * sine) <= 0.5L + 1e-6L);
            TEST_ASSERT_TRUE(fabsl(twiddles_q31.cosine[n] - FRF_Q31_ONE * cosine) <= 0.5L + 1e-6L);
            TEST_ASSERT_TRUE(fabsl(twiddles_q15.sine[n] - FRF_Q15_ONE * sine) <= 0.5L + 1e-6L);
            TEST_ASSERT_TRUE(fabsl(twiddles_q15.cosine[n] - FRF_Q15_ONE * cosine) <= 0.5L + 1e-6L);
            TEST_ASSERT_TRUE(fabsl((long double)twiddles_f32.sine[n] - sine) <= 3.0e-8L);
            TEST_ASSERT_TRUE(fabsl((long double)twiddles_f32.cosine[n] - cosine) <= 3.0e-8L);
            TEST_ASSERT_EQUAL_INT32(-twiddles_q31.sine[n], twiddles_q31.sine[(period - n) % period]);
        }
    }
}

static void test_dft_init_refuses_what_cannot_work(void)
{
    struct frf_dft dft;
    build_tables(20);
    bin_count = 3;
    bins[0] = 1;
    bins[1] = 5;
    bins[2] = 9;
    struct frf_dft_config config = configuration(1);
    TEST_ASSERT_EQUAL_INT(core_ok, frf_dft_init_q15(&dft, &config, &twiddles_q15));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_q15(NULL, &config, &twiddles_q15));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_q15(&dft, NULL, &twiddles_q15));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_q15(&dft, &config, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_q31(&dft, &config, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_f32(&dft, &config, NULL));
    config.storage_words--;
    TEST_ASSERT_EQUAL_INT(core_err_storage, frf_dft_init_q15(&dft, &config, &twiddles_q15));
    config = configuration(0);
    TEST_ASSERT_EQUAL_INT(core_err_frf_channels, frf_dft_init_q15(&dft, &config, &twiddles_q15));
    config = configuration(SERVOSCOPE_FRF_CHANNELS_MAX + 1);
    TEST_ASSERT_EQUAL_INT(core_err_frf_channels, frf_dft_init_q31(&dft, &config, &twiddles_q31));
    config = configuration(1);
    config.rail_low = 5;
    config.rail_high = 5;
    TEST_ASSERT_EQUAL_INT(core_err_frf_rails, frf_dft_init_q31(&dft, &config, &twiddles_q31));
    config = configuration(1);
    static const uint32_t wrong[][3] = {{0, 1, 2}, {1, 1, 2}, {2, 1, 3}, {1, 2, 10}, {1, 2, 0xFFFFFFFFu}};
    for (unsigned i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        config.bins = wrong[i];
        TEST_ASSERT_EQUAL_INT(core_err_frf_bins, frf_dft_init_f32(&dft, &config, &twiddles_f32));
    }
    config = configuration(1);
    config.bin_count = 0;
    TEST_ASSERT_EQUAL_INT(core_err_frf_bins, frf_dft_init_q15(&dft, &config, &twiddles_q15));
    struct frf_twiddles_q15 short_table = twiddles_q15;
    short_table.period_samples = 3;
    TEST_ASSERT_EQUAL_INT(core_err_frf_period, frf_dft_init_q15(&dft, &config, &short_table));
    TEST_ASSERT_EQUAL_INT(core_err_frf_period, frf_twiddles_build_q15(table_q15, 999999, 3, &twiddles_q15));
    TEST_ASSERT_EQUAL_INT(core_err_frf_period,
                          frf_twiddles_build_q31(table_q31, 999999, PERIOD_MAX + 1, &twiddles_q31));
    TEST_ASSERT_EQUAL_INT(core_err_storage,
                          frf_twiddles_build_f32(table_f32, FRF_TWIDDLE_WORDS(21u) - 1, 21, &twiddles_f32));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_twiddles_build_q31(NULL, 100, 8, &twiddles_q31));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_dft_of_cosine_is_real_and_of_sine_is_minus_imaginary);
    RUN_TEST(test_dft_integer_equals_big_integer_sum);
    RUN_TEST(test_dft_integer_is_exact_for_worst_inputs);
    RUN_TEST(test_dft_signal_to_noise_of_the_arithmetic);
    RUN_TEST(test_dft_error_is_within_half_a_table_step);
    RUN_TEST(test_dft_small_tone_beside_a_large_one_keeps_its_level);
    RUN_TEST(test_dft_does_not_depend_on_chunks);
    RUN_TEST(test_dft_equal_periods_have_equal_sums);
    RUN_TEST(test_dft_gap_counts_as_zeros);
    RUN_TEST(test_dft_keeps_a_period_while_the_next_one_arrives);
    RUN_TEST(test_dft_gap_anywhere_spoils_only_its_periods);
    RUN_TEST(test_dft_marks_hold_for_one_period);
    RUN_TEST(test_dft_saturation_at_the_rail_and_one_below);
    RUN_TEST(test_dft_saturation_belongs_to_its_period);
    RUN_TEST(test_dft_float_leaves_out_what_is_not_finite);
    RUN_TEST(test_dft_restart_begins_a_clean_period);
    RUN_TEST(test_twiddles_are_symmetric_and_correctly_rounded);
    RUN_TEST(test_dft_init_refuses_what_cannot_work);
    return UNITY_END();
}
