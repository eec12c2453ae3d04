/* SPDX-License-Identifier: MIT */
/// What the files of lib/frf share; not for applications.
#ifndef SERVOSCOPE_FRF_KERNEL_H
#define SERVOSCOPE_FRF_KERNEL_H

#include "frf/dft.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Whether there are bins, not too many, strictly ascending from 1 and below half the period; else core_err_frf_bins.
enum core_status frf_check_bins(const uint32_t *bins, uint32_t bin_count, uint32_t period);

/// Checks the configuration and sets up everything but the table; self is untouched on error.
enum core_status frf_dft_set_up(struct frf_dft *self, const struct frf_dft_config *config, uint32_t period_samples,
                                enum frf_number number, frf_kernel *kernel);

/// Whether a table can be built: core_err_argument (null), core_err_frf_period.
enum core_status frf_check_table(const void *storage, uint32_t period, const void *out_table);

/// Cuts frames of `frame_bytes` at the ends of periods, runs the kernel on each piece, latches.
void frf_dft_feed(struct frf_dft *self, const void *frames, uint32_t frame_bytes, uint32_t count);

/// sin(2 pi eighths / (8 N)), 0 <= eighths < 8 N: in eighths of a sample the octants of any period are whole numbers.
double frf_sine_of_eighths(uint32_t eighths, uint32_t period);

/* Accumulators of one bin and channel: real, then imaginary. */
static inline uint32_t frf_sum_offset(const struct frf_dft *self, uint32_t bin, uint32_t channel)
{
    return 2u * (bin * self->channels + channel);
}

static inline union frf_word *frf_active_bank(const struct frf_dft *self)
{
    return self->banks[self->sequence & 1u];
}

/* (index + step) mod N for both below N: one add, one compare. */
static inline uint32_t frf_next_index(uint32_t index, uint32_t step, uint32_t period)
{
    uint32_t next = index + step;
    return next >= period ? next - period : next;
}

#ifdef __cplusplus
}
#endif

#endif
