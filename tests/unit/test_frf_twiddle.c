/* SPDX-License-Identifier: MIT */
/* The DFT over quarter and two-level tables: the quarter's sums are the full table's to the last bit, the two-level's
 * are exact sums over the factors that their definition gives, which are within their bounds of the sine. */
#include "frf/dft.h"

#include "tests/support/exact_sum.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { period_max = 65536, bins_max = 2046, channels_max = 4 };
enum kind { kind_full, kind_quarter, kind_two_level, kind_count };
enum { number_count = 4 };

static const long double pi_long = 3.14159265358979323846264338327950288L;
static const char *const kind_names[kind_count] = {"full", "quarter", "two-level"};
static const char *const number_names[number_count] = {"Q15", "Q31", "f32", "Q23"};

static struct {
    int16_t full_q15[2 * period_max], quarter_q15[period_max + 1];
    int32_t full_q23[2 * period_max], quarter_q23[period_max + 1];
    int32_t full_q31[2 * period_max], quarter_q31[period_max + 1];
    float full_f32[2 * period_max], quarter_f32[period_max + 1];
    struct frf_point coarse_q15[512], coarse_q23[512], coarse_q31[512];
    struct frf_turn_q15 fine_q15[256];
    struct frf_turn fine_q23[256], fine_q31[256];
    struct frf_point_f32 coarse_f32[512];
    struct frf_turn_f32 fine_f32[256];
} words;
static struct {
    struct frf_twiddles_q15 q15;
    struct frf_twiddles_q23 q23;
    struct frf_twiddles_q31 q31;
    struct frf_twiddles_f32 f32;
} full;
static struct {
    struct frf_quarter_q15 q15;
    struct frf_quarter_q23 q23;
    struct frf_quarter_q31 q31;
    struct frf_quarter_f32 f32;
} quarter;
static struct {
    struct frf_two_level_q15 q15;
    struct frf_two_level_q23 q23;
    struct frf_two_level_q31 q31;
    struct frf_two_level_f32 f32;
} two_level;
static union frf_word storage[2][FRF_STORAGE_WORDS(bins_max, channels_max)];
static uint32_t bins[bins_max];
static uint32_t bin_count;
static int16_t samples_i16[2u * period_max];
static int32_t samples_i24[2u * period_max];
static float samples_f32[2u * period_max];
static uint64_t random_state;

void setUp(void)
{
    random_state = 3;
}

void tearDown(void) {}

static uint32_t random_u32(void)
{
    return exact_random_u32(&random_state);
}

static void build(uint32_t period)
{
    uint32_t all = FRF_TWIDDLE_WORDS(period), part = FRF_QUARTER_WORDS(period);
    uint32_t points = FRF_COARSE_POINTS(period), turns = FRF_FINE_TURNS(period);
    TEST_ASSERT_TRUE(points * turns >= period && (points - 1u) * turns < period);
    memset(&words, 0x5A, sizeof words);
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_q15(words.full_q15, all, period, &full.q15));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_q23(words.full_q23, all, period, &full.q23));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_q31(words.full_q31, all, period, &full.q31));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_twiddles_build_f32(words.full_f32, all, period, &full.f32));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_quarter_build_q15(words.quarter_q15, part, period, &quarter.q15));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_quarter_build_q23(words.quarter_q23, part, period, &quarter.q23));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_quarter_build_q31(words.quarter_q31, part, period, &quarter.q31));
    TEST_ASSERT_EQUAL_INT(core_ok, frf_quarter_build_f32(words.quarter_f32, part, period, &quarter.f32));
    TEST_ASSERT_EQUAL_INT(
        core_ok, frf_two_level_build_q15(words.coarse_q15, points, words.fine_q15, turns, period, &two_level.q15));
    TEST_ASSERT_EQUAL_INT(
        core_ok, frf_two_level_build_q23(words.coarse_q23, points, words.fine_q23, turns, period, &two_level.q23));
    TEST_ASSERT_EQUAL_INT(
        core_ok, frf_two_level_build_q31(words.coarse_q31, points, words.fine_q31, turns, period, &two_level.q31));
    TEST_ASSERT_EQUAL_INT(
        core_ok, frf_two_level_build_f32(words.coarse_f32, points, words.fine_f32, turns, period, &two_level.f32));
    /* What lies behind a table is as it was. */
    TEST_ASSERT_EQUAL_HEX16(0x5A5A, words.quarter_q15[part]);
    TEST_ASSERT_EQUAL_HEX32(0x5A5A5A5A, words.quarter_q31[part]);
    TEST_ASSERT_TRUE(points == 512 || words.coarse_q31[points].cosine == 0x5A5A5A5A);
    TEST_ASSERT_TRUE(turns == 256 ||
                     (words.fine_q31[turns].less == 0x5A5A5A5A && words.fine_q15[turns].less == 0x5A5A));
}

