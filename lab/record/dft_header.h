/* SPDX-License-Identifier: MIT */
/// The const tables of a DFT at the excited bins as a C header, so that a firmware calculates nothing at start-up.
#ifndef SERVOSCOPE_RECORD_DFT_HEADER_H
#define SERVOSCOPE_RECORD_DFT_HEADER_H

#include "lab/record/error.h"

#include <stdint.h>

/// What goes into the header, beside the bins; any of them together.
enum dft_header_kind {
    dft_header_block = 1,  ///< coefficients of the block DFT (frf/block_table.h), in the layout that costs least
    dft_header_folded = 2, ///< instead, with the period folded where the lines allow it
    dft_header_q15 = 4,    ///< sines of the exact DFT (frf/twiddle.h), of a whole period
    dft_header_q23 = 8,
    dft_header_q31 = 16,
    dft_header_quarter_q15 = 32, ///< of a quarter
    dft_header_quarter_q23 = 64,
    dft_header_quarter_q31 = 128
};

/// Reads "block,q15": kinds with commas between them; `name` is for messages.
/// Errors: error_usage with name, text and what can be said
int dft_header_parse(const char *name, const char *text, unsigned *out_kinds, struct error *out_error);

/// Writes the header; C99 and C++, names are made of the file's name.
/// Errors: error_refused with the path and the reason: a period that the kind cannot have, a file that cannot be
///         written; `path` is as it was then
/// Test:   tests/cli/dft_header.sh
int dft_header_write(const char *path, const uint32_t *bins, uint32_t bin_count, uint32_t period_samples,
                     unsigned kinds, struct error *out_error);

#endif
