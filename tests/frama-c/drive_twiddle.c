/* SPDX-License-Identifier: MIT */
/* The integer DFTs of 24-bit samples and over quarter and two-level tables: any samples that the variant's width holds,
 * and any factors, coarse points too, that a table may hold. Of the fine turns what frf/two_level.h says is taken for
 * granted: below a tenth of their scale. Samples that 24 bits do not hold are all of a call's or none: that each is
 * found is the tests' to show. */
#include "tests/frama-c/any.h"

#include "frf/dft.h"

enum { quarter_period = 10, two_level_period = 66, bin_count = 2, channels = 2, words = FRF_STORAGE_WORDS(2u, 2u) };
enum { turn_max = 1717986918, turn_q15_max = 26214 };

static const uint32_t bins[bin_count] = {1, 3};
static union frf_word storage[words];
static int16_t samples[two_level_period * channels];
static int32_t samples_i24[two_level_period * channels];
static int16_t sines_q15[FRF_QUARTER_WORDS(10u)];
static int32_t sines_q23[FRF_TWIDDLE_WORDS(10u)], sines_q31[FRF_QUARTER_WORDS(10u)];
static struct frf_point coarse[FRF_COARSE_POINTS(66u)];
static struct frf_turn fine[FRF_FINE_TURNS(66u)];
static struct frf_turn_q15 fine_q15[FRF_FINE_TURNS(66u)];

static void feed(struct frf_dft *dft, uint32_t count, bool fits)
{
    if (dft->number == frf_number_q23) {
        for (uint32_t i = 0; i < two_level_period * channels; ++i) {
            samples_i24[i] =
                fits ? Frama_C_interval(FRF_I24_MIN, FRF_I24_MAX) : Frama_C_interval(FRF_I24_MAX + 1, INT32_MAX);
        }
        frf_dft_add_i24(dft, samples_i24, count);
    } else {
        for (uint32_t i = 0; i < two_level_period * channels; ++i) {
            samples[i] = any_i16_between(INT16_MIN, INT16_MAX);
        }
        frf_dft_add_i16(dft, samples, count);
    }
}

static void run(struct frf_dft *dft)
{
    static const uint32_t counts[3] = {3, 10, 66};
    struct frf_period latched;
    for (uint32_t call = 0; call < 3; ++call) {
        feed(dft, counts[call], true);
        //@ slevel merge;
    }
    feed(dft, 2, false);
    if (frf_dft_latest(dft, &latched)) {
        frf_period_real(dft, &latched, any_between(0, bin_count - 1), any_between(0, channels - 1));
        frf_period_imaginary(dft, &latched, any_between(0, bin_count - 1), any_between(0, channels - 1));
    }
}

static void fill(void)
{
    for (uint32_t i = 0; i < FRF_TWIDDLE_WORDS(10u); ++i) {
        sines_q23[i] = Frama_C_interval(-FRF_Q23_ONE, FRF_Q23_ONE);
    }
    for (uint32_t i = 0; i < FRF_QUARTER_WORDS(10u); ++i) {
        sines_q15[i] = any_i16_between(-FRF_Q15_ONE, FRF_Q15_ONE);
        sines_q31[i] = Frama_C_interval(-FRF_Q31_ONE, FRF_Q31_ONE);
    }
    for (uint32_t i = 0; i < FRF_COARSE_POINTS(66u); ++i) {
        coarse[i].cosine = any_i32();
        coarse[i].sine = any_i32();
    }
    for (uint32_t i = 0; i < FRF_FINE_TURNS(66u); ++i) {
        fine[i].less = Frama_C_interval(-turn_max, turn_max);
        fine[i].sine = Frama_C_interval(-turn_max, turn_max);
        fine_q15[i].less = any_i16_between(-turn_q15_max, turn_q15_max);
        fine_q15[i].sine = any_i16_between(-turn_q15_max, turn_q15_max);
    }
}

int main(void)
{
    const struct frf_dft_config config = {bins, bin_count, channels, storage, words, 0, 0};
    const struct frf_twiddles_q23 q23 = {sines_q23, sines_q23 + 10, quarter_period};
    const struct frf_quarter_q15 quarter_q15 = {sines_q15, quarter_period, FRF_QUARTER_STEPS(10u), 2};
    const struct frf_quarter_q23 quarter_q23 = {sines_q23, quarter_period, FRF_QUARTER_STEPS(10u), 2};
    const struct frf_quarter_q31 quarter_q31 = {sines_q31, quarter_period, FRF_QUARTER_STEPS(10u), 2};
    const struct frf_two_level_q15 two_level_q15 = {coarse, fine_q15, two_level_period, FRF_GROUP_BITS(66u)};
    const struct frf_two_level_q23 two_level_q23 = {coarse, fine, two_level_period, FRF_GROUP_BITS(66u)};
    const struct frf_two_level_q31 two_level_q31 = {coarse, fine, two_level_period, FRF_GROUP_BITS(66u)};
    struct frf_dft dft;
    fill();
    if (frf_dft_init_q23(&dft, &config, &q23) == core_ok) {
        run(&dft);
    }
    if (frf_dft_init_quarter_q15(&dft, &config, &quarter_q15) == core_ok) {
        run(&dft);
    }
    if (frf_dft_init_quarter_q23(&dft, &config, &quarter_q23) == core_ok) {
        run(&dft);
    }
    if (frf_dft_init_quarter_q31(&dft, &config, &quarter_q31) == core_ok) {
        run(&dft);
    }
    if (frf_dft_init_two_level_q15(&dft, &config, &two_level_q15) == core_ok) {
        run(&dft);
    }
    if (frf_dft_init_two_level_q23(&dft, &config, &two_level_q23) == core_ok) {
        run(&dft);
    }
    if (frf_dft_init_two_level_q31(&dft, &config, &two_level_q31) == core_ok) {
        run(&dft);
    }
    return 0;
}
