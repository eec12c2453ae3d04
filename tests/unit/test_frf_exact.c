/* SPDX-License-Identifier: MIT */
/* The integer DFTs over all bins of many periods, primes among them, for the inputs that drive a sum as far as it goes:
 * every product of one sign (the L1 bound). The reference is a sum in 96 bits of the products by definition. */
#include "frf/block.h"
#include "frf/block_kernel.h"
#include "frf/dft.h"

#include "unity.h"

#include <stdio.h>
#include <string.h>

enum { period_max = 65521, bins_max = 2046, block_bins_max = 200 };

static int16_t table_q15[2u * period_max];
static int32_t table_q31[2u * period_max];
static union frf_word storage[FRF_STORAGE_WORDS(bins_max, 1u)];
static uint32_t bins[bins_max];
static uint32_t bin_count;
static int16_t samples[period_max];
static uint64_t sums;

void setUp(void) {}

void tearDown(void) {}

/* high 2^32 + low, 0 <= low < 2^32 */
struct wide {
    int64_t high;
    uint64_t low;
};

static void wide_add(struct wide *self, int64_t value)
{
    uint64_t bits = (uint64_t)value;
    self->low += bits & 0xFFFFFFFFu;
    self->high += (int64_t)(bits >> 32) - (value < 0 ? INT64_C(1) << 32 : 0) + (int64_t)(self->low >> 32);
    self->low &= 0xFFFFFFFFu;
}

static void expect_sum(const int32_t *w31, const int16_t *w15, uint32_t period, uint32_t bin, int sign, int64_t actual)
{
    struct wide expected = {0, 0}, found = {0, 0};
    char message[64];
    uint32_t index = 0;
    for (uint32_t n = 0; n < period; n++) {
        wide_add(&expected, sign * (int64_t)samples[n] * (w31 ? w31[index] : w15[index]));
        index = (index + bin) % period;
    }
    wide_add(&found, actual);
    snprintf(message, sizeof message, "N = %u, bin %u", (unsigned)period, (unsigned)bin);
    TEST_ASSERT_EQUAL_INT64_MESSAGE(expected.high, found.high, message);
    TEST_ASSERT_EQUAL_HEX64_MESSAGE(expected.low, found.low, message);
    sums++;
}

static void expect_all_bins(uint32_t period)
{
    struct frf_twiddles_q15 q15;
    struct frf_twiddles_q31 q31;
    struct frf_dft_config config = {bins, bin_count, 1, storage, sizeof storage / sizeof *storage, 0, 0};
    uint32_t words = FRF_TWIDDLE_WORDS(period);
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_q15(table_q15, words, period, &q15));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_q31(table_q31, words, period, &q31));
    for (int number = frf_number_q15; number <= frf_number_q31; number++) {
        struct frf_dft dft;
        struct frf_period latched;
        bool is_q15 = number == frf_number_q15;
        enum core_status status =
            is_q15 ? frf_dft_init_q15(&dft, &config, &q15) : frf_dft_init_q31(&dft, &config, &q31);
        TEST_ASSERT_EQUAL_INT(core_ok, status);
        frf_dft_add_i16(&dft, samples, period);
        TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
        for (uint32_t b = 0; b < bin_count; b++) {
            expect_sum(is_q15 ? NULL : q31.cosine, q15.cosine, period, bins[b], 1,
                       frf_period_real(&dft, &latched, b, 0));
            expect_sum(is_q15 ? NULL : q31.sine, q15.sine, period, bins[b], -1,
                       frf_period_imaginary(&dft, &latched, b, 0));
        }
    }
}

/* Full scale against the sign of the bin's cosine or sine: its own sum is the largest there is. */
static void fill_worst(uint32_t period, uint32_t bin, bool is_sine, bool negative)
{
    struct frf_twiddles_q31 q31;
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_q31(table_q31, FRF_TWIDDLE_WORDS(period), period, &q31));
    const int32_t *wave = is_sine ? q31.sine : q31.cosine;
    for (uint32_t n = 0; n < period; n++)
        samples[n] = (wave[(uint64_t)bin * n % period] < 0) == negative ? INT16_MAX : INT16_MIN;
}

static void all_bins(uint32_t period)
{
    bin_count = 0;
    for (uint32_t bin = 1; bin <= (period - 1u) / 2u; bin++)
        bins[bin_count++] = bin;
}