static enum core_status set_up(struct frf_dft *dft, enum kind kind, enum frf_number number,
                               const struct frf_dft_config *config)
{
    switch ((int)kind * number_count + (int)number) {
    case kind_full *number_count + frf_number_q15:
        return frf_dft_init_q15(dft, config, &full.q15);
    case kind_full *number_count + frf_number_q23:
        return frf_dft_init_q23(dft, config, &full.q23);
    case kind_full *number_count + frf_number_q31:
        return frf_dft_init_q31(dft, config, &full.q31);
    case kind_full *number_count + frf_number_f32:
        return frf_dft_init_f32(dft, config, &full.f32);
    case kind_quarter *number_count + frf_number_q15:
        return frf_dft_init_quarter_q15(dft, config, &quarter.q15);
    case kind_quarter *number_count + frf_number_q23:
        return frf_dft_init_quarter_q23(dft, config, &quarter.q23);
    case kind_quarter *number_count + frf_number_q31:
        return frf_dft_init_quarter_q31(dft, config, &quarter.q31);
    case kind_quarter *number_count + frf_number_f32:
        return frf_dft_init_quarter_f32(dft, config, &quarter.f32);
    case kind_two_level *number_count + frf_number_q15:
        return frf_dft_init_two_level_q15(dft, config, &two_level.q15);
    case kind_two_level *number_count + frf_number_q23:
        return frf_dft_init_two_level_q23(dft, config, &two_level.q23);
    case kind_two_level *number_count + frf_number_q31:
        return frf_dft_init_two_level_q31(dft, config, &two_level.q31);
    default:
        return frf_dft_init_two_level_f32(dft, config, &two_level.f32);
    }
}

static void start(struct frf_dft *dft, enum kind kind, enum frf_number number, uint32_t channels,
                  union frf_word *at_storage)
{
    struct frf_dft_config config = {bins, bin_count, channels, at_storage, FRF_STORAGE_WORDS(bin_count, channels),
                                    0,    0};
    memset(at_storage, 0x5A, sizeof storage[0]);
    TEST_ASSERT_EQUAL_INT(core_ok, set_up(dft, kind, number, &config));
    TEST_ASSERT_EQUAL_INT(number, dft->number);
}

static void add(struct frf_dft *dft, uint32_t first, uint32_t count)
{
    if (dft->number == frf_number_f32)
        frf_dft_add_f32(dft, samples_f32 + first * dft->channels, count);
    else if (dft->number == frf_number_q23)
        frf_dft_add_i24(dft, samples_i24 + first * dft->channels, count);
    else
        frf_dft_add_i16(dft, samples_i16 + first * dft->channels, count);
}

static void all_bins(uint32_t period)
{
    bin_count = 0;
    for (uint32_t bin = 1; bin <= (period - 1u) / 2u && bin_count < bins_max; bin++)
        bins[bin_count++] = bin;
}

/* First, last and some between. */
static void some_bins(uint32_t period, uint32_t most)
{
    uint32_t last = (period - 1u) / 2u;
    bin_count = 0;
    for (uint32_t i = 0; i < most; i++) {
        uint32_t bin = 1u + i * (last - 1u) / (most - 1u);
        if (bin_count == 0 || bin > bins[bin_count - 1u])
            bins[bin_count++] = bin;
    }
}

static void fill_random(uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        samples_i24[i] = (int32_t)(random_u32() >> 8) + FRF_I24_MIN;
        samples_i16[i] = (int16_t)((int32_t)(random_u32() >> 16) - 32768);
        samples_f32[i] = samples_i16[i];
    }
}

