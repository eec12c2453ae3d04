/* SPDX-License-Identifier: MIT */
/// What the main loop makes of the DFT's periods: the frequency response from torque to velocity with its standard
/// deviation. It reads the bank that the interrupt is not filling, and drops what was overwritten meanwhile.
#ifndef SERVOSCOPE_FIRMWARE_RESULTS_H
#define SERVOSCOPE_FIRMWARE_RESULTS_H

#include "frf/block.h"
#include "frf/statistics.h"

enum { results_bins_max = 64 };

struct results {
    struct frf_statistics statistics;
    struct frf_pair pairs[results_bins_max];
    struct frf_complex input[results_bins_max], output[results_bins_max];
    core_real input_unit, output_unit; ///< Nm and rad/s of a line of amplitude 1: per sum as it is kept here
    uint32_t sequence;                 ///< of the last period looked at
    uint32_t overwritten, invalid;     ///< periods left out
    uint32_t checksum[2];              ///< over all sums of all periods that count
};

/// input_per_count, output_per_count: units of a converter's count.
/// Errors: core_err_storage: more than results_bins_max bins
enum core_status results_init(struct results *self, const struct frf_block_table *table, core_real input_per_count,
                              core_real output_per_count);

/// Takes the last completed period if it has not been taken yet; input and output are channels of the DFT. Returns
/// whether it counts.
bool results_take(struct results *self, const struct frf_block *dft, uint32_t input, uint32_t output);

/// rad/s per Nm at a bin.
void results_estimate(const struct results *self, uint32_t bin, struct frf_estimate *out_estimate);

#endif
