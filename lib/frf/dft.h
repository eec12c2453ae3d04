/* SPDX-License-Identifier: MIT */
/// Fourier coefficients at the excited bins, period after period, while the samples arrive.
///
///     Y_k = sum_{n=0}^{N-1} y[n] exp(-j 2 pi k n / N)
///
/// The angle of every product is looked up exactly (index k n mod N), nothing is rotated or recursed: no drift, no
/// loss at low bins, no dependence on how the samples are cut into chunks. The integer variants are exact sums of
/// integers, bit-identical on every machine:
///
///     variant  samples, factors, accumulator  arithmetic alone, worst bin, N = 2000 / 16384 / 65536
///     q15      i16, i16, i64                  >= 100 / 108 / 115 dB
///     q31      i16, i32, i64                  >= 190 / 200 / 205 dB
///     q23      24 bits, 24 bits, i64          >= 141 / 156 / 163 dB
///     f32      float, float, float            >= 125 / 118 / 115 dB   (partial sums of SERVOSCOPE_FRF_BLOCK samples)
///
/// (tests/unit/test_frf_dft.c and test_frf_i24.c print and check them.) The factors come from a full table, or from a
/// shorter one that takes more time (frf/twiddle.h): a quarter, with the same sums, or two levels. Cost: 2 K C
/// multiply-accumulates a sample for K bins and C channels; the channels share the table look-up. Feed blocks rather
/// than single samples: a block keeps a bin's sums in registers. On cores with a long multiply frf/block.h is six to
/// thirty times cheaper, at 100 dB.
///
/// One writer (the interrupt) feeds; at the end of a period the sums are latched by switching between two banks,
/// without a copy; one reader has a whole period's time to read the last bank and asks afterwards whether it was in
/// time. No locks.
#ifndef SERVOSCOPE_FRF_DFT_H
#define SERVOSCOPE_FRF_DFT_H

#include "core/config.h"
#include "core/status.h"
#include "frf/twiddle.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Why a period does not count; bits, several may hold. 0 is a valid period.
enum frf_reason {
    frf_reason_gap = 1,         ///< samples were lost
    frf_reason_saturated = 2,   ///< a sample reached a rail of its converter
    frf_reason_late = 4,        ///< the sample path was late: the samples are not equally spaced
    frf_reason_application = 8, ///< marked by the application: fading, aborting, tripped, settling
    frf_reason_wrong_type = 16, ///< samples of another type than the DFT's
    frf_reason_not_finite = 32, ///< a float sample was infinite or NaN
    frf_reason_count = 6
};

/// One word of storage; which member is in use is the object's business.
union frf_word {
    int64_t sum;   ///< integer variants: one accumulator
    float pair[2]; ///< f32: real and imaginary
    struct {
        uint16_t step, index; ///< k and k n mod N
    } bins[2];
};
CORE_STATIC_ASSERT(sizeof(union frf_word) == 8, storage_word_is_8_bytes);

/// Words of storage for K bins and C channels: a step and an index per bin, and per bin and channel two banks of a
/// real and an imaginary accumulator (of the float variant: two banks of a pair, and a pair of partial sums).
/// Arguments are evaluated more than once.
#define FRF_STORAGE_WORDS(bins, channels) (((bins) + 1u) / 2u + 4u * (bins) * (channels))
CORE_STATIC_ASSERT(FRF_STORAGE_WORDS(1u, 1u) == 5u, storage_of_one_bin);
CORE_STATIC_ASSERT(FRF_STORAGE_WORDS(64u, 3u) * 8u == 64u * 4u + 64u * 3u * 2u * 2u * 8u, storage_of_64_bins);

enum frf_number { frf_number_q15, frf_number_q31, frf_number_f32, frf_number_q23 };

#define FRF_I24_MIN (-8388608)
#define FRF_I24_MAX 8388607

struct frf_dft;
/// Adds `count` frames, all in one period; `fresh`: they begin a period, the old sums do not matter.
typedef void frf_kernel(struct frf_dft *self, const void *frames, uint32_t count, bool fresh);