/* A period of 1 at n and 0 elsewhere: the sums are the factors of that sample. What a block's zeros add up to counts
 * once the block is full, so that much is not left out. */
static void factors_at(struct frf_dft *dft, uint32_t n, struct frf_period *out_period)
{
    uint32_t left = dft->period_samples - n, count = SERVOSCOPE_FRF_BLOCK - n % SERVOSCOPE_FRF_BLOCK;
    count = count < left ? count : left;
    memset(samples_i16, 0, count * sizeof *samples_i16);
    memset(samples_i24, 0, count * sizeof *samples_i24);
    memset(samples_f32, 0, count * sizeof *samples_f32);
    samples_i16[0] = 1;
    samples_i24[0] = 1;
    samples_f32[0] = 1;
    frf_dft_skip(dft, n);
    add(dft, 0, count);
    frf_dft_skip(dft, left - count);
    TEST_ASSERT_TRUE(frf_dft_latest(dft, out_period));
}

static const uint32_t long_periods[] = {97,   100,  127,  128,  250,  300,   511,   1002, 1009,
                                        1024, 2000, 2003, 4093, 8191, 16384, 65521, 65536};
enum { short_periods = 61, period_list = short_periods + sizeof long_periods / sizeof *long_periods };

/* 4 .. 64, then the list. */
static uint32_t listed_period(uint32_t i)
{
    return i < short_periods ? 4u + i : long_periods[i - short_periods];
}

static void test_quarter_factors_are_the_full_tables(void)
{
    unsigned long long factors = 0;
    for (uint32_t i = 0; i < period_list; i++) {
        uint32_t period = listed_period(i);
        build(period);
        some_bins(period, 2);
        for (int number = 0; number < number_count; number++) {
            struct frf_dft dft[2];
            struct frf_period latched[2];
            start(&dft[0], kind_full, (enum frf_number)number, 1, storage[0]);
            start(&dft[1], kind_quarter, (enum frf_number)number, 1, storage[1]);
            for (uint32_t n = 0; n < period; n++) {
                factors_at(&dft[0], n, &latched[0]);
                factors_at(&dft[1], n, &latched[1]);
                uint32_t sums = number == frf_number_f32 ? bin_count : 2 * bin_count;
                TEST_ASSERT_EQUAL_MEMORY(latched[0].sums, latched[1].sums, sums * sizeof(union frf_word));
                factors += 2 * bin_count;
            }
        }
    }
    printf("quarter: %llu factors equal to the full table's, all samples of %u periods N = 4 .. 65536, four numbers\n",
           factors, (unsigned)period_list);
}

static void test_quarter_sums_are_the_full_tables_for_any_cut(void)
{
    static const uint32_t periods[] = {97, 98, 100, 1009}, chunks[] = {1, 2, 31, 32, 33, 64, 5000};
    for (unsigned p = 0; p < 4; p++) {
        build(periods[p]);
        some_bins(periods[p], 16);
        for (int kind = kind_quarter; kind < kind_count; kind++) {
            for (int number = 0; number < number_count; number++) {
                for (uint32_t channels = 1; channels <= channels_max; channels++) {
                    struct frf_dft dft[2];
                    struct frf_period latched[2];
                    uint32_t total = 2 * periods[p];
                    fill_random(total * channels);
                    /* The quarter beside the full one, the two-level beside itself in one piece. */
                    start(&dft[0], kind == kind_quarter ? kind_full : kind_two_level, (enum frf_number)number, channels,
                          storage[0]);
                    add(&dft[0], 0, total);
                    TEST_ASSERT_TRUE(frf_dft_latest(&dft[0], &latched[0]));
                    for (unsigned c = 0; c < sizeof chunks / sizeof *chunks; c++) {
                        start(&dft[1], (enum kind)kind, (enum frf_number)number, channels, storage[1]);
                        for (uint32_t at = 0; at < total; at += chunks[c])
                            add(&dft[1], at, total - at < chunks[c] ? total - at : chunks[c]);
                        TEST_ASSERT_TRUE(frf_dft_latest(&dft[1], &latched[1]));
                        TEST_ASSERT_EQUAL_UINT32(2, latched[1].sequence);
                        uint32_t sums = (number == frf_number_f32 ? 1u : 2u) * bin_count * channels;
                        TEST_ASSERT_EQUAL_MEMORY(latched[0].sums, latched[1].sums, sums * sizeof(union frf_word));
                    }
                }
            }
        }
    }
}

