/* SPDX-License-Identifier: MIT */
/// Where a factor is in a quarter table; not for applications.
#ifndef SERVOSCOPE_FRF_QUARTER_H
#define SERVOSCOPE_FRF_QUARTER_H

#include "frf/twiddle.h"

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Of one angle. Table entry i stands for its sine, 0 <= i <= quarter, and quarter - i for its cosine. */
struct frf_quarter_place {
    uint32_t sine, cosine;
    bool minus_sine, minus_cosine;
};

/* With the second half folded onto the first and that about its middle; step below four quarters. */
static inline struct frf_quarter_place frf_find_quarter(uint32_t step, uint32_t quarter_steps)
{
    struct frf_quarter_place place;
    place.minus_sine = step >= 2u * quarter_steps;
    if (place.minus_sine) {
        step -= 2u * quarter_steps;
    }
    place.minus_cosine = place.minus_sine;
    if (step > quarter_steps) {
        step = 2u * quarter_steps - step;
        place.minus_cosine = !place.minus_sine;
    }
    place.sine = step;
    place.cosine = quarter_steps - step;
    return place;
}

/* Whether the numbers of a table belong to one another: a step too many is one outside of it. */
static inline bool frf_quarter_fits(uint32_t period, uint32_t quarter_steps, uint32_t sample_steps)
{
    return quarter_steps == FRF_QUARTER_STEPS(period) && sample_steps * period == 4u * quarter_steps;
}

#ifdef __cplusplus
}
#endif

#endif
