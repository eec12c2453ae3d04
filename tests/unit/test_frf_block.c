/* SPDX-License-Identifier: MIT */
/* The block DFT against a double DFT of the same 16-bit samples, and against itself however it is fed. */
#include "frf/block.h"
#include "frf/block_basis.h"
#include "frf/block_kernel.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PERIOD_MAX 65536u
enum { bins_max = 200, channels_max = 2, canary_words = 4, canary = 0x5A };

/* Required by reference: SNR of the arithmetic at the worst bin, dB. */
static const double snr_required_dB = 100;

static const double two_pi = 6.28318530717958647692;

static int32_t coefficients[FRF_BLOCK_TABLE_WORDS(bins_max, 128u, 128u)];
static struct frf_block_table table;
static int32_t storage[FRF_BLOCK_STORAGE_WORDS(bins_max, channels_max, 2u, 128u, 64u) + canary_words];
static int16_t frames[FRF_BLOCK_FRAME_SAMPLES(channels_max, 128u) + canary_words];
static uint32_t bins[bins_max];
static uint32_t bin_count;
static int16_t samples[PERIOD_MAX * channels_max];
static double sine[PERIOD_MAX], cosine[PERIOD_MAX];
static uint64_t random_state;

static uint32_t random_u32(void)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(random_state >> 32);
}

void setUp(void)
{
    random_state = 1;
}

void tearDown(void) {}

static const struct frf_block_layout folded_16 = {16, 16}, folded_32 = {32, 32}, folded_64 = {64, 64};
static const struct frf_block_layout shared_64 = {64, 24}, shared_128 = {128, 12};

static void build(uint32_t period, const struct frf_block_layout *layout)
{
    uint32_t words = FRF_BLOCK_TABLE_WORDS(bin_count, layout->block_samples, layout->terms);
    memset(coefficients, canary, sizeof coefficients);
    enum core_status status = frf_block_build(coefficients, words, bins, bin_count, period, layout, &table);
    TEST_ASSERT_EQUAL_INT_MESSAGE(core_ok, status, core_status_str(status));
    for (size_t w = words; w < sizeof coefficients / sizeof *coefficients; w++)
        TEST_ASSERT_EQUAL_HEX32(0x5A5A5A5A, coefficients[w]);
    for (uint32_t n = 0; n < period; n++) {
        sine[n] = sin(two_pi * n / period);
        cosine[n] = cos(two_pi * n / period);
    }
}

static struct frf_block_config configuration(uint32_t channels, uint32_t banks, bool spread)
{
    struct frf_block_config config = {
        .table = &table, .channels = channels, .banks = banks, .spread = spread, .storage = storage, .frames = frames};
    config.storage_words =
        FRF_BLOCK_STORAGE_WORDS(bin_count, channels, banks, table.layout.block_samples, table.layout.terms);
    config.frame_samples = FRF_BLOCK_FRAME_SAMPLES(channels, table.layout.block_samples);
    return config;
}

static void start(struct frf_block *dft, uint32_t channels, uint32_t banks, bool spread)
{
    struct frf_block_config config = configuration(channels, banks, spread);
    memset(storage, canary, sizeof storage);
    memset(frames, canary, sizeof frames);
    TEST_ASSERT_EQUAL_INT(core_ok, frf_block_init(dft, &config));
}

static void expect_canaries(const struct frf_block *dft)
{
    struct frf_block_config config = configuration(dft->channels, dft->bank_count, dft->spread);
    for (unsigned i = 0; i < canary_words; i++) {
        TEST_ASSERT_EQUAL_HEX32(0x5A5A5A5A, storage[config.storage_words + i]);
        TEST_ASSERT_EQUAL_HEX16(0x5A5A, frames[config.frame_samples + i]);
    }
}

/* Bins spread over 1 .. last, both ends included. */
static void spread_bins(uint32_t last, uint32_t count)
{
    bin_count = 0;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t bin = 1u + (uint32_t)((uint64_t)i * (last - 1u) / (count - 1u));
        if (bin_count == 0 || bin > bins[bin_count - 1u])
            bins[bin_count++] = bin;
    }
}