static void test_exact_all_bins_each_with_its_worst_input(void)
{
    static const uint32_t larger[] = {97, 100, 127, 128};
    for (uint32_t i = 0; i < 61 + sizeof larger / sizeof *larger; i++) {
        uint32_t period = i < 61 ? 4 + i : larger[i - 61];
        all_bins(period);
        for (uint32_t bin = 1; bin <= (period - 1u) / 2u; bin++) {
            fill_worst(period, bin, bin % 2 != 0, bin % 4 < 2);
            expect_all_bins(period);
        }
    }
    printf(
        "exact: %llu sums of all bins against 96-bit sums, each bin with its worst input, N = 4 .. 64 and 97 .. 128\n",
        (unsigned long long)sums);
}

static void test_exact_all_bins_of_long_and_prime_periods(void)
{
    static const uint32_t periods[] = {251, 509, 1009, 2000, 2003, 4093};
    for (unsigned p = 0; p < sizeof periods / sizeof *periods; p++) {
        all_bins(periods[p]);
        fill_worst(periods[p], bin_count / 3u, false, true);
        expect_all_bins(periods[p]);
    }
    bin_count = 12;
    for (uint32_t b = 0; b < bin_count; b++)
        bins[b] = 1u + b * b * 270u;
    bins[bin_count - 1u] = (period_max - 1u) / 2u;
    fill_worst(period_max, bins[5], true, false);
    expect_all_bins(period_max);
    printf("exact: %llu sums so far, all bins to N = 4093, 12 bins of the prime 65521\n", (unsigned long long)sums);
}

/* The block DFT by its definition in frf/block_kernel.h and frf/block_table.h, in 64 bits, where nothing wraps. */
static int64_t floor_shift(int64_t value, unsigned shift)
{
    int64_t unit = INT64_C(1) << shift, rest = value % unit;
    return (value - (rest < 0 ? rest + unit : rest)) / unit;
}

static int64_t rounded_high(int64_t product)
{
    return floor_shift(product + (INT64_C(1) << 31), 32);
}

struct reference_sum {
    int64_t real, imaginary;
};

static int64_t magnitude_max;

static void note(int64_t value, int64_t limit)
{
    int64_t magnitude = value < 0 ? -value : value;
    TEST_ASSERT_LESS_THAN_INT64(limit, magnitude);
    if (limit == INT64_C(1) << 30 && magnitude > magnitude_max)
        magnitude_max = magnitude;
}

static void reference_row(const int32_t *rows, uint32_t row, uint32_t terms, const int64_t *data,
                          struct reference_sum *io_sum)
{
    const int32_t *pair = rows + row / 2u * (4u + 2u * terms), *rotation = pair + 2u * terms + row % 2u * 2u;
    int64_t real = 8, imaginary = 8;
    for (uint32_t t = 0; t < terms; t += 2) {
        const int32_t *factor = pair + t / 4u * 8u + row % 2u * 4u + t % 4u;
        real += rounded_high(data[t] * factor[0]);
        imaginary += rounded_high(data[t + 1u] * factor[1]);
    }
    note(real, INT64_C(1) << 31);
    note(imaginary, INT64_C(1) << 31);
    int64_t twice_real = 2 * io_sum->real, twice_imaginary = 2 * io_sum->imaginary;
    io_sum->real =
        rounded_high(twice_real * rotation[0]) + rounded_high(-(twice_imaginary * rotation[1])) + floor_shift(real, 4);
    io_sum->imaginary = rounded_high(twice_real * rotation[1]) + rounded_high(twice_imaginary * rotation[0]) +
                        floor_shift(imaginary, 4);
}