/* value / 2^shift, rounded down, by another way than the library's. */
static int64_t floor_shift(int64_t value, unsigned shift)
{
    int64_t unit = INT64_C(1) << shift, rest = value % unit;
    return (value - (rest < 0 ? rest + unit : rest)) / unit;
}

struct factor {
    int64_t cosine, sine;
};

/* By the definition in frf/twiddle.h: what is taken off has the coarse value's scale, rounded down to a quarter of Q31
 * or to Q31, then all is rounded to the factor. */
static struct factor defined_factor(enum frf_number number, uint32_t period, uint32_t index)
{
    uint32_t group = index >> FRF_GROUP_BITS(period), turn = index - (group << FRF_GROUP_BITS(period));
    const struct frf_point *coarse = number == frf_number_q15   ? &two_level.q15.coarse[group]
                                     : number == frf_number_q23 ? &two_level.q23.coarse[group]
                                                                : &two_level.q31.coarse[group];
    int64_t c = coarse->cosine, s = coarse->sine, off_cosine, off_sine;
    struct factor factor;
    if (number == frf_number_q15) {
        int64_t less = two_level.q15.fine[turn].less, sine = two_level.q15.fine[turn].sine;
        off_cosine = floor_shift(floor_shift(c, 16) * less + floor_shift(s, 16) * sine, 2);
        off_sine = floor_shift(floor_shift(s, 16) * less - floor_shift(c, 16) * sine, 2);
        factor.cosine = floor_shift(c - off_cosine + 32768, 16);
        factor.sine = floor_shift(s - off_sine + 32768, 16);
        return factor;
    }
    const struct frf_turn *fine = number == frf_number_q23 ? &two_level.q23.fine[turn] : &two_level.q31.fine[turn];
    int64_t half = number == frf_number_q31 ? 2 : 0;
    off_cosine = floor_shift(floor_shift(c * fine->less + s * fine->sine, 32) + half, 2);
    off_sine = floor_shift(floor_shift(s * fine->less - c * fine->sine, 32) + half, 2);
    unsigned shift = number == frf_number_q23 ? 8 : 0;
    factor.cosine = floor_shift(c - off_cosine + (shift ? 128 : 0), shift);
    factor.sine = floor_shift(s - off_sine + (shift ? 128 : 0), shift);
    return factor;
}

/* In steps of the factors: half for the last rounding and the coarse value's half, turned by up to pi / 32, where that
 * is no finer than the factor; the rest is the fine values' rounding and, of Q15, the 16 bits that are multiplied. Q31
 * has a coarse value a step lower where a factor on an axis would be beyond 1. */