static void fill_random(uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        samples[i] = (int16_t)((int32_t)(random_u32() >> 16) - 32768);
}

/* Equal amplitudes, random phases, scaled to 0.95 of full scale, rounded to 16 bits. */
static void fill_multisine(uint32_t period)
{
    static double signal[PERIOD_MAX];
    double peak = 0;
    memset(signal, 0, sizeof signal);
    for (uint32_t b = 0; b < bin_count; b++) {
        uint32_t index = random_u32() % period;
        for (uint32_t n = 0; n < period; n++) {
            signal[n] += sine[index];
            index = index + bins[b] >= period ? index + bins[b] - period : index + bins[b];
        }
    }
    for (uint32_t n = 0; n < period; n++)
        peak = fmax(peak, fabs(signal[n]));
    for (uint32_t n = 0; n < period; n++)
        samples[n] = (int16_t)lround(0.95 * 32767 * signal[n] / peak);
}

static void reference_dft(const int16_t *x, uint32_t period, uint32_t bin, double *out_real, double *out_imaginary)
{
    uint32_t index = 0;
    *out_real = *out_imaginary = 0;
    for (uint32_t n = 0; n < period; n++) {
        *out_real += x[n] * cosine[index];
        *out_imaginary -= x[n] * sine[index];
        index = index + bin >= period ? index + bin - period : index + bin;
    }
}

/* Distance of a bin's sums from the double DFT, in counts. */
static double error_of(const struct frf_block *dft, const struct frf_block_period *period, uint32_t b,
                       double *out_magnitude)
{
    double real, imaginary, scale = ldexp(1, 31 + (int)table.gain_shift);
    int64_t got_real, got_imaginary;
    reference_dft(samples, table.period_samples, bins[b], &real, &imaginary);
    frf_block_sums(dft, period, b, 0, &got_real, &got_imaginary);
    *out_magnitude = hypot(real, imaginary);
    return hypot((double)got_real / scale - real, (double)got_imaginary / scale - imaginary);
}

static double worst_snr(uint32_t period, double *out_mean)
{
    struct frf_block dft;
    struct frf_block_period latched;
    double worst = INFINITY;
    start(&dft, 1, 1, false);
    frf_block_add_i16(&dft, samples, period);
    TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
    TEST_ASSERT_EQUAL_UINT32(0, latched.reasons);
    *out_mean = 0;
    for (uint32_t b = 0; b < bin_count; b++) {
        double magnitude, error = error_of(&dft, &latched, b, &magnitude), snr = 20 * log10(magnitude / error);
        worst = fmin(worst, snr);
        *out_mean += snr / bin_count;
    }
    expect_canaries(&dft);
    return worst;
}

/* share: highest line, of the sampling rate */
static void expect_snr(const struct frf_block_layout *layout, double share)
{
    static const uint32_t periods[] = {2000, 2003, 16384, 65536};
    for (unsigned p = 0; p < 4; p++) {
        for (uint32_t count = 32; count <= 200; count += 168) {
            double mean, worst;
            uint32_t last = (uint32_t)(share * periods[p]);
            spread_bins(last, count);
            build(periods[p], layout);
            fill_multisine(periods[p]);
            worst = worst_snr(periods[p], &mean);
            printf("SNR L = %3u, R = %2u, lines below %.2f fs, N = %5u, %3u bins: worst %6.1f dB, mean %6.1f dB, "
                   "required %.0f dB\n",
                   (unsigned)layout->block_samples, (unsigned)layout->terms, share, (unsigned)periods[p],
                   (unsigned)bin_count, worst, mean, snr_required_dB);
            TEST_ASSERT_TRUE(worst >= snr_required_dB);
        }
    }
}

static void test_block_folded_signal_to_noise(void)
{
    expect_snr(&folded_16, 0.45);
    expect_snr(&folded_32, 0.45);
    expect_snr(&folded_64, 0.45);
}

static void test_block_shared_basis_signal_to_noise(void)
{
    expect_snr(&shared_64, 0.1);
    expect_snr(&shared_128, 0.02);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_block_folded_signal_to_noise);
    RUN_TEST(test_block_shared_basis_signal_to_noise);
    return UNITY_END();
}
