/* SPDX-License-Identifier: MIT */
/// Whether runs can be diagnosed together.
#ifndef SERVOSCOPE_DIAGNOSE_ALIKE_H
#define SERVOSCOPE_DIAGNOSE_ALIKE_H

#include "lab/diagnose/recording.h"

/// Refuses a run whose rate, axis, input or reference is not that of the first one. Errors: error_refused.
int alike_check(const struct run *run, const struct recording *r, const struct run *first_run,
                const struct recording *first, struct error *out_error);

/// Gives a run the first one's rate if clocks and time stamps may differ by as much; true if that is worth saying.
bool alike_share_rate(const struct run *first, struct run *io_run);

#endif