static void test_two_level_factors_are_as_defined_and_within_bounds(void)
{
    static const double ones[number_count] = {FRF_Q15_ONE, FRF_Q31_ONE, 1, FRF_Q23_ONE};
    static const long double bounds[number_count] = {0.7L, 1.4L, 8e-8L, 0.51L};
    long double worst[number_count] = {0};
    unsigned long differing[number_count] = {0}, all = 0;
    for (uint32_t i = 0; i < period_list; i++) {
        uint32_t period = listed_period(i);
        build(period);
        some_bins(period, 2);
        for (int number = 0; number < number_count; number++) {
            struct frf_dft dft;
            struct frf_period latched;
            start(&dft, kind_two_level, (enum frf_number)number, 1, storage[0]);
            for (uint32_t n = 0; n < period; n++) {
                long double angle = 2 * pi_long * (long double)n / (long double)period;
                long double cosine = ones[number] * cosl(angle), sine = ones[number] * sinl(angle);
                factors_at(&dft, n, &latched);
                if (number == frf_number_f32) {
                    worst[number] = fmaxl(worst[number], fabsl(latched.sums[0].pair[0] - cosine));
                    worst[number] = fmaxl(worst[number], fabsl(-latched.sums[0].pair[1] - sine));
                    continue;
                }
                for (uint32_t b = 0; b < bin_count; b++) {
                    struct factor factor =
                        defined_factor((enum frf_number)number, period, (uint32_t)((uint64_t)bins[b] * n % period));
                    TEST_ASSERT_EQUAL_INT64(factor.cosine, frf_period_real(&dft, &latched, b, 0));
                    TEST_ASSERT_EQUAL_INT64(-factor.sine, frf_period_imaginary(&dft, &latched, b, 0));
                    TEST_ASSERT_TRUE(fabs((double)factor.cosine) <= ones[number] &&
                                     fabs((double)factor.sine) <= ones[number]);
                }
                int64_t real = frf_period_real(&dft, &latched, 0, 0),
                        minus = frf_period_imaginary(&dft, &latched, 0, 0);
                worst[number] = fmaxl(worst[number], fabsl((long double)real - cosine));
                worst[number] = fmaxl(worst[number], fabsl((long double)-minus - sine));
                differing[number] += real != llroundl(cosine) || -minus != llroundl(sine);
                all += number == 0;
            }
        }
    }
    for (int number = 0; number < number_count; number++) {
        printf(
            "two-level %s: factors off by up to %.3Lg, bound %.3Lg; %lu of %lu pairs are not the correctly rounded\n",
            number_names[number], worst[number], bounds[number], differing[number], all);
        TEST_ASSERT_TRUE(worst[number] <= bounds[number]);
    }
}

/* Every N there is. On an axis a factor is 1 or -1, and a step more would wrap; beside it, 0 within the bound. */
static void test_two_level_factors_on_the_axes_are_not_beyond_one(void)
{
    unsigned long axes = 0;
    for (uint32_t period = 4; period <= period_max; period++) {
        TEST_ASSERT_EQUAL_INT(core_ok,
                              frf_two_level_build_q31(words.coarse_q31, FRF_COARSE_POINTS(period), words.fine_q31,
                                                      FRF_FINE_TURNS(period), period, &two_level.q31));
        TEST_ASSERT_EQUAL_UINT32(FRF_GROUP_BITS(period), two_level.q31.group_bits);
        for (uint32_t q = 0; q < 4; q++) {
            if (q * period % 4 != 0)
                continue;
            struct factor factor = defined_factor(frf_number_q31, period, q * period / 4u);
            int64_t along = q % 2 ? factor.sine : factor.cosine, across = q % 2 ? factor.cosine : factor.sine;
            along = q < 2 ? along : -along;
            TEST_ASSERT_TRUE(along <= FRF_Q31_ONE && along >= FRF_Q31_ONE - 1 && across >= -1 && across <= 1);
            axes++;
        }
    }
    printf("two-level Q31: %lu factors on an axis, N = 4 .. 65536\n", axes);
}

/* Full scale against the sign of a bin's cosine or sine: its sum is the largest there is. */
static void fill_worst(uint32_t period, uint32_t bin, bool is_sine)
{
    for (uint32_t n = 0; n < period; n++) {
        uint32_t index = (uint32_t)((uint64_t)bin * n % period);
        bool negative = (is_sine ? full.q31.sine : full.q31.cosine)[index] < 0;
        samples_i16[n] = negative ? INT16_MAX : INT16_MIN;
        samples_i24[n] = negative ? FRF_I24_MAX : FRF_I24_MIN;
    }
}

static unsigned long expect_exact(enum frf_number number, uint32_t period)
{
    static struct factor factors[period_max];
    struct frf_dft dft;
    struct frf_period latched;
    for (uint32_t index = 0; index < period; index++)
        factors[index] = defined_factor(number, period, index);
    start(&dft, kind_two_level, number, 1, storage[0]);
    add(&dft, 0, period);
    TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
    for (uint32_t b = 0; b < bin_count; b++) {
        struct exact_sum real = {0, 0}, imaginary = {0, 0};
        for (uint32_t n = 0; n < period; n++) {
            uint32_t index = (uint32_t)((uint64_t)bins[b] * n % period);
            int64_t sample = number == frf_number_q23 ? samples_i24[n] : samples_i16[n];
            exact_sum_add(&real, sample * factors[index].cosine);
            exact_sum_add(&imaginary, -(sample * factors[index].sine));
        }
        exact_sum_expect(&real, frf_period_real(&dft, &latched, b, 0), period, bins[b]);
        exact_sum_expect(&imaginary, frf_period_imaginary(&dft, &latched, b, 0), period, bins[b]);
    }
    return 2ul * bin_count;
}

