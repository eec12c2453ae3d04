/* SPDX-License-Identifier: MIT */
/// What is played under a multisine: a slow sinusoidal travel (stroke), so that the axis sees more of its range, and a
/// constant speed (bias velocity), so that it stays out of stiction and backlash on one side.
///
///     q(t) = multisine(t) + A sin(2 pi t / (P T)) + V t        T = N / rate, the period of the multisine
///
/// The stroke makes the table P periods long; its own line is bin 1, the multisine's lines become multiples of P, so
/// that no line of theirs meets it. An even P keeps the stroke's odd harmonics (friction that turns with it) off them
/// too. The bias velocity leaves the table's length alone: the player adds up V T in each period (msgen/player.h,
/// travel). Units as in design.h; with `linear` set rad is m and Nm is N.
///
/// Order of use: design_offset_reduce() into request.limits, design_run(), design_offset_add() with the full limits.
#ifndef SERVOSCOPE_DESIGN_OFFSET_H
#define SERVOSCOPE_DESIGN_OFFSET_H

#include "lab/design/design.h"

/// Zero-initialised: nothing is added.
struct design_offset {
    double stroke_rad;              ///< A >= 0; 0: no stroke
    size_t stroke_periods;          ///< P >= 2: periods of the multisine in one of the stroke; without a stroke 0 or 1
    double bias_velocity_rad_per_s; ///< V, either sign; 0: none
    /// Periods of the table that will be played, settling ones included: how far V goes. Needed where V meets a
    /// position limit.
    size_t played_periods;
};

/// Takes what the offset needs off the limits, so that |multisine| + |offset| stays within each of them.
///
/// Equation:  position      A + |V| (played_periods P T + fade)       both fades together: half of each is travelled
///            velocity      2 pi A / (P T) + |V|
///            acceleration  (2 pi / (P T))^2 A,   torque: inertia times that
///            fade = 0.375 P T / lowest bin (P without a stroke: 1), 0.05 s to 10 s: not less than what a measurement
///            fades by itself, 1.5 max|q| / max|v| (Bohr: max|q| <= T / (4 lowest bin) max|v| for a signal without
///            lower lines); lab/measure checks the travel again with the fade that it has
/// Errors:    error_usage: a value that is no number or out of range, a table above design_period_samples_max, a bias
///            velocity in torque mode, V with a position limit but without played_periods; error_refused: nothing is
///            left of a limit; with what the offset takes of it and what would be accepted. *out_limits is untouched
///            then
/// Test:      tests/unit/test_design_offset.c
int design_offset_reduce(const struct design_offset *self, const struct design_request *request,
                         struct design_limits *out_limits, struct error *out_error);

/// Adds the offset to a design: period, bins and series become those of the table that is played, the periodic part of
/// them; travel_per_period_rad is what the position gains beside it. peak is that of the sums at the samples,
/// peak_continuous the sum of the peaks, which nothing exceeds; the position's is without the travel. Effective values,
/// crest factor and bound stay the multisine's.
///
/// Start: in cascade mode the stroke passes its middle at start_index, in the direction of V: while the player fades
/// in, the set-point stays near the axis, and the speed that comes with the middle is small beside the multisine's
/// (tests/api/test_design_offset.c: less than a fifth of the transient of a stroke that begins where it turns). In
/// torque mode nothing would take up that speed: it is kept for good, so the stroke turns at start_index, where it has
/// none, on the side that opposes the multisine's acceleration.
///
/// Errors: error_usage as design_offset_reduce(); error_refused if memory is short; *io_result is untouched then
int design_offset_add(const struct design_offset *self, const struct design_request *request,
                      struct design_result *io_result, struct error *out_error);

#endif
