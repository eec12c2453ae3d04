/* SPDX-License-Identifier: MIT */
/// What a person may tell an estimation method beyond which columns, periods and lines to take.
#ifndef SERVOSCOPE_ESTIMATE_OPTIONS_H
#define SERVOSCOPE_ESTIMATE_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>

struct parametric_outcome;

enum {
    estimate_order_auto = -1, ///< 2, 4, ... until the variance stops falling
    estimate_order_max = 10,  ///< beyond it a polynomial follows noise
};

/// Zero-initialised options with order = estimate_order_auto are the defaults; a NULL pointer means the same.
struct estimate_options {
    int order;         ///< lpm: of the local polynomials, 0 .. estimate_order_max
    size_t half_width; ///< lpm: lines on each side; 0: as many as leave 9 degrees of freedom
    bool continuous;   ///< parametric: a model in s; else in 1/z, with the input held between samples
    bool held;         ///< parametric: the input is held, so that a model in s comes from one in 1/z without the hold
    bool delay_free;   ///< parametric: a delay is estimated too
    const char *model_path;                ///< parametric: the model is written there as JSON; NULL: it is not
    struct parametric_outcome *parametric; ///< parametric: the model is put there (parametric_frf.h); NULL: it is not
    size_t segment_samples; ///< recordings without a period: lines are 1/segment apart; 0: from the recording's length
};

#endif
