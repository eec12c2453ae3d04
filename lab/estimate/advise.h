/* SPDX-License-Identifier: MIT */
/// Which method suits a recording, and why: what a person reads beside every response.
#ifndef SERVOSCOPE_ESTIMATE_ADVISE_H
#define SERVOSCOPE_ESTIMATE_ADVISE_H

#include "lab/estimate/arbitrary.h"
#include "lab/estimate/periodic.h"

struct estimate_advice {
    const char *method; ///< a name for --method
    char sentence[800];
};

/// Judges whole periods.
/// mean:  settled, at least 5 periods: unbiased in a closed loop too, a standard deviation from every line's own
/// scatter lpm:   a transient that would cost periods, or fewer than 5 periods, with 2 or more of them in a row
/// Test:  tests/unit/test_advise.c
void estimate_advise(const struct periodic *recording, struct estimate_advice *out_advice);

/// Judges a recording without a period: indirect where a set-point of speed or position shows that a loop is closed,
/// else lpm.
void estimate_advise_arbitrary(const struct arbitrary *recording, struct estimate_advice *out_advice);

#endif