/* start: of the block, below 0 in front of the period, where there is nothing */
static void reference_block(const struct frf_block_table *table, int64_t start, struct reference_sum *io_sums)
{
    uint32_t block = table->layout.block_samples, terms = table->layout.terms;
    int64_t folded[FRF_BLOCK_SAMPLES_MAX], work[FRF_BLOCK_SAMPLES_MAX];
    int64_t scale = INT64_C(1) << (table->gain_shift + (table->basis ? 11u : 4u));
    for (uint32_t i = 0; i < block / 2u; i++) {
        int64_t right = start + block / 2u + i, left = start + block / 2u - 1u - i;
        int64_t r = right < table->period_samples ? samples[right] : 0;
        int64_t l = left >= 0 && left < table->period_samples ? samples[left] : 0;
        folded[2u * i] = (r + l) * scale;
        folded[2u * i + 1u] = (r - l) * scale;
        note(folded[2u * i], INT64_C(1) << 31);
        note(folded[2u * i + 1u], INT64_C(1) << 31);
    }
    for (uint32_t row = 0; table->basis && row < terms / 2u; row++) {
        struct reference_sum sum = {0, 0};
        reference_row(table->basis, row, block, folded, &sum);
        work[2u * row] = sum.real;
        work[2u * row + 1u] = sum.imaginary;
    }
    for (uint32_t b = 0; b < table->bin_count; b++) {
        reference_row(table->rows, b, terms, table->basis ? work : folded, &io_sums[b]);
        note(io_sums[b].real, INT64_C(1) << 30);
        note(io_sums[b].imaginary, INT64_C(1) << 30);
    }
}

static void expect_block(const struct frf_block_table *table, bool spread)
{
    static int32_t words[FRF_BLOCK_STORAGE_WORDS(block_bins_max, 1u, 2u, 128u, 64u) + FRF_BLOCK_SPREAD_WORDS(1u, 128u)];
    static struct reference_sum expected[block_bins_max];
    struct frf_block dft;
    struct frf_block_period latched;
    struct frf_block_config config = {.table = table,
                                      .channels = 1,
                                      .banks = 2,
                                      .spread = spread,
                                      .storage = words,
                                      .storage_words = sizeof words / sizeof *words};
    uint32_t block = table->layout.block_samples;
    memset(expected, 0, sizeof expected);
    for (int64_t start = -(int64_t)table->lead_samples; start < table->period_samples; start += block)
        reference_block(table, start, expected);
    TEST_ASSERT_EQUAL_INT(core_ok, frf_block_init(&dft, &config));
    frf_block_add_i16(&dft, samples, table->period_samples);
    frf_block_add_i16(&dft, samples, block);
    TEST_ASSERT_TRUE(frf_block_latest(&dft, &latched));
    for (uint32_t b = 0; b < table->bin_count; b++) {
        TEST_ASSERT_EQUAL_INT64(expected[b].real, latched.accumulators[2u * b]);
        TEST_ASSERT_EQUAL_INT64(expected[b].imaginary, latched.accumulators[2u * b + 1u]);
        sums += 2;
    }
}

static void test_exact_block_equals_its_definition_for_worst_inputs(void)
{
    static int32_t coefficients[FRF_BLOCK_TABLE_WORDS(block_bins_max, 128u, 64u)];
    static const struct {
        uint32_t period, last;
        struct frf_block_layout layout;
    } cases[] = {{97, 48, {8, 8, 1}},        {251, 125, {32, 32, 1}},  {509, 200, {64, 64, 1}},
                 {1009, 504, {32, 32, 1}},   {2003, 60, {64, 24, 1}},  {2000, 40, {128, 12, 1}},
                 {4093, 2046, {32, 32, 1}},  {4093, 60, {128, 16, 1}}, {65521, 200, {64, 8, 1}},
                 {65521, 32760, {32, 32, 1}}};
    for (unsigned c = 0; c < sizeof cases / sizeof *cases; c++) {
        struct frf_block_table table;
        uint32_t step = (cases[c].last + block_bins_max - 1u) / block_bins_max, period = cases[c].period;
        if (period > 10000)
            step = cases[c].last / 12u;
        bin_count = 0;
        for (uint32_t bin = cases[c].last % step ? cases[c].last % step : step; bin <= cases[c].last; bin += step)
            bins[bin_count++] = bin;
        TEST_ASSERT_EQUAL_INT(core_ok, frf_block_build(coefficients, sizeof coefficients / sizeof *coefficients, bins,
                                                       bin_count, period, &cases[c].layout, &table));
        for (unsigned kind = 0; kind < 4; kind++) {
            fill_worst(period, bins[kind * (bin_count - 1u) / 3u], kind % 2 != 0, kind < 2);
            expect_block(&table, kind % 2 == 0);
        }
    }
    printf("exact: %llu sums; block accumulators up to %.3f of their bound 2^30\n", (unsigned long long)sums,
           (double)magnitude_max / 1073741824.0);
    TEST_ASSERT_GREATER_THAN_INT64(INT64_C(1) << 29, magnitude_max); /* the inputs did come near it */
}

