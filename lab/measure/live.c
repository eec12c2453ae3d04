/* SPDX-License-Identifier: MIT */
#include "lab/measure/live.h"

#include <math.h>
#include <stdlib.h>

enum { read_attempts = 4 };

bool measure_live_alloc(struct measure_live *out_self, size_t period_samples)
{
    const size_t bytes = 2 * period_samples * sizeof *out_self->torque_Nm;
    *out_self = (struct measure_live){.period_samples = period_samples, .period_is_whole = true};
    out_self->torque_Nm = malloc(bytes);
    out_self->velocity_rad_per_s = malloc(bytes);
    if (!out_self->torque_Nm || !out_self->velocity_rad_per_s) {
        measure_live_free(out_self);
        return false;
    }
    for (size_t n = 0; n < 2 * period_samples; n++) {
        atomic_init(&out_self->torque_Nm[n], 0.0f);
        atomic_init(&out_self->velocity_rad_per_s[n], 0.0f);
    }
    return true;
}

void measure_live_free(struct measure_live *self)
{
    free((void *)self->torque_Nm);
    free((void *)self->velocity_rad_per_s);
    self->torque_Nm = NULL;
    self->velocity_rad_per_s = NULL;
}

/// The loop alone writes, so that a look before the store is no race.
static void raise(_Atomic float *io_peak, double value)
{
    if (value > (double)atomic_load_explicit(io_peak, memory_order_relaxed)) {
        atomic_store_explicit(io_peak, (float)value, memory_order_relaxed);
    }
}

static void keep(struct measure_live *self, const struct drive_sample *sample)
{
    const size_t row = atomic_load_explicit(&self->rows, memory_order_relaxed);
    const size_t period = row / self->period_samples;
    const size_t at = row % (2 * self->period_samples);
    atomic_store_explicit(&self->torque_Nm[at], (float)sample->torque_Nm, memory_order_release);
    atomic_store_explicit(&self->velocity_rad_per_s[at], (float)sample->velocity_rad_per_s, memory_order_release);
    if (!sample->valid) {
        self->period_is_whole = false;
        atomic_fetch_add_explicit(&self->lost, 1, memory_order_relaxed);
    }
    if ((row + 1) % self->period_samples == 0) {
        if (self->period_is_whole) {
            atomic_store_explicit(&self->last_whole, period + 1, memory_order_release);
        }
        self->period_is_whole = true;
    }
    atomic_store_explicit(&self->rows, row + 1, memory_order_release);
}

void measure_live_add(struct measure_live *self, const struct drive_sample *sample, bool kept, uint32_t late)
{
    if (sample->valid) {
        raise(&self->torque_peak_Nm, fabs(sample->torque_Nm));
        raise(&self->velocity_peak_rad_per_s, fabs(sample->velocity_rad_per_s));
        raise(&self->position_high_rad, sample->position_rad);
        if (sample->position_rad < (double)atomic_load_explicit(&self->position_low_rad, memory_order_relaxed)) {
            atomic_store_explicit(&self->position_low_rad, (float)sample->position_rad, memory_order_relaxed);
        }
    }
    atomic_store_explicit(&self->late, late, memory_order_relaxed);
    if (kept) {
        keep(self, sample);
    }
    atomic_fetch_add_explicit(&self->done, 1, memory_order_relaxed);
}

size_t measure_live_read_period(struct measure_live *self, double *out_torque, double *out_velocity)
{
    for (int attempt = 0; attempt < read_attempts; attempt++) {
        const size_t number = atomic_load_explicit(&self->last_whole, memory_order_acquire);
        if (number == 0) {
            return 0;
        }
        const size_t offset = (number - 1) % 2 * self->period_samples;
        for (size_t n = 0; n < self->period_samples; n++) {
            out_torque[n] = (double)atomic_load_explicit(&self->torque_Nm[offset + n], memory_order_acquire);
            out_velocity[n] = (double)atomic_load_explicit(&self->velocity_rad_per_s[offset + n], memory_order_acquire);
        }
        // The loop comes back to this half when it keeps the first row of the next period but one.
        if (atomic_load_explicit(&self->rows, memory_order_acquire) < (number + 1) * self->period_samples) {
            return number;
        }
    }
    return 0;
}
