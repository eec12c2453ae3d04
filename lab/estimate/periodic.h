/* SPDX-License-Identifier: MIT */
/// A run cut into periods: which columns, which lines, which periods count and why the others do not.
/// Every periodic method starts from here, so that all of them leave out the same periods for the same reasons.
#ifndef SERVOSCOPE_ESTIMATE_PERIODIC_H
#define SERVOSCOPE_ESTIMATE_PERIODIC_H

#include "lab/estimate/settle.h"
#include "lab/record/error.h"
#include "lab/record/run.h"

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Where the number of settling periods came from.
enum periodic_settle {
    periodic_settle_default, ///< as an option: the run's key, else from the decay
    periodic_settle_auto,    ///< from the decay
    periodic_settle_given,   ///< as an option: `settle_periods` below; as a result: the caller said so
    periodic_settle_key,     ///< as a result: the run's key
    periodic_settle_keep,    ///< as an option: the run's key, else none, for methods that model the transient
};

struct periodic_options {
    const char *input;     ///< column; NULL: torque_Nm, else force_N, current_A, voltage_V, the first there is
    const char *output;    ///< column; NULL: velocity_rad_per_s, velocity_m_per_s, position_rad, position_m
    const char *reference; ///< column; NULL: columns_choose says which
    enum periodic_settle settle;
    size_t settle_periods; ///< with periodic_settle_given
    size_t period_samples; ///< 0: the run's, else found in the input
    const uint32_t *bins;  ///< ascending; NULL: the run's, else found in the input
    size_t bin_count;
};

struct periodic {
    const struct run *run; ///< borrowed
    const char *input;     ///< column names, owned by the run
    const char *output;
    const char *reference; ///< NULL: none
    bool aperiodic;        ///< refused because nothing says a period and none was found; kept when a cut is refused
    size_t period_samples;
    double true_period_samples; ///< before it was resampled; 0: as period_samples
    bool period_found;          ///< by its repetition, not said
    size_t bin_count;
    uint32_t *bins;     ///< ascending, 1 .. (period_samples - 1)/2
    bool bins_found;    ///< by their power, not said
    uint32_t *doubtful; ///< where bins were found: others where the input has power (line_search.h); ascending
    size_t doubtful_count;
    size_t total; ///< whole periods in the recording
    enum periodic_settle settle_source;
    size_t settle;         ///< leading periods left out for settling
    size_t lost;           ///< later periods left out because samples of theirs were lost
    size_t first_lost_row; ///< of those, counted from 1
    size_t lost_outside;   ///< lost rows that cost no period: left out for settling, or behind the last whole period
    size_t first_lost_outside; ///< of those, counted from 1
    size_t used;               ///< periods that count, at least 2
    size_t *used_periods;      ///< their numbers, ascending, from 0
    double trend_per_sample;   ///< drift of an integrating output (a position), taken out; 0 for other outputs
    struct settle transient;   ///< the longer of input and output
    double *input_level;       ///< `total` values: transient and scatter of each period, share of the signal; NaN: lost
    double *output_level;
    double complex *input_spectra; ///< used x bin_count (spectra.h)
    double complex *output_spectra;
    double complex *owned_spectra[2]; ///< what the two above point into
};

/// Cuts a run into periods and transforms those that count.
///
/// Power:  on a line where the mean input, its drift taken out, is not above rounding (1e-12 of its largest mean, drift
///         or line), all input_spectra are set to 0, so that no method takes it for excited
/// Errors: error_refused with what to give or mend: no such column, no period or lines said nor found, lines beyond
///         half the rate, no line with power, fewer than two periods left (no standard deviation could be given);
///         *out_self needs no freeing then
/// Lifetime: `run` must outlive *out_self
/// Test:   tests/unit/test_frf_mean.c, tests/fault/test_frf_refusals.c
int periodic_cut(const struct run *run, const struct periodic_options *options, struct periodic *out_self,
                 struct error *out_error);

/// Transforms the periods that count of another column; out_spectra: used x bin_count. Errors: false if memory is
/// short.
bool periodic_transform_used(const struct periodic *self, const char *column, double complex *out_spectra);

/// output_level of the first and of the last period without lost samples.
double periodic_first_level(const struct periodic *self);
double periodic_last_level(const struct periodic *self);

void periodic_free(struct periodic *self);

#endif
