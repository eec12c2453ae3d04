/* SPDX-License-Identifier: MIT */
/// What a response is a response of: with or without the hold, the actuator and a known delay. The numbers alone do not
/// tell, and a controller that is designed on the wrong one is wrong by their phase.
#ifndef SERVOSCOPE_ESTIMATE_SETUP_H
#define SERVOSCOPE_ESTIMATE_SETUP_H

#include "lab/record/error.h"
#include "lab/record/frf_file.h"

#include <stdbool.h>

/// What the input does between two samples.
enum setup_hold {
    setup_zoh,          ///< stays as it is: the response has the hold's half sample of delay, and is one in 1/z
    setup_band_limited, ///< moves on, and is measured behind an anti-alias filter: the response is one in s
};

/// Names as given to --hold and in the key `hold`: "zoh", "band-limited".
const char *setup_hold_str(enum setup_hold hold);

/// Errors: error_usage with what is expected
int setup_hold_parse(const char *text, enum setup_hold *out_hold, struct error *out_error);

/// Whether the actuator (current loop, lag and saturation of the torque) is part of a response from this input column:
/// "included" (torque_ref_Nm and other set-points, voltage_V), "not included" (torque_Nm, force_N, current_A, which are
/// measured behind it), "unknown" for any other column.
const char *setup_actuator(const char *input);

/// Takes a known delay out of a response.
/// Equation: G(f) exp(+j 2 pi f delay_s); standard deviations and levels stay
/// Range:    delay_s finite
void setup_remove_delay(struct frf *io_frf, double delay_s);

/// Adds the keys `hold`, `actuator` and, if a delay was removed, `delay_removed_s`. Errors: false if memory is short.
bool setup_set_keys(struct frf *io_frf, enum setup_hold hold, double delay_s);

#endif