/// What the two ends need to agree on. bins and storage must outlive the object.
struct frf_dft_config {
    const uint32_t *bins;    ///< strictly ascending from 1, below N/2
    uint32_t bin_count;      ///< 1 .. SERVOSCOPE_FRF_BINS_MAX
    uint32_t channels;       ///< 1 .. SERVOSCOPE_FRF_CHANNELS_MAX
    union frf_word *storage; ///< FRF_STORAGE_WORDS(bin_count, channels) words, not initialised
    uint32_t storage_words;
    int32_t rail_low, rail_high; ///< integer samples at or beyond count as saturated; both 0: the ends of 16 or 24 bits
};

/// Read-only for the application.
struct frf_dft {
    union frf_word *bins;     ///< steps and indices
    union frf_word *banks[2]; ///< accumulators
    union frf_word *partial;  ///< f32 only
    frf_kernel *kernel;
    union {
        struct frf_twiddles_q15 q15;
        struct frf_twiddles_q23 q23;
        struct frf_twiddles_q31 q31;
        struct frf_twiddles_f32 f32;
        struct frf_quarter_q15 quarter_q15;
        struct frf_quarter_q23 quarter_q23;
        struct frf_quarter_q31 quarter_q31;
        struct frf_quarter_f32 quarter_f32;
        struct frf_two_level_q15 two_level_q15;
        struct frf_two_level_q23 two_level_q23;
        struct frf_two_level_q31 two_level_q31;
        struct frf_two_level_f32 two_level_f32;
    } twiddles;
    enum frf_number number;
    uint32_t period_samples, bin_count, channels;
    int32_t rail_low, rail_high;
    uint32_t position;           ///< n of the next sample, 0 .. N-1
    volatile uint32_t sequence;  ///< periods completed; its last bit is the bank being filled
    uint32_t reasons;            ///< of the period being filled
    uint32_t latched_reasons[2]; ///< by bank
    struct {
        uint32_t lost;       ///< samples skipped over
        uint32_t saturated;  ///< samples at a rail, each channel counted
        uint32_t late;       ///< calls of frf_dft_mark() with frf_reason_late
        uint32_t not_finite; ///< float samples that were not numbers
        uint32_t wrong_type; ///< calls with the wrong kind of samples
    } err;
};

/// Sets up a DFT with the arithmetic of its twiddle table, at n = 0 of its first period.
/// Range:    |sum| <= 2^15 (2^31 - 1) 2^16 < 2^62 for q31, 2^23 (2^23 - 1) 2^16 < 2^62 for q23, < 2^46 for q15: no
///           overflow for any samples
/// Errors:   core_err_argument, core_err_storage, core_err_frf_period, _bins, _channels, _rails; self untouched then
/// Lifetime: storage and the table must outlive self; config and config->bins only during the call
/// Test:     tests/unit/test_frf_dft.c, test_frf_i24.c
enum core_status frf_dft_init_q15(struct frf_dft *self, const struct frf_dft_config *config,
                                  const struct frf_twiddles_q15 *twiddles);
enum core_status frf_dft_init_q23(struct frf_dft *self, const struct frf_dft_config *config,
                                  const struct frf_twiddles_q23 *twiddles);
enum core_status frf_dft_init_q31(struct frf_dft *self, const struct frf_dft_config *config,
                                  const struct frf_twiddles_q31 *twiddles);
enum core_status frf_dft_init_f32(struct frf_dft *self, const struct frf_dft_config *config,
                                  const struct frf_twiddles_f32 *twiddles);

/// The same over a quarter of a period: every sum is the full table's, to the last bit.
/// Test: tests/unit/test_frf_twiddle.c
enum core_status frf_dft_init_quarter_q15(struct frf_dft *self, const struct frf_dft_config *config,
                                          const struct frf_quarter_q15 *quarter);
enum core_status frf_dft_init_quarter_q23(struct frf_dft *self, const struct frf_dft_config *config,
                                          const struct frf_quarter_q23 *quarter);
