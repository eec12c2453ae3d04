/* SPDX-License-Identifier: MIT */
/// Method mean for recordings that memory does not hold: periods are transformed as they come and then forgotten.
/// Of each line only running means and (co)variances stay, so that memory does not grow with the number of periods.
#ifndef SERVOSCOPE_ESTIMATE_ONLINE_H
#define SERVOSCOPE_ESTIMATE_ONLINE_H

#include "lab/estimate/periodic.h"
#include "lab/record/error.h"
#include "lab/record/frf_file.h"

#include <stdbool.h>
#include <stddef.h>

struct online;

/// Begins with the leading rows of a recording, cut with periodic_settle_given and 0 settling periods: it says columns,
/// period and lines, and its periods are the ones that can be left out for settling.
///
/// settle: what to leave out in the end: of the key or the options that many; else (auto) leading periods that differ
///         from those after them by more than scatter, as settle_measure, the later half of the whole recording and
///         everything after the leading part taken for settled
/// Memory: the leading part's spectra, 80 bytes a line, and 65536 rows of the columns, or one period if that is longer
/// Errors: error_refused if memory is short; *out_self is NULL then. `leading` and its run must outlive it
int online_begin(const struct periodic *leading, const struct periodic_options *options, struct online **out_self,
                 struct error *out_error);

/// Takes the next rows, which follow the leading part's. `valid` NULL: no sample was lost.
/// Equation: with E = Y - G_0 U, G_0 the leading part's response, and d the distance from the mean so far,
///           mean += d/n; S_uu += |d_u|^2 (n-1)/n, S_ee, S_eu alike (Welford): the scatter of Y - G U is small against
///           that of Y and of G U where both have the same noise, and would drown in the rounding of their difference
/// Errors:   error_refused if memory is short
int online_take(struct online *self, const double *input, const double *output, const double *valid, size_t rows,
                struct error *out_error);

/// Which periods counted, as struct periodic has it.
struct online_result {
    size_t total;
    enum periodic_settle settle_source;
    size_t settle;
    size_t lost;
    size_t first_lost_row;
    size_t used;
    struct settle transient;
    double first_level; ///< deviation of the first and the last period from the mean of settled ones, of the output
    double last_level;
    double trend_per_sample;
};

/// Makes the response, with the keys of frf_mean_estimate. `rate_hz`: the final sample rate.
/// Errors: error_refused: fewer than two periods count; no line has power; memory is short
/// Test:   tests/unit/test_online.c
int online_end(struct online *self, double rate_hz, struct online_result *out_result, struct frf *out_frf,
               struct error *out_error);

/// NULL is allowed.
void online_free(struct online *self);

#endif