static void test_two_level_sums_are_exact_for_worst_inputs(void)
{
    static const enum frf_number numbers[3] = {frf_number_q15, frf_number_q23, frf_number_q31};
    unsigned long sums = 0;
    for (uint32_t i = 0; i < period_list; i++) {
        uint32_t period = listed_period(i);
        build(period);
        all_bins(period);
        uint32_t worst = bins[bin_count / 3u];
        if (period > 1100)
            some_bins(period, period > 10000 ? 7 : 100);
        for (unsigned number = 0; number < 3; number++) {
            fill_worst(period, worst, number % 2 == 0);
            sums += expect_exact(numbers[number], period);
        }
    }
    printf("two-level: %lu sums against 96-bit sums over the factors as defined, worst inputs\n", sums);
}

static long double sine_long[period_max];

static void fill_multisine(uint32_t period)
{
    static double signal[period_max];
    double peak = 0;
    bin_count = 0;
    for (unsigned i = 0; i < 40; i++) {
        uint32_t bin = (uint32_t)lround(pow(0.4 * period, i / 39.0));
        if (bin_count == 0 || bin > bins[bin_count - 1u])
            bins[bin_count++] = bin;
    }
    for (uint32_t n = 0; n < period; n++)
        sine_long[n] = sinl(2 * pi_long * (long double)n / (long double)period);
    memset(signal, 0, sizeof signal);
    for (uint32_t b = 0; b < bin_count; b++) {
        uint32_t phase = random_u32() % period;
        for (uint32_t n = 0; n < period; n++)
            signal[n] += (double)sine_long[((uint64_t)bins[b] * n + phase) % period];
    }
    for (uint32_t n = 0; n < period; n++)
        peak = fmax(peak, fabs(signal[n]));
    for (uint32_t n = 0; n < period; n++) {
        samples_i16[n] = (int16_t)lround(0.95 * 32767 * signal[n] / peak);
        samples_i24[n] = (int32_t)lround(0.95 * FRF_I24_MAX * signal[n] / peak);
        samples_f32[n] = samples_i16[n];
    }
}

static double worst_snr_dB(enum kind kind, enum frf_number number, uint32_t period, double *out_mean_dB)
{
    static const long double ones[number_count] = {FRF_Q15_ONE, FRF_Q31_ONE, 1, FRF_Q23_ONE};
    struct frf_dft dft;
    struct frf_period latched;
    double worst = INFINITY;
    start(&dft, kind, number, 1, storage[0]);
    add(&dft, 0, period);
    TEST_ASSERT_TRUE(frf_dft_latest(&dft, &latched));
    *out_mean_dB = 0;
    for (uint32_t b = 0; b < bin_count; b++) {
        long double real = 0, imaginary = 0, got_real, got_imaginary;
        for (uint32_t n = 0; n < period; n++) {
            uint32_t index = (uint32_t)((uint64_t)bins[b] * n % period);
            long double sample = number == frf_number_q23 ? samples_i24[n] : samples_i16[n];
            real += sample * sine_long[(index + period / 4u) % period];
            imaginary -= sample * sine_long[index];
        }
        if (number == frf_number_f32) {
            got_real = latched.sums[b].pair[0];
            got_imaginary = latched.sums[b].pair[1];
        } else {
            got_real = (long double)frf_period_real(&dft, &latched, b, 0) / ones[number];
            got_imaginary = (long double)frf_period_imaginary(&dft, &latched, b, 0) / ones[number];
        }
        double snr_dB =
            20 * log10((double)(hypotl(real, imaginary) / hypotl(got_real - real, got_imaginary - imaginary)));
        worst = fmin(worst, snr_dB);
        *out_mean_dB += snr_dB / bin_count;
    }
    return worst;
}

