/* SPDX-License-Identifier: MIT */
/// The exact sum with Q15 factors for cores whose multiplier gives 32 bits (Cortex-M0); not for applications. Two
/// products, 2 * 2^15 * (2^15 - 1) < 2^31, are added before they go into a sum of 64 bits, which costs such a core as
/// much as everything else; and one part at a time, because it has eight registers. Two implementations, same sums.
#ifndef SERVOSCOPE_FRF_DFT_BY_TWOS_H
#define SERVOSCOPE_FRF_DFT_BY_TWOS_H

#include "core/config.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Where in the table a bin is, how far it goes a sample, N, and samples per frame.
struct frf_walk {
    uint32_t index, step, period, stride;
};

/// Sum of 2 `pairs` samples, `stride` apart, times the table's entries; leaves the index after the last.
typedef int64_t frf_sum_by_twos(const int16_t *table, const int16_t *samples, struct frf_walk *io_walk, uint32_t pairs);

frf_sum_by_twos frf_sum_by_twos_portable;
#if SERVOSCOPE_FRF_ARMV6M
frf_sum_by_twos frf_sum_by_twos_armv6m;
#define FRF_SUM_BY_TWOS frf_sum_by_twos_armv6m
#else
#define FRF_SUM_BY_TWOS frf_sum_by_twos_portable
#endif

#ifdef __cplusplus
}
#endif

#endif
