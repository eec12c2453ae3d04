/* SPDX-License-Identifier: MIT */
/// The inner loop of the block DFT; not for applications. Two implementations give the same bits.
#ifndef SERVOSCOPE_FRF_BLOCK_KERNEL_H
#define SERVOSCOPE_FRF_BLOCK_KERNEL_H

#include "core/config.h"

#include <stdint.h>

/// Rotates accumulators and adds a block's contribution, two rows at a time:
///
///     re <- 2 (re c - im s) + sum_i data[2i] a_i,    im <- 2 (re s + im c) + sum_i data[2i+1] b_i
///
/// where every product is the upper word of a 64-bit one, rounded (halves upwards) as it joins its sum, and all sums
/// are modulo 2^32. c, s, a, b are Q31, so a product is half of what its factors say: the rotation's two are doubled.
/// Layout of two rows: c s | c s, then for every two i: a b a b of the first row, a b a b of the second.
/// Shapes: accumulators 4 row_pairs words; rows row_pairs (4 + 8 groups) words; data 4 groups words; all at least 1
typedef void frf_block_kernel(int32_t *accumulators, const int32_t *rows, const int32_t *data, uint32_t row_pairs,
                              uint32_t groups);

frf_block_kernel frf_block_accumulate_portable;
#if SERVOSCOPE_FRF_ARMV7EM
frf_block_kernel frf_block_accumulate_armv7em;
#define FRF_BLOCK_ACCUMULATE frf_block_accumulate_armv7em
#else
#define FRF_BLOCK_ACCUMULATE frf_block_accumulate_portable
#endif

#endif
