/* SPDX-License-Identifier: MIT */
/// What another thread may see of a measurement while it runs. The loop stores, at most twice a sample and without
/// ever waiting; a reader takes what is there.
#ifndef SERVOSCOPE_MEASURE_LIVE_H
#define SERVOSCOPE_MEASURE_LIVE_H

#include "drivers/drive.h"

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

/// One writer, the loop; one reader. Zero-initialise, then measure_live_alloc().
struct measure_live {
    size_t period_samples;
    /// Two periods each: period p is written to half p % 2, so that the last whole one stands still for the length of
    /// the next.
    _Atomic float *torque_Nm, *velocity_rad_per_s;
    atomic_size_t done, total; ///< samples played, and what a complete measurement plays, fades included
    atomic_size_t rows, lost;  ///< kept, and lost among them
    atomic_uint late;
    _Atomic float torque_peak_Nm, velocity_peak_rad_per_s, position_low_rad, position_high_rad; ///< fades included
    bool period_is_whole;     ///< the loop's own: no sample of this period was lost so far
    atomic_size_t last_whole; ///< number of the last period that came whole, from 1; 0: there is none
};

/// Errors: false if memory is short; nothing to free then
bool measure_live_alloc(struct measure_live *out_self, size_t period_samples);

void measure_live_free(struct measure_live *self);

/// Takes a sample that was played; `kept`: it is a row of the run. Allocates nothing and waits for nobody.
void measure_live_add(struct measure_live *self, const struct drive_sample *sample, bool kept, uint32_t late);

/// Copies the last period that came whole. Shapes: out_torque, out_velocity: period_samples
/// Returns its number, from 1; 0: there is none, or the loop is too fast to be copied from.
size_t measure_live_read_period(struct measure_live *self, double *out_torque, double *out_velocity);

#endif
