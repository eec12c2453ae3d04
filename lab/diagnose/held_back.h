/* SPDX-License-Identifier: MIT */
/// The only run in two: what is fitted, and what is held back to judge by.
#ifndef SERVOSCOPE_DIAGNOSE_HELD_BACK_H
#define SERVOSCOPE_DIAGNOSE_HELD_BACK_H

#include "lab/record/run.h"

struct held_back {
    struct run fitted, judged; ///< columns borrow the run's values
    size_t from;               ///< row at which the judged part begins
    size_t first_row;          ///< from which on it counts: a period later where there are periods
};

/// Two thirds to fit, one third to judge by; by whole periods if there are at least six counted ones.
/// Errors: false if memory is short
bool held_back_split(const struct run *run, struct held_back *out_parts);
void held_back_free(struct held_back *self);

#endif
