/* SPDX-License-Identifier: MIT */
/// The cut of a recording whose true period need not be a whole number of samples: periodic_cut, what clock_measure
/// finds in it, and where that matters the same of the recording resampled to the true period.
#ifndef SERVOSCOPE_ESTIMATE_CLOCKED_H
#define SERVOSCOPE_ESTIMATE_CLOCKED_H

#include "lab/estimate/clock.h"
#include "lab/estimate/periodic.h"
#include "lab/record/frf_file.h"

#include <stdbool.h>

struct clocked {
    struct periodic recording; ///< of the run, or of `resampled`
    struct clock clock;        ///< offsets are those of the run as it was recorded
    bool is_resampled;
    struct run resampled;
};

/// Largest difference between the true period and the one that is said, as a share of it, that is resampled: the known
/// lines would be others soon.
#define CLOCKED_RANGE 0.02

/// Cuts a run into its true periods.
/// Where nothing says a period, or the one that is said does not repeat, it is looked for (period_search_run),
/// fractions of a sample included. Offsets that do not matter are left alone, unless `strict`: then every certain one
/// is corrected, for responses that further recordings make more certain.
///
/// A period that somebody said is compared with what the input repeats after (period_search_check): always if the
/// options say it, else where clock_measure cannot (fewer than 4 periods, or one does not resemble the next).
///
/// Errors: as periodic_cut (recording.aperiodic included); error_refused with the figures: input and output keep
///         different clocks (they turn by more than 0.5 rad against each other), lines above RESAMPLE_BAND would get
///         lost, the input repeats after another period than the one said (the options': another whole number, or more
///         than CLOCKED_RANGE off; the run's: more than CLOCKED_RANGE, or too few periods for clock_measure).
///         *out_self needs no freeing then. `run` must outlive it
/// Test:   tests/unit/test_clock.c
int clocked_cut(const struct run *run, const struct periodic_options *options, bool strict, struct clocked *out_self,
                struct error *out_error);

/// Adds what docs/files.md calls the keys of the clock. Errors: false if memory is short.
bool clock_set_keys(const struct clock *clock, size_t period_samples, bool resampled, struct frf *io_frf);

void clocked_free(struct clocked *self);

#endif