/* Q15 and Q23 round once, as the full table does, and are required what it is. A Q31 factor carries its group's error
 * too, the same for B neighbours: N/B errors where the full table has N, each with as much power as all B of its own,
 * and of low bins many lines reach them. So at worst
 *
 *     mean SNR = 3 (N/B) F^2 / K:   193.8, 196.7, 199.6 dB for N = 2000, 16384, 65536 and 35, 37, 38 lines
 *
 * and 10 dB below, of which the chance is exp(-10) a bin. */
static void test_two_level_signal_to_noise_of_the_arithmetic(void)
{
    static const uint32_t periods[3] = {2000, 16384, 65536};
    static const double required_dB[number_count][3] = {
        {100, 108, 115}, {183, 186, 189}, {125, 118, 115}, {141, 156, 163}};
    for (unsigned run = 0; run < 6; run++) {
        uint32_t period = periods[run / 2];
        random_state = 1 + run % 2;
        build(period);
        fill_multisine(period);
        for (int number = 0; number < number_count; number++) {
            double mean[kind_count], worst[kind_count];
            for (int kind = 0; kind < kind_count; kind++)
                worst[kind] = worst_snr_dB((enum kind)kind, (enum frf_number)number, period, &mean[kind]);
            printf("SNR N = %5u, seed %u, %s: %s %.1f (mean %.1f) dB, %s %.1f (%.1f), %s %.1f (%.1f), required %.0f\n",
                   (unsigned)period, 1 + run % 2, number_names[number], kind_names[0], worst[0], mean[0], kind_names[1],
                   worst[1], mean[1], kind_names[2], worst[2], mean[2], required_dB[number][run / 2]);
            TEST_ASSERT_TRUE(worst[kind_two_level] >= required_dB[number][run / 2]);
            TEST_ASSERT_TRUE(worst[kind_quarter] == worst[kind_full] && mean[kind_quarter] == mean[kind_full]);
        }
    }
}