enum core_status frf_dft_init_quarter_q31(struct frf_dft *self, const struct frf_dft_config *config,
                                          const struct frf_quarter_q31 *quarter);
enum core_status frf_dft_init_quarter_f32(struct frf_dft *self, const struct frf_dft_config *config,
                                          const struct frf_quarter_f32 *quarter);

/// The same over a two-level table. Sums are exact sums of integers still, the same on every machine; the factors are
/// others than the full table's, by no more than frf/twiddle.h says.
/// Accuracy: arithmetic alone, worst bin, N = 2000 / 16384 / 65536: q15, q23 and f32 as from the full table, q31
///           >= 183 / 186 / 189 dB
/// Test:     tests/unit/test_frf_twiddle.c
enum core_status frf_dft_init_two_level_q15(struct frf_dft *self, const struct frf_dft_config *config,
                                            const struct frf_two_level_q15 *table);
enum core_status frf_dft_init_two_level_q23(struct frf_dft *self, const struct frf_dft_config *config,
                                            const struct frf_two_level_q23 *table);
enum core_status frf_dft_init_two_level_q31(struct frf_dft *self, const struct frf_dft_config *config,
                                            const struct frf_two_level_q31 *table);
enum core_status frf_dft_init_two_level_f32(struct frf_dft *self, const struct frf_dft_config *config,
                                            const struct frf_two_level_f32 *table);

/// Adds `count` frames of `channels` samples each to a q15 or q31 variant; any count, any cut. Latches at each end of a
/// period.
/// Exactness: integer variants exact; f32 independent of the cut as well (the partial sums are kept between calls)
/// Errors:    none; saturated samples are added, counted, and make the period invalid
/// Cost:      2 K C multiply-accumulates a frame; interrupt-safe, one caller per object
void frf_dft_add_i16(struct frf_dft *self, const int16_t *frames, uint32_t count);

/// The same for the q23 variant: samples of 24 bits, sign extended. A frame with a sample that 24 bits do not hold
/// counts as saturated, and as zeros.
void frf_dft_add_i24(struct frf_dft *self, const int32_t *frames, uint32_t count);

/// The same for the f32 variant. A frame with a sample that is not finite counts as zeros and makes the period invalid.
void frf_dft_add_f32(struct frf_dft *self, const float *frames, uint32_t count);

/// Passes over `count` lost frames: phase stays true, the periods touched are marked with frf_reason_gap.
/// Cost: one remainder per bin, one latch per period passed. Call it where samples are added.
void frf_dft_skip(struct frf_dft *self, uint32_t count);

/// Marks the period being filled with the bits of enum frf_reason. Call it where samples are added.
void frf_dft_mark(struct frf_dft *self, uint32_t reasons);

/// Starts over at n = 0, dropping the period being filled; periods latched and counters stay.
void frf_dft_restart(struct frf_dft *self);

/// A latched period. Its sums stay true until the following period ends; frf_dft_is_intact() says whether they still
/// are.
struct frf_period {
    const union frf_word *sums;
    uint32_t sequence; ///< 1 for the first period
    uint32_t reasons;  ///< 0: valid
};

/// The last completed period; false if there is none yet. For the reader's side, interrupted by the writer or not.
bool frf_dft_latest(const struct frf_dft *self, struct frf_period *out_period);

/// Whether what was read from the period since frf_dft_latest() can be trusted: no further period has ended since.
bool frf_dft_is_intact(const struct frf_dft *self, const struct frf_period *period);

/// Accumulators of an integer variant: sum of y[n] w(k n mod N), w the table's cosine and minus its sine, not scaled.
int64_t frf_period_real(const struct frf_dft *self, const struct frf_period *period, uint32_t bin, uint32_t channel);
int64_t frf_period_imaginary(const struct frf_dft *self, const struct frf_period *period, uint32_t bin,
                             uint32_t channel);

#ifdef __cplusplus
}
#endif

#endif
