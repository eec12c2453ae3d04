/* SPDX-License-Identifier: MIT */
/// A run without a period: which columns, and which rows can be used. Every method for arbitrary signals starts here.
#ifndef SERVOSCOPE_ESTIMATE_ARBITRARY_H
#define SERVOSCOPE_ESTIMATE_ARBITRARY_H

#include "lab/record/error.h"
#include "lab/record/run.h"

#include <stddef.h>

struct arbitrary_options {
    const char *input;     ///< columns; NULL: columns_choose says which
    const char *output;    ///<
    const char *reference; ///<
    size_t first_row;      ///< rows left out at the start
};

struct arbitrary {
    const struct run *run; ///< borrowed
    const char *input;     ///< column names, owned by the run
    const char *output;
    const char *reference; ///< NULL: none
    size_t start;          ///< first row that may be used, from 0
    size_t first;          ///< first row, from 0, of the longest stretch without a lost sample
    size_t rows;           ///< of that stretch
    size_t lost;           ///< rows with valid = 0, anywhere
    size_t first_lost_row; ///< of those, counted from 1; 0: none
};

/// Chooses columns and the longest stretch without lost samples.
/// Errors: error_refused: no such column, numbers that are not finite, an output that stands still, an input or a
///         reference that is a straight line but for rounding, fewer than arbitrary_fewest_rows rows in one piece
/// Lifetime: `run` must outlive *out_self; nothing needs to be freed
/// Test:   tests/fault/test_frf_refusals.c
int arbitrary_cut(const struct run *run, const struct arbitrary_options *options, struct arbitrary *out_self,
                  struct error *out_error);

enum { arbitrary_fewest_rows = 64 };

#endif
