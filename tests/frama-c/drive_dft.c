/* SPDX-License-Identifier: MIT */
/* The integer DFTs over any samples, cuts, gaps and marks, with any factors that a table may hold. */
#include "tests/frama-c/any.h"

#include "frf/dft.h"

enum { period = 8, bin_count = 2, channels = 2, words = FRF_STORAGE_WORDS(2u, 2u) };

static const uint32_t bins[bin_count] = {1, 3};
static int16_t factors_q15[FRF_TWIDDLE_WORDS(8u)];
static int32_t factors_q31[FRF_TWIDDLE_WORDS(8u)];
static union frf_word storage[words];
static int16_t samples[2 * period * channels];

/* Cuts, gaps and periods are numbers, so that Eva follows them one by one; factors, marks and samples are any. What one
 * call leaves is joined before the next, or every sample at a rail or not would double what Eva has to follow. */
static void run(struct frf_dft *dft)
{
    static const uint32_t counts[4] = {3, period, 1, period + 5}, gaps[4] = {0, 2, 0, 7};
    struct frf_period latched;
    for (uint32_t call = 0; call < 4; ++call) {
        for (uint32_t i = 0; i < 2u * period * channels; ++i) {
            samples[i] = any_i16_between(INT16_MIN, INT16_MAX);
        }
        frf_dft_add_i16(dft, samples, counts[call]);
        frf_dft_skip(dft, gaps[call]);
        frf_dft_mark(dft, any_u32());
        if (frf_dft_latest(dft, &latched)) {
            frf_period_real(dft, &latched, any_between(0, bin_count - 1), any_between(0, channels - 1));
            frf_period_imaginary(dft, &latched, any_between(0, bin_count - 1), any_between(0, channels - 1));
        }
        //@ slevel merge;
    }
    frf_dft_restart(dft);
}

int main(void)
{
    const struct frf_twiddles_q15 q15 = {factors_q15, factors_q15 + 2, period};
    const struct frf_twiddles_q31 q31 = {factors_q31, factors_q31 + 2, period};
    struct frf_dft_config config = {bins, bin_count, channels, storage, words, -32768, 32767};
    struct frf_dft dft;
    for (uint32_t i = 0; i < FRF_TWIDDLE_WORDS(8u); ++i) {
        factors_q15[i] = any_i16_between(-FRF_Q15_ONE, FRF_Q15_ONE);
        factors_q31[i] = any_i32();
    }
    if (frf_dft_init_q15(&dft, &config, &q15) == core_ok) {
        run(&dft);
    }
    if (frf_dft_init_q31(&dft, &config, &q31) == core_ok) {
        run(&dft);
    }
    return 0;
}
