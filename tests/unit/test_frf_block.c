/* SPDX-License-Identifier: MIT */
/* The block DFT against a double DFT of the same 16-bit samples, and against itself however it is fed. */
#include "frf/block.h"
#include "frf/dft_by_twos.h"

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
static int32_t storage[FRF_BLOCK_STORAGE_WORDS(bins_max, channels_max, 2u, 128u, 64u) +
                       FRF_BLOCK_SPREAD_WORDS(channels_max, 128u) + canary_words];
static int32_t part[FRF_BLOCK_PART_WORDS(channels_max, 16384u, 2u) + canary_words];
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

static const struct frf_block_layout folded_16 = {16, 16, 1}, folded_32 = {32, 32, 1}, folded_64 = {64, 64, 1};
static const struct frf_block_layout shared_64 = {64, 24, 1}, shared_128 = {128, 12, 1};

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
        .table = &table, .channels = channels, .banks = banks, .spread = spread, .storage = storage};
    config.storage_words =
        FRF_BLOCK_STORAGE_WORDS(bin_count, channels, banks, table.layout.block_samples, table.layout.terms);
    config.storage_words += spread ? FRF_BLOCK_SPREAD_WORDS(channels, table.layout.block_samples) : 0u;
    if (table.layout.repeats > 1) {
        config.part = part;
        config.part_words = FRF_BLOCK_PART_WORDS(channels, table.period_samples, table.layout.repeats);
        TEST_ASSERT_TRUE(config.part_words + canary_words <= sizeof part / sizeof *part);
    }
    return config;
}

static void start(struct frf_block *dft, uint32_t channels, uint32_t banks, bool spread)
{
    struct frf_block_config config = configuration(channels, banks, spread);
    memset(storage, canary, sizeof storage);
    memset(part, canary, sizeof part);
    TEST_ASSERT_EQUAL_INT(core_ok, frf_block_init(dft, &config));
}