/* The kernel alone at the rims of its words, where a sum may wrap on its way. */
static void test_exact_kernel_at_the_rims(void)
{
    static const int32_t rims[] = {INT32_MIN, INT32_MIN + 1, -1, 0, 1, INT32_MAX - 1, INT32_MAX, 0x40000000};
    static const int32_t starts[] = {-1073741823, -1, 0, 1, 1073741823};
    for (unsigned a = 0; a < 8 * 8 * 5 * 5; a++) {
        int32_t data[4], rows[12], sum[4];
        for (unsigned t = 0; t < 4; t++)
            data[t] = rims[(a + t) % 8];
        for (unsigned t = 0; t < 8; t++)
            rows[t] = rims[(a / 8 + t * t) % 8];
        for (unsigned t = 0; t < 4; t++)
            rows[8 + t] = rims[(a + a / 8 + 3 * t) % 8];
        for (unsigned t = 0; t < 4; t++)
            sum[t] = starts[t % 2 ? a / 64 % 5 : a / 320 % 5];
        for (uint32_t row = 0; row < 2; row++) {
            uint32_t real = 8, imaginary = 8;
            for (unsigned t = 0; t < 4; t += 2) {
                real += (uint32_t)rounded_high((int64_t)data[t] * rows[4 * row + t]);
                imaginary += (uint32_t)rounded_high((int64_t)data[t + 1] * rows[4 * row + t + 1]);
            }
            int64_t signed_real = real < 0x80000000u ? (int64_t)real : (int64_t)real - (INT64_C(1) << 32);
            int64_t signed_imaginary =
                imaginary < 0x80000000u ? (int64_t)imaginary : (int64_t)imaginary - (INT64_C(1) << 32);
            int64_t c = rows[8 + 2 * row], s = rows[9 + 2 * row];
            int64_t re = 2 * (int64_t)starts[a / 320 % 5], im = 2 * (int64_t)starts[a / 64 % 5];
            int64_t expected_real = rounded_high(re * c) + rounded_high(-(im * s)) + floor_shift(signed_real, 4);
            int64_t expected_imaginary = rounded_high(re * s) + rounded_high(im * c) + floor_shift(signed_imaginary, 4);
            int32_t got[4];
            memcpy(got, sum, sizeof got);
            frf_block_accumulate_portable(got, rows, data, 1, 1);
            TEST_ASSERT_EQUAL_HEX32((uint32_t)expected_real, (uint32_t)got[2 * row]);
            TEST_ASSERT_EQUAL_HEX32((uint32_t)expected_imaginary, (uint32_t)got[2 * row + 1]);
        }
    }
}

/* A sum over segments, wherever they are cut and whatever wraps on its way, is what the kernel makes of the whole. */
static void test_exact_sum_of_segments_is_the_whole(void)
{
    enum { groups = 5 };
    static const int32_t values[] = {INT32_MIN, INT32_MAX, -1, 1, 0x40000000, -123456789, 987654321};
    int32_t data[4 * groups], rows[8 * groups + 4] = {0}, whole[4], parts[4];
    for (uint32_t round = 0; round < 343; round++) {
        for (uint32_t t = 0; t < 4 * groups; t++)
            data[t] = values[(round + t * t) % 7];
        for (uint32_t t = 0; t < 8 * groups; t++)
            rows[t] = values[(round / 7 + t * (round / 49)) % 7];
        memset(whole, 0x7F, sizeof whole);
        frf_block_accumulate_portable(whole, rows, data, 1, groups);
        for (uint32_t cut = 1; cut < groups; cut++) {
            memset(parts, 0x35, sizeof parts);
            frf_block_sum_portable(parts, rows, data, cut, true);
            frf_block_sum_portable(parts, rows + 8 * cut, data + 4 * cut, groups - cut, false);
            frf_block_end_sum(parts);
            TEST_ASSERT_EQUAL_INT32_ARRAY(whole, parts, 4);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_exact_all_bins_each_with_its_worst_input);
    RUN_TEST(test_exact_all_bins_of_long_and_prime_periods);
    RUN_TEST(test_exact_block_equals_its_definition_for_worst_inputs);
    RUN_TEST(test_exact_kernel_at_the_rims);
    RUN_TEST(test_exact_sum_of_segments_is_the_whole);
    return UNITY_END();
}
