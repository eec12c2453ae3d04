/* SPDX-License-Identifier: MIT */
/// The inner loop of the block DFT; not for applications. Two implementations give the same bits.
#ifndef SERVOSCOPE_FRF_BLOCK_KERNEL_H
#define SERVOSCOPE_FRF_BLOCK_KERNEL_H

#include "core/config.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Rotates accumulators and adds a block's contribution, two rows at a time:
///
///     re <- re c - im s + R/16,    R = 8 + sum_i data[2i] a_i / 2
///     im <- re s + im c + I/16,    I = 8 + sum_i data[2i+1] b_i / 2
///
/// c, s, a, b are Q31. Every product is the upper word of a 64-bit one (of 2 re and 2 im in the rotation), rounded
/// (halves upwards) as it joins its sum; R/16 and I/16 are rounded down, so that with the 8 they too are rounded; all
/// sums are modulo 2^32. The block's own sum is kept finer than the accumulator, or its L roundings would be most of
/// the noise; the rotation has the accumulator's own grid, or it would be coarser than what is rotated, and a rotation
/// by nothing a leak.
/// Layout of two rows: for every two i a b a b of the first row, a b a b of the second; then c s | c s.
/// Shapes: accumulators 4 row_pairs words, |re|, |im| < 2^30; rows row_pairs (8 groups + 4) words; data 4 groups words;
///         row_pairs and groups at least 1
typedef void frf_block_kernel(int32_t *accumulators, const int32_t *rows, const int32_t *data, uint32_t row_pairs,
                              uint32_t groups);

/// Adds part of R of two rows to four sums, modulo 2^32; `first`: to 8. frf_block_end_sum() makes of them what
/// frf_block_accumulate makes of the whole with rotations of 0, to the last bit, the order of a sum not counting.
/// Shapes: sums 4 words, rows 8 groups words, data 4 groups words
typedef void frf_block_sum_kernel(int32_t *sums, const int32_t *rows, const int32_t *data, uint32_t groups, bool first);

/// R/16 of four sums.
void frf_block_end_sum(int32_t *sums);

frf_block_kernel frf_block_accumulate_portable;
frf_block_sum_kernel frf_block_sum_portable;
#if SERVOSCOPE_FRF_ARMV7EM
frf_block_kernel frf_block_accumulate_armv7em;
frf_block_sum_kernel frf_block_sum_armv7em;
#define FRF_BLOCK_ACCUMULATE frf_block_accumulate_armv7em
#define FRF_BLOCK_SUM        frf_block_sum_armv7em
#else
#define FRF_BLOCK_ACCUMULATE frf_block_accumulate_portable
#define FRF_BLOCK_SUM        frf_block_sum_portable
#endif

#ifdef __cplusplus
}
#endif

#endif
