/* SPDX-License-Identifier: MIT */
/// Coefficients of the block DFT: const data (in flash, made on the host) or built at start-up by frf_block_build().
///
/// A block of L samples is folded about its centre into L/2 sums and L/2 differences, because
///
///     sum_n x[n] exp(-j w (n - (L-1)/2)) = sum_i s_i cos(w (i + 1/2)) - j sum_i d_i sin(w (i + 1/2)),
///     s_i, d_i = x[L/2 + i] +- x[L/2 - 1 - i]
///
/// so each line costs L real products a block. Lines that are low against 1/L look alike within a block: then the
/// sums and differences are projected once on a few functions that all lines share, and a line costs R products.
///
/// Lines that are all multiples of Q do not tell the Qth parts of a period apart: the parts are added up first, and
/// only N/Q samples cost products. If the lines are all odd multiples of Q/2, every other part is subtracted (odd
/// lines: Q = 2). That takes N/Q words of RAM per channel.
#ifndef SERVOSCOPE_FRF_BLOCK_TABLE_H
#define SERVOSCOPE_FRF_BLOCK_TABLE_H

#include "core/config.h"
#include "core/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define FRF_BLOCK_SAMPLES_MAX 128u ///< largest L

/// Terms of a line and block: L without a shared basis, else R.
struct frf_block_layout {
    uint32_t block_samples; ///< L: a multiple of 4 from 8 to FRF_BLOCK_SAMPLES_MAX, at most N; 0: the exact table
    uint32_t terms;         ///< R: a multiple of 4 from 4 to L; L: no shared basis
    uint32_t repeats;       ///< Q: the period is folded into N/Q samples first (below); 0 or 1: it is not
};

/// Rows of coefficients and of accumulators for K bins: they go in twos.
#define FRF_BLOCK_ROWS(bins) (((bins) + 1u) / 2u * 2u)
/// Words of int32_t for the coefficients. Arguments are evaluated more than once.
#define FRF_BLOCK_TABLE_WORDS(bins, L, terms)                                                                          \
    (FRF_BLOCK_ROWS(bins) * (2u + (terms)) + 2u * (bins) + ((terms) == (L) ? 0u : (terms) / 2u * (2u + (L))))
CORE_STATIC_ASSERT(FRF_BLOCK_TABLE_WORDS(200u, 32u, 32u) * 4u == 200u * (136u + 8u), table_of_200_bins);

/// Read-only for the application.
struct frf_block_table {
    const int32_t *rows;    ///< of each two bins: factors, then rotations over a block (frf/block_kernel.h)
    const int32_t *restore; ///< of each bin: cosine and sine that turn the last block's phase back to n = 0, Q31
    const int32_t *basis;   ///< R/2 rows of the shared basis in the same form; null without
    const uint32_t *bins;   ///< of the K bins
    uint32_t bin_count, period_samples;
    uint32_t part_samples; ///< N/Q
    uint32_t lead_samples; ///< zeros in front of the first block; as many, or one more, end the last
    bool alternate;        ///< every other part of the period is subtracted
    struct frf_block_layout layout;
    uint32_t gain_shift; ///< accumulators are 2^(gain_shift - 1) times the sum: as large as any samples allow
};

/// Picks the cheapest layout for the lines on this target: a shared basis where the highest bin is low enough and the
/// bins are many enough to share it, else blocks of 32 folded; block_samples 0 (use frf/dft.h) where the period is
/// shorter than two blocks or the core has no long multiply. The period is folded if the lines allow it and N/Q is at
/// most `part_samples_max`; 0: it is not.
/// Range: by the instructions per sample, bin and channel that ./run bench firmware-dft counts
void frf_block_choose(const uint32_t *bins, uint32_t bin_count, uint32_t period_samples, uint32_t part_samples_max,
                      struct frf_block_layout *out_layout);

/// Builds the coefficients in `storage` of FRF_BLOCK_TABLE_WORDS(bin_count, L, terms) words. Uses math.h (sin, double);
/// not for an interrupt.
/// Accuracy: without a basis every factor is correctly rounded; with one, what R functions do not hold of a line is at
///           most 1e-4 of it (RMS over a block), else core_err_frf_block; what comes through of other lines in the
///           basis is the square of that, of anything above them up to -77 dB
/// Cost:     about K L sines; with a basis 6 K L R operations in double on top (200 bins, L = 64, R = 24: 1.8 million)
///           and R L 60 for the basis; stack about 4 KiB
/// Errors:   core_err_argument (null), core_err_frf_period, core_err_frf_bins, core_err_frf_block, core_err_storage;
///           out_table is untouched then, storage is not
/// Lifetime: storage and bins must outlive out_table
/// Test:     tests/unit/test_frf_block.c
enum core_status frf_block_build(int32_t *storage, uint32_t words, const uint32_t *bins, uint32_t bin_count,
                                 uint32_t period_samples, const struct frf_block_layout *layout,
                                 struct frf_block_table *out_table);

#ifdef __cplusplus
}
#endif

#endif
