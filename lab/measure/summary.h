/* SPDX-License-Identifier: MIT */
/// What a measured run says about the measurement itself, before anybody asks for a response: level, settling, lost
/// samples, amplitudes at the excited lines.
#ifndef SERVOSCOPE_MEASURE_SUMMARY_H
#define SERVOSCOPE_MEASURE_SUMMARY_H

#include "lab/measure/measure.h"
#include "lab/record/run.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum measure_quantity { measure_torque, measure_velocity, measure_position, measure_quantities };

/// One quantity over all rows that were not lost, beside one period of the table.
struct measure_level {
    double table_peak, table_rms; ///< NaN: the table has no such channel, or it says nothing about this mode
    double peak, rms;             ///< largest absolute value; of the counted periods, of all rows where there are none
    double limit;                 ///< 0: none
    double used;                  ///< largest share of the limit, 1 at the limit; 0 without one
};

/// Arrays are owned; NaN where there is nothing to say.
struct measure_summary {
    const struct run *run; ///< borrowed
    const struct msgen_table *table;
    const double *column[measure_quantities]; ///< of the run
    const double *valid;                      ///< NULL: nothing was lost
    struct measure_level level[measure_quantities];
    size_t whole; ///< periods that the rows hold completely
    size_t lost;
    size_t periods_with_lost;                      ///< counted ones that frf will leave out
    double *distance[measure_velocity + 1];        ///< `whole` values each: RMS of the difference from the last whole
                                                   ///< period, mean removed, over the RMS of that; torque, velocity
    size_t reference;                              ///< that last period without lost samples; `whole`: there is none
    size_t line_count;                             ///< of the table
    size_t averaged;                               ///< periods that the measured amplitudes are the mean of
    double *frequency_hz;                          ///< line_count values, as all that follow
    double *amplitude[measure_velocity + 1];       ///< of the mean period
    double *table_amplitude[measure_velocity + 1]; ///< NaN without that channel
    uint32_t lost_in_part[measure_parts];
};

/// Equation: amplitude at bin k = 2/N |sum_n y[n] exp(-j 2 pi k n / N)| of the mean of the counted periods without lost
///           samples (the settling ones where there are no others)
/// Errors:   false if memory is short; nothing to free then
/// Lifetime: run and table must outlive *out_self
/// Test:     tests/unit/test_measure_summary.c
bool measure_summary_make(const struct run *run, const struct msgen_table *table,
                          const struct guard_real_limits *limits, size_t rows_planned,
                          struct measure_summary *out_self);

void measure_summary_free(struct measure_summary *self);

/// Distances of the first counted period, and the median of the counted ones but the first and the reference.
/// NaN where there are none.
double measure_summary_first(const struct measure_summary *self, enum measure_quantity quantity);
double measure_summary_usual(const struct measure_summary *self, enum measure_quantity quantity);

#endif