static void expect_canaries(const struct frf_block *dft)
{
    struct frf_block_config config = configuration(dft->channels, dft->bank_count, dft->spread);
    for (unsigned i = 0; i < canary_words; i++) {
        TEST_ASSERT_EQUAL_HEX32(0x5A5A5A5A, storage[config.storage_words + i]);
        TEST_ASSERT_EQUAL_HEX32(0x5A5A5A5A, part[config.part_words + i]);
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

/* Bins up to `last` that leave `rest` when divided by `divisor`. */
static void regular_bins(uint32_t last, uint32_t divisor, uint32_t rest)
{
    bin_count = 0;
    for (uint32_t k = rest == 0 ? divisor : rest; k <= last && bin_count < bins_max; k += divisor)
        bins[bin_count++] = k;
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
    double real, imaginary, scale = ldexp(1, 30 + (int)table.gain_shift);
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

/* share: highest line, of the sample rate */
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

/* Lines that a block turns by a whole number of quarters: rotations whose products have nothing to round, where a bias
 * of the rounding would add up block after block. N/L apart, and their neighbours. */
static void test_block_lines_at_multiples_of_the_block_rate(void)
{
    const uint32_t period = 65536;
    bin_count = 0;
    for (uint32_t k = 512; k < period / 2u && bin_count + 2u <= bins_max; k += 512) {
        bins[bin_count++] = k;
        bins[bin_count++] = k + 1u;
    }
    for (unsigned l = 0; l < 2; l++) {
        double mean, worst;
        build(period, l == 0 ? &folded_16 : &folded_32);
        fill_multisine(period);
        worst = worst_snr(period, &mean);
        printf("SNR L = %u, lines at multiples of N/128 and beside: worst %.1f dB, mean %.1f dB\n",
               (unsigned)table.layout.block_samples, worst, mean);
        TEST_ASSERT_TRUE(worst >= snr_required_dB);
    }
}

/* Inputs that come as near to the accumulators' range as any: all of one sign against a line, at fs/4 above all. */
static void test_block_cannot_overflow(void)
{
    static const uint32_t periods[] = {128, 1000, 1437, 2000, 45999, 46000, 65536};
    double largest = 0;
    for (unsigned p = 0; p < sizeof periods / sizeof periods[0]; p++) {
        uint32_t period = periods[p];
        bin_count = 3;
        bins[0] = 1;
        bins[1] = period / 4u;
        bins[2] = (period - 1u) / 2u;
        build(period, &folded_32);
        for (unsigned kind = 0; kind < 12; kind++) {
            for (uint32_t n = 0; n < period; n++) {
                uint32_t index = (uint32_t)((uint64_t)bins[kind % 3] * n % period);
                double towards = kind / 3 == 0   ? cosine[index]
                                 : kind / 3 == 1 ? sine[index]
                                 : kind / 3 == 2 ? cosine[index] + sine[index]
                                                 : cosine[index] - sine[index];
                samples[n] = towards > 0 ? INT16_MIN : INT16_MAX;
            }
            struct frf_block dft;
            struct frf_block_period latched;
            start(&dft, 1, 1, false);
            frf_block_add_i16(&dft, samples, period);
            TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
            TEST_ASSERT_EQUAL_UINT32(frf_reason_saturated, latched.reasons);
            TEST_ASSERT_EQUAL_UINT32(period, dft.err.saturated);
            for (uint32_t b = 0; b < bin_count; b++) {
                double magnitude, error = error_of(&dft, &latched, b, &magnitude);
                TEST_ASSERT_TRUE(error <= 1e-5 * 32768.0 * period); /* a wrap would be 2^32 */
                double component = fmax(abs(latched.accumulators[2 * b]), abs(latched.accumulators[2 * b + 1]));
                largest = fmax(largest, component);
            }
        }
    }
    printf("worst case: accumulators up to 2^%.3f, they must stay below 2^30\n", log2(largest));
    TEST_ASSERT_TRUE(largest < ldexp(1, 30) && largest > exp2(29.8)); /* the inputs did come near */
}

static void feed_in_chunks(struct frf_block *dft, uint32_t total, uint32_t chunk)
{
    for (uint32_t at = 0; at < total; at += chunk) {
        uint32_t count = total - at < chunk ? total - at : chunk;
        frf_block_add_i16(dft, samples + (size_t)at * dft->channels, count);
    }
}

static void test_block_does_not_depend_on_chunks_or_spreading(void)
{
    static const struct frf_block_layout layouts[] = {{8, 8, 0},   {12, 12, 1}, {32, 32, 1}, {32, 16, 1},
                                                      {48, 48, 1}, {8, 8, 2},   {32, 32, 2}};
    static const uint32_t periods[] = {192, 211};
    static int32_t kept[4u * bins_max];
    for (unsigned i = 0; i < 12; i++) {
        const struct frf_block_layout *layout = &layouts[i < 7 ? i : i - 7];
        uint32_t period = periods[i / 7], total = 3 * period + 60; /* spread work is done within a block */
        const uint32_t chunks[] = {total, 1, 2, 7, 31, 32, 33, period - 1, period, period + 1};
        if (layout->repeats > 1)
            regular_bins(51, 4, 1);
        else
            spread_bins(layout->terms < layout->block_samples ? period / 10u : period / 2u - 1u, 13);
        build(period, layout);
        fill_random(total * 2u);
        for (unsigned j = 0; j < 2 * sizeof chunks / sizeof chunks[0]; j++) {
            struct frf_block dft;
            struct frf_block_period latched;
            start(&dft, 2, 2, j % 2 != 0);
            feed_in_chunks(&dft, total, chunks[j / 2]);
            TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
            TEST_ASSERT_EQUAL_UINT32(3, latched.sequence);
            size_t bytes = sizeof *kept * 4u * FRF_BLOCK_ROWS(bin_count);
            if (j == 0)
                memcpy(kept, latched.accumulators, bytes);
            TEST_ASSERT_EQUAL_MEMORY(kept, latched.accumulators, bytes);
            expect_canaries(&dft);
        }
    }
}

/* Each channel is what it would be alone. */
static void test_block_channels_do_not_mix(void)
{
    const uint32_t period = 300;
    spread_bins(149, 9);
    build(period, &folded_32);
    fill_random(2 * period);
    struct frf_block dft;
    struct frf_block_period latched;
    int64_t together[2][9][2];
    start(&dft, 2, 1, false);
    frf_block_add_i16(&dft, samples, period);
    TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
    for (uint32_t b = 0; b < 9; b++)
        for (uint32_t c = 0; c < 2; c++)
            frf_block_sums(&dft, &latched, b, c, &together[c][b][0], &together[c][b][1]);
    for (uint32_t c = 0; c < 2; c++) {
        start(&dft, 1, 1, false);
        for (uint32_t n = 0; n < period; n++)
            frf_block_add_i16(&dft, samples + 2 * n + c, 1);
        TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
        for (uint32_t b = 0; b < 9; b++) {
            int64_t real, imaginary;
            frf_block_sums(&dft, &latched, b, 0, &real, &imaginary);
            TEST_ASSERT_EQUAL_INT64(together[c][b][0], real);
            TEST_ASSERT_EQUAL_INT64(together[c][b][1], imaginary);
        }
    }
}

/* A gap of any length at any place, fed spread or not: the periods it touches are invalid, all others are what they are
 * without it. */
/* Odd lines, multiples, odd multiples: folded first, also where the part is no multiple of the block. */
static void test_block_folded_period_signal_to_noise(void)
{
    static const struct {
        uint32_t period, divisor, rest, block, terms, last;
    } cases[] = {{16384, 2, 1, 32, 32, 7000}, {2000, 2, 1, 32, 32, 900}, {2004, 3, 0, 32, 32, 900},
                 {2000, 10, 5, 32, 32, 900},  {2000, 4, 2, 64, 24, 200}, {16384, 128, 0, 64, 64, 7000}};
    for (unsigned i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct frf_block_layout layout = {cases[i].block, cases[i].terms, cases[i].divisor};
        double mean, worst;
        regular_bins(cases[i].last, cases[i].divisor, cases[i].rest);
        build(cases[i].period, &layout);
        TEST_ASSERT_EQUAL_INT(cases[i].rest != 0, table.alternate);
        fill_multisine(cases[i].period);
        worst = worst_snr(cases[i].period, &mean);
        printf("SNR L = %2u, R = %2u, N = %5u, lines %u + i %u (%u): worst %.1f dB, mean %.1f dB\n",
               (unsigned)layout.block_samples, (unsigned)layout.terms, (unsigned)cases[i].period,
               (unsigned)cases[i].rest, (unsigned)cases[i].divisor, (unsigned)bin_count, worst, mean);
        TEST_ASSERT_TRUE(worst >= snr_required_dB);
        struct frf_block_layout chosen;
        frf_block_choose(bins, bin_count, cases[i].period, cases[i].period, &chosen);
        TEST_ASSERT_TRUE(chosen.repeats == cases[i].divisor || cases[i].period / cases[i].divisor < 64);
    }
}

/* Everything that is not on the lines' grid goes out, and the largest samples there are do not overflow. */
static void test_block_folded_period_cannot_overflow(void)
{
    const struct frf_block_layout layout = {32, 32, 64};
    const uint32_t period = 16384;
    regular_bins(8000, 64, 0);
    build(period, &layout);
    for (unsigned kind = 0; kind < 3; kind++) {
        for (uint32_t n = 0; n < period; n++)
            samples[n] = kind == 0 || cosine[(uint64_t)bins[bin_count / 2] * n % period] > 0 ? INT16_MIN : INT16_MAX;
        if (kind == 2)
            memset(samples + period / 3, 0, sizeof *samples * period / 3);
        struct frf_block dft;
        struct frf_block_period latched;
        start(&dft, 1, 1, kind == 1);
        frf_block_add_i16(&dft, samples, period + (kind == 1 ? 32 : 0));
        TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
        for (uint32_t b = 0; b < bin_count; b++) {
            double magnitude;
            TEST_ASSERT_TRUE(error_of(&dft, &latched, b, &magnitude) <= 1e-5 * 32768.0 * period);
        }
    }
}

/* Gaps of each `step`th place and length. */
static void expect_gap_spoils_only_its_periods(uint32_t period, const struct frf_block_layout *layout, uint32_t step)
{
    const uint32_t total = 5 * period;
    static int32_t expected[5][2u * 6u];
    struct frf_block dft;
    struct frf_block_period latched;
    regular_bins(9, 2, 1);
    build(period, layout);
    fill_random(total);
    start(&dft, 1, 2, false);
    for (uint32_t p = 0; p < 5; p++) {
        frf_block_add_i16(&dft, samples + p * period, period);
        TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
        memcpy(expected[p], latched.accumulators, sizeof expected[p]);
    }
    for (uint32_t at = 0; at < total; at += step) {
        for (uint32_t lost = 1; at + lost <= total; lost += step) {
            uint32_t seen = 0;
            start(&dft, 1, 2, (at + lost) % 3 != 0);
            for (uint32_t n = 0; n < total; n += n == at ? lost : 1u) {
                if (n == at)
                    frf_block_skip(&dft, lost);
                else
                    frf_block_add_i16(&dft, samples + n, 1);
                if (!frf_block_latest(&dft, &latched) || latched.sequence == seen)
                    continue;
                seen = latched.sequence;
                bool touched = at < seen * period && at + lost > (seen - 1u) * period;
                TEST_ASSERT_EQUAL_UINT32(touched ? frf_reason_gap : 0, latched.reasons);
                if (!touched)
                    TEST_ASSERT_EQUAL_MEMORY(expected[seen - 1u], latched.accumulators, sizeof expected[0]);
            }
            TEST_ASSERT_EQUAL_UINT32(lost, dft.err.lost);
            TEST_ASSERT_TRUE(seen >= 4u);
        }
    }
}

static void test_block_gap_anywhere_spoils_only_its_periods(void)
{
    static const struct frf_block_layout small = {8, 8, 1}, folded = {8, 8, 2}, basis = {32, 16, 1};
    expect_gap_spoils_only_its_periods(40, &small, 1);
    expect_gap_spoils_only_its_periods(37, &small, 2);
    expect_gap_spoils_only_its_periods(40, &folded, 1);
    expect_gap_spoils_only_its_periods(90, &basis, 7);
}

/* Spread work is done when the next block lacks a sample, with a block's length of time or, where the period is no
 * whole number of blocks, at least half of it. */
static void test_block_spread_result_is_there_before_the_next_block_is_full(void)
{
    static const struct {
        uint32_t period, delay;
        struct frf_block_layout layout;
    } cases[] = {{96, 31, {32, 32, 1}},   {97, 16, {32, 32, 1}},    {100, 17, {32, 32, 1}}, {127, 31, {32, 32, 1}},
                 {2000, 39, {64, 24, 1}}, {384, 127, {128, 12, 1}}, {192, 31, {32, 32, 2}}};
    for (unsigned c = 0; c < sizeof cases / sizeof cases[0]; c++) {
        for (uint32_t channels = 1; channels <= channels_max; channels++) {
            regular_bins(cases[c].layout.terms < cases[c].layout.block_samples ? 7 : 47, 2, 1);
            build(cases[c].period, &cases[c].layout);
            fill_random(cases[c].period * channels);
            struct frf_block dft;
            struct frf_block_period latched;
            start(&dft, channels, 2, true);
            feed_in_chunks(&dft, cases[c].period, 1);
            for (uint32_t n = 0; n < cases[c].delay; n++) {
                if (n < cases[c].delay * 3u / 4u)
                    TEST_ASSERT_FALSE(frf_block_latest(&dft, &latched));
                frf_block_add_i16(&dft, samples, 1);
            }
            TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
            TEST_ASSERT_EQUAL_UINT32(0, latched.reasons);
        }
    }
}

/* Started over or torn by a gap after any sample of the first period and a half: the next whole period is as if nothing
 * had been before, though the work on a block was cut off; nothing of that work comes in one burst. */
static void test_block_cut_off_work_leaves_nothing_behind(void)
{
    static const struct frf_block_layout layouts[] = {{32, 32, 1}, {32, 16, 1}, {64, 24, 1}, {8, 8, 2}};
    const uint32_t period = 136;
    static int32_t expected[2u * 8u * channels_max];
    for (unsigned l = 0; l < 4; l++) {
        struct frf_block dft;
        struct frf_block_period latched;
        regular_bins(13, 2, 1);
        build(period, &layouts[l]);
        fill_random(period * channels_max);
        start(&dft, channels_max, 2, false);
        frf_block_add_i16(&dft, samples, period);
        TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
        size_t bytes = sizeof *expected * 2u * FRF_BLOCK_ROWS(bin_count) * channels_max;
        TEST_ASSERT_TRUE(bytes <= sizeof expected);
        memcpy(expected, latched.accumulators, bytes);
        for (uint32_t cut = 0; cut < 2 * (period + period / 2u); cut++) {
            uint32_t before = cut / 2u;
            start(&dft, channels_max, 1u + before % 2u, true);
            for (uint32_t n = 0; n < before; n++)
                frf_block_add_i16(&dft, samples + n % period * channels_max, 1);
            uint32_t done = dft.sequence;
            if (cut % 2u == 0)
                frf_block_restart(&dft);
            else
                frf_block_skip(&dft, 2u * period - before);
            TEST_ASSERT_TRUE(dft.sequence >= done);
            done = dft.sequence;
            TEST_ASSERT_EQUAL_UINT32(0, dft.run.pairs);
            feed_in_chunks(&dft, period, 1);
            for (uint32_t n = 0; n < 63u && dft.sequence == done; n++)
                frf_block_add_i16(&dft, samples, 1);
            TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
            TEST_ASSERT_EQUAL_UINT32(done + 1u, latched.sequence);
            TEST_ASSERT_EQUAL_UINT32(0, latched.reasons);
            TEST_ASSERT_EQUAL_MEMORY(expected, latched.accumulators, bytes);
            expect_canaries(&dft);
        }
    }
}

/* One bank, and the first block of the new period lost in a gap while it was worked on: the period before is still told
 * to be overwritten before anything is. */
static void test_block_gap_does_not_hide_that_a_bank_is_written_to(void)
{
    const uint32_t period = 96;
    spread_bins(40, 9);
    build(period, &folded_32);
    fill_random(period);
    for (uint32_t worked = 0; worked <= 32; worked++) {
        struct frf_block dft;
        struct frf_block_period latched;
        start(&dft, 1, 1, true);
        frf_block_add_i16(&dft, samples, period);
        frf_block_add_i16(&dft, samples, 32);
        TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
        feed_in_chunks(&dft, worked, 1);
        frf_block_skip(&dft, 1);
        for (uint32_t n = 0; n < 60; n++) {
            int32_t held[4];
            bool intact = frf_block_is_intact(&dft, &latched);
            memcpy(held, storage, sizeof held);
            frf_block_add_i16(&dft, samples, 1);
            if (intact && memcmp(held, storage, sizeof held) != 0)
                TEST_ASSERT_FALSE(frf_block_is_intact(&dft, &latched));
        }
        TEST_ASSERT_FALSE(frf_block_is_intact(&dft, &latched));
    }
}

/* One bank: readable until the next period's first block is worked on. Two: until the one after next's. */
static void test_block_keeps_a_period_as_long_as_its_banks_allow(void)
{
    const uint32_t period = 96;
    spread_bins(40, 5);
    build(period, &folded_32);
    fill_random(3 * period);
    for (uint32_t banks = 1; banks <= 2; banks++) {
        struct frf_block dft;
        struct frf_block_period first, later;
        start(&dft, 1, banks, false);
        TEST_ASSERT_FALSE(frf_block_latest(&dft, &first));
        frf_block_add_i16(&dft, samples, period - 1);
        TEST_ASSERT_FALSE(frf_block_latest(&dft, &first));
        frf_block_add_i16(&dft, samples + period - 1, 1);
        TEST_ASSERT_TRUE(frf_block_latest(&dft, &first));
        TEST_ASSERT_EQUAL_UINT32(1, first.sequence);
        uint32_t lasts = (banks - 1u) * period + 31u;
        frf_block_add_i16(&dft, samples + period, lasts);
        TEST_ASSERT_TRUE(frf_block_is_intact(&dft, &first));
        frf_block_add_i16(&dft, samples, 1);
        TEST_ASSERT_FALSE(frf_block_is_intact(&dft, &first));
        TEST_ASSERT_EQUAL_INT(banks == 2, frf_block_latest(&dft, &later));
        frf_block_add_i16(&dft, samples, period - 32u);
        TEST_ASSERT_TRUE(frf_block_latest(&dft, &later));
        TEST_ASSERT_EQUAL_UINT32(banks + 1u, later.sequence);
    }
}

/* A period that is complete when the DFT is started over can be read from then on, whatever work on it was still to be
 * spread. */
static void test_block_restart_finishes_the_period_before(void)
{
    const uint32_t period = 96;
    spread_bins(40, 5);
    build(period, &folded_32);
    fill_random(period);
    struct frf_block dft;
    struct frf_block_period latched;
    start(&dft, 1, 2, true);
    frf_block_add_i16(&dft, samples, period);
    TEST_ASSERT_FALSE(frf_block_latest(&dft, &latched));
    frf_block_restart(&dft);
    TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
    TEST_ASSERT_EQUAL_UINT32(1, latched.sequence);
    TEST_ASSERT_EQUAL_UINT32(0, latched.reasons);
}

/* Gaps that always end after a period's first part: what is folded never holds more than a period, so the table's bound
 * on the sums stays true; any number of samples at the rail would overflow else. */
static void test_block_gaps_do_not_pile_up_in_the_folded_period(void)
{
    const uint32_t period = 64, repeats = 4, part_samples = period / repeats;
    const struct frf_block_layout small = {8, 8, repeats};
    struct frf_block dft;
    regular_bins(28, 4, 0);
    build(period, &small);
    for (uint32_t n = 0; n < period; n++)
        samples[n] = INT16_MIN;
    start(&dft, 1, 1, false);
    frf_block_add_i16(&dft, samples, part_samples);
    for (unsigned p = 0; p < 20; p++) {
        frf_block_add_i16(&dft, samples, part_samples);
        frf_block_skip(&dft, period - part_samples);
        frf_block_add_i16(&dft, samples, period - part_samples);
        for (uint32_t i = 0; i < part_samples; i++)
            TEST_ASSERT_TRUE(part[i] >= INT16_MIN * (int32_t)repeats);
        frf_block_skip(&dft, part_samples);
    }
}

/* Rails and marks belong to their period also where its last block is filled up with zeros, which are no samples. */
static void test_block_marks_and_rails_hold_for_one_period(void)
{
    const uint32_t period = 50;
    const struct frf_block_layout small = {16, 16, 1};
    struct frf_block dft;
    struct frf_block_period latched;
    spread_bins(20, 4);
    build(period, &small);
    struct frf_block_config config = configuration(1, 2, false);
    config.rail_low = 0;
    config.rail_high = 4095;
    TEST_ASSERT_EQUAL_INT(core_ok, frf_block_init(&dft, &config));
    for (uint32_t n = 0; n < period; n++)
        samples[n] = 2000;
    for (unsigned p = 0; p < 6; p++) {
        static const int16_t last[6] = {1, 0, 4094, 4095, -1, 2000};
        samples[period - 1] = last[p];
        if (p == 2) {
            frf_block_mark(&dft, frf_reason_late);
            frf_block_mark(&dft, frf_reason_application);
        }
        for (uint32_t n = 0; n < period; n += 10)
            frf_block_add_i16(&dft, samples + n, 10);
        TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
        uint32_t saturated = last[p] < 1 || last[p] > 4094 ? frf_reason_saturated : 0;
        TEST_ASSERT_EQUAL_UINT32(saturated | (p == 2 ? frf_reason_late | frf_reason_application : 0), latched.reasons);
    }
    TEST_ASSERT_EQUAL_UINT32(3, dft.err.saturated);
    TEST_ASSERT_EQUAL_UINT32(1, dft.err.late);
    frf_block_add_i16(&dft, samples, 33);
    frf_block_mark(&dft, frf_reason_application);
    frf_block_restart(&dft);
    frf_block_add_i16(&dft, samples, period);
    TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
    TEST_ASSERT_EQUAL_UINT32(7, latched.sequence);
    TEST_ASSERT_EQUAL_UINT32(0, latched.reasons);
}

/* What comes through of a tone above the shared basis's lines, where blocks alias it onto one of them. */
static void test_block_shared_basis_keeps_out_what_is_above(void)
{
    const uint32_t period = 16384;
    double magnitude, worst = 0;
    spread_bins(327, 100);
    build(period, &shared_128);
    for (uint32_t b = 0; b < bin_count; b += 11) {
        uint32_t tone = bins[b] + 7u * period / 128u;
        struct frf_block dft;
        struct frf_block_period latched;
        for (uint32_t n = 0; n < period; n++)
            samples[n] = (int16_t)lround(32000 * sine[(uint64_t)tone * n % period]);
        start(&dft, 1, 1, false);
        frf_block_add_i16(&dft, samples, period);
        TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
        worst = fmax(worst, error_of(&dft, &latched, b, &magnitude) / (16000.0 * period));
    }
    printf("tone above a shared basis, aliased onto a line: %.1f dB of it\n", 20 * log10(worst));
    TEST_ASSERT_TRUE(worst <= 2e-4); /* the table's bound, RMS over a block, times sqrt 2 and a little */
}

static void test_block_choice_builds_and_is_cheaper_than_folding(void)
{
    static const double shares[] = {0.003, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.45};
    for (unsigned s = 0; s < sizeof shares / sizeof shares[0]; s++) {
        for (uint32_t period = 500; period <= 50000; period *= 10) {
            struct frf_block_layout layout;
            spread_bins((uint32_t)(shares[s] * period) < 2 ? 2 : (uint32_t)(shares[s] * period), 200);
            frf_block_choose(bins, bin_count, period, 0, &layout);
            build(period, &layout);
            if (bin_count > 100 && shares[s] <= 0.1)
                TEST_ASSERT_TRUE(layout.terms < layout.block_samples);
            if (shares[s] >= 0.45)
                TEST_ASSERT_EQUAL_UINT32(layout.block_samples, layout.terms);
        }
    }
    struct frf_block_layout none;
    spread_bins(20, 5);
    frf_block_choose(bins, bin_count, 63, 0, &none);
    TEST_ASSERT_EQUAL_UINT32(0, none.block_samples);
    frf_block_choose(bins, bin_count, 30, 0, &none);
    TEST_ASSERT_EQUAL_UINT32(0, none.block_samples);
}

static void expect_build(enum core_status expected, uint32_t period, uint32_t block, uint32_t terms)
{
    struct frf_block_layout layout = {block, terms, 1};
    struct frf_block_table untouched = {0};
    TEST_ASSERT_EQUAL_INT(expected, frf_block_build(coefficients, sizeof coefficients / sizeof *coefficients, bins,
                                                    bin_count, period, &layout, &untouched));
    TEST_ASSERT_EQUAL_UINT32(expected == core_ok ? bin_count : 0, untouched.bin_count);
}

static void test_block_build_and_init_refuse_what_cannot_work(void)
{
    spread_bins(200, 50);
    expect_build(core_err_frf_period, 3, 32, 32);
    expect_build(core_err_frf_period, 65537, 32, 32);
    expect_build(core_err_frf_bins, 400, 32, 32);
    static const uint32_t layouts[][2] = {{4, 4}, {30, 28}, {132, 32}, {32, 0}, {32, 36}, {32, 30}, {0, 0}};
    for (unsigned i = 0; i < sizeof layouts / sizeof layouts[0]; i++)
        expect_build(core_err_frf_block, 2000, layouts[i][0], layouts[i][1]);
    expect_build(core_err_frf_block, 2000, 64, 16); /* too few functions */
    expect_build(core_ok, 2000, 64, 24);
    struct frf_block_layout folding = {32, 32, 2};
    TEST_ASSERT_EQUAL_INT(core_err_frf_block, frf_block_build(coefficients, sizeof coefficients / sizeof *coefficients,
                                                              bins, bin_count, 2000, &folding, &table));
    regular_bins(200, 2, 1);
    TEST_ASSERT_EQUAL_INT(core_err_frf_block, frf_block_build(coefficients, sizeof coefficients / sizeof *coefficients,
                                                              bins, bin_count, 2001, &folding, &table));
    spread_bins(200, 50);
    uint32_t words = FRF_BLOCK_TABLE_WORDS(bin_count, 32u, 32u);
    TEST_ASSERT_EQUAL_INT(core_err_storage,
                          frf_block_build(coefficients, words - 1u, bins, bin_count, 2000, &folded_32, &table));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_block_build(NULL, words, bins, bin_count, 2000, &folded_32, &table));
    build(2000, &folded_32);
    struct frf_block dft;
    struct frf_block_config good = configuration(1, 1, false), bad = good;
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_block_init(NULL, &good));
    bad.banks = 3;
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_block_init(&dft, &bad));
    bad = good;
    bad.channels = SERVOSCOPE_FRF_CHANNELS_MAX + 1;
    TEST_ASSERT_EQUAL_INT(core_err_frf_channels, frf_block_init(&dft, &bad));
    bad = good;
    bad.storage_words--;
    TEST_ASSERT_EQUAL_INT(core_err_storage, frf_block_init(&dft, &bad));
    bad = good;
    bad.rail_low = bad.rail_high = 5;
    TEST_ASSERT_EQUAL_INT(core_err_frf_rails, frf_block_init(&dft, &bad));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_block_init(&dft, &good));
}