static void test_tables_refuse_what_cannot_work(void)
{
    struct frf_dft dft;
    struct frf_dft_config config = {bins, 2, 1, storage[0], FRF_STORAGE_WORDS(2u, 1u), 0, 0};
    build(2002);
    bins[0] = 1;
    bins[1] = 5;
    /* Storage, and periods. */
    TEST_ASSERT_EQUAL_INT(core_err_storage, frf_quarter_build_q15(words.quarter_q15, 1001, 2002, &quarter.q15));
    TEST_ASSERT_EQUAL_INT(core_err_storage, frf_quarter_build_q23(words.quarter_q23, 1001, 2002, &quarter.q23));
    TEST_ASSERT_EQUAL_INT(core_err_storage, frf_quarter_build_q31(words.quarter_q31, 1001, 2002, &quarter.q31));
    TEST_ASSERT_EQUAL_INT(core_err_storage, frf_quarter_build_f32(words.quarter_f32, 1001, 2002, &quarter.f32));
    TEST_ASSERT_EQUAL_INT(core_err_frf_period, frf_quarter_build_q15(words.quarter_q15, 1002, 3, &quarter.q15));
    TEST_ASSERT_EQUAL_INT(core_err_frf_period, frf_quarter_build_q15(words.quarter_q15, 99999, 65537, &quarter.q15));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_quarter_build_q31(NULL, 1002, 2002, &quarter.q31));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_quarter_build_f32(words.quarter_f32, 1002, 2002, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_storage,
                          frf_two_level_build_q15(words.coarse_q15, 62, words.fine_q15, 32, 2002, &two_level.q15));
    TEST_ASSERT_EQUAL_INT(core_err_storage,
                          frf_two_level_build_q23(words.coarse_q23, 63, words.fine_q23, 31, 2002, &two_level.q23));
    TEST_ASSERT_EQUAL_INT(core_err_storage,
                          frf_two_level_build_q31(words.coarse_q31, 62, words.fine_q31, 32, 2002, &two_level.q31));
    TEST_ASSERT_EQUAL_INT(core_err_storage,
                          frf_two_level_build_f32(words.coarse_f32, 63, words.fine_f32, 31, 2002, &two_level.f32));
    TEST_ASSERT_EQUAL_INT(core_err_frf_period,
                          frf_two_level_build_q31(words.coarse_q31, 63, words.fine_q31, 32, 3, &two_level.q31));
    TEST_ASSERT_EQUAL_INT(core_err_argument,
                          frf_two_level_build_q31(NULL, 63, words.fine_q31, 32, 2002, &two_level.q31));
    TEST_ASSERT_EQUAL_INT(core_err_argument,
                          frf_two_level_build_q31(words.coarse_q31, 63, NULL, 32, 2002, &two_level.q31));
    TEST_ASSERT_EQUAL_INT(core_err_argument,
                          frf_two_level_build_q31(words.coarse_q31, 63, words.fine_q31, 32, 2002, NULL));
    /* None, and parts missing. */
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_quarter_q15(&dft, &config, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_quarter_q23(&dft, &config, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_quarter_q31(&dft, &config, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_quarter_f32(&dft, &config, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_two_level_q15(&dft, &config, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_two_level_q23(&dft, &config, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_two_level_q31(&dft, &config, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_argument, frf_dft_init_two_level_f32(&dft, &config, NULL));
#define EXPECT(status, kind, number, change)                                                                           \
    do {                                                                                                               \
        build(2002);                                                                                                   \
        change;                                                                                                        \
        TEST_ASSERT_EQUAL_INT(status, set_up(&dft, kind, frf_number_##number, &config));                               \
    } while (0)
#define EXPECT_QUARTER(number)                                                                                         \
    EXPECT(core_err_argument, kind_quarter, number, quarter.number.sine = NULL);                                       \
    EXPECT(core_err_frf_period, kind_quarter, number, quarter.number.quarter_steps++);                                 \
    EXPECT(core_err_frf_period, kind_quarter, number, quarter.number.sample_steps = 4);                                \
    EXPECT(core_err_frf_period, kind_quarter, number, quarter.number.period_samples = 2000);                           \
    EXPECT(core_ok, kind_quarter, number, (void)0)
#define EXPECT_TWO_LEVEL(number)                                                                                       \
    EXPECT(core_err_argument, kind_two_level, number, two_level.number.coarse = NULL);                                 \
    EXPECT(core_err_argument, kind_two_level, number, two_level.number.fine = NULL);                                   \
    EXPECT(core_err_frf_period, kind_two_level, number, two_level.number.group_bits++);                                \
    EXPECT(core_err_frf_period, kind_two_level, number, two_level.number.period_samples = 65537);                      \
    EXPECT(core_ok, kind_two_level, number, (void)0)
    EXPECT_QUARTER(q15);
    EXPECT_QUARTER(q23);
    EXPECT_QUARTER(q31);
    EXPECT_QUARTER(f32);
    EXPECT_TWO_LEVEL(q15);
    EXPECT_TWO_LEVEL(q23);
    EXPECT_TWO_LEVEL(q31);
    EXPECT_TWO_LEVEL(f32);
    config.bin_count = 0;
    for (int number = 0; number < number_count; number++) {
        TEST_ASSERT_EQUAL_INT(core_err_frf_bins, set_up(&dft, kind_full, (enum frf_number)number, &config));
        TEST_ASSERT_EQUAL_INT(core_err_frf_bins, set_up(&dft, kind_quarter, (enum frf_number)number, &config));
        TEST_ASSERT_EQUAL_INT(core_err_frf_bins, set_up(&dft, kind_two_level, (enum frf_number)number, &config));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_quarter_factors_are_the_full_tables);
    RUN_TEST(test_quarter_sums_are_the_full_tables_for_any_cut);
    RUN_TEST(test_two_level_factors_are_as_defined_and_within_bounds);
    RUN_TEST(test_two_level_factors_on_the_axes_are_not_beyond_one);
    RUN_TEST(test_two_level_sums_are_exact_for_worst_inputs);
    RUN_TEST(test_two_level_signal_to_noise_of_the_arithmetic);
    RUN_TEST(test_tables_refuse_what_cannot_work);
    return UNITY_END();
}