/* The way of cores without a long multiply, which the host does not go by itself. */
static void test_sum_by_twos_equals_the_sum(void)
{
    static int16_t factors[97];
    fill_random(400);
    for (uint32_t i = 0; i < 97; i++)
        factors[i] = (int16_t)(i % 3 == 0 ? 32767 : i % 3 == 1 ? -32767 : (int32_t)(random_u32() >> 17) - 16384);
    samples[0] = samples[3] = INT16_MIN;
    for (uint32_t stride = 1; stride <= 3; stride++) {
        for (uint32_t pairs = 0; pairs <= 50; pairs++) {
            struct frf_walk walk = {5, 41, 97, stride};
            int64_t expected = 0;
            for (uint32_t n = 0; n < 2 * pairs; n++)
                expected += samples[n * stride] * factors[(5 + 41 * n) % 97];
            TEST_ASSERT_EQUAL_INT64(expected, frf_sum_by_twos_portable(factors, samples, &walk, pairs));
            TEST_ASSERT_EQUAL_UINT32((5 + 82 * pairs) % 97, walk.index);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_block_folded_signal_to_noise);
    RUN_TEST(test_block_shared_basis_signal_to_noise);
    RUN_TEST(test_block_lines_at_multiples_of_the_block_rate);
    RUN_TEST(test_block_cannot_overflow);
    RUN_TEST(test_block_does_not_depend_on_chunks_or_spreading);
    RUN_TEST(test_block_channels_do_not_mix);
    RUN_TEST(test_block_folded_period_signal_to_noise);
    RUN_TEST(test_block_folded_period_cannot_overflow);
    RUN_TEST(test_block_gap_anywhere_spoils_only_its_periods);
    RUN_TEST(test_block_spread_result_is_there_before_the_next_block_is_full);
    RUN_TEST(test_block_cut_off_work_leaves_nothing_behind);
    RUN_TEST(test_block_gap_does_not_hide_that_a_bank_is_written_to);
    RUN_TEST(test_block_keeps_a_period_as_long_as_its_banks_allow);
    RUN_TEST(test_block_restart_finishes_the_period_before);
    RUN_TEST(test_block_gaps_do_not_pile_up_in_the_folded_period);
    RUN_TEST(test_block_marks_and_rails_hold_for_one_period);
    RUN_TEST(test_block_shared_basis_keeps_out_what_is_above);
    RUN_TEST(test_block_choice_builds_and_is_cheaper_than_folding);
    RUN_TEST(test_block_build_and_init_refuse_what_cannot_work);
    RUN_TEST(test_sum_by_twos_equals_the_sum);
    return UNITY_END();
}
