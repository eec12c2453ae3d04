/* SPDX-License-Identifier: MIT */
/// What a method works with: the limited signals on its grid, buffers, and the best phases so far.
/// Phases are kept as complex numbers c_k = exp(j phi_k): no angle is needed between start and result. Their length is
/// 1, or with request.amplitude_tolerance_db what the amplitude is to be multiplied by.
#ifndef SERVOSCOPE_DESIGN_SEARCH_H
#define SERVOSCOPE_DESIGN_SEARCH_H

#include "lab/design/watch.h"
#include "lab/design/waveform.h"

struct design_search {
    const struct design_spectrum *spectrum;
    struct design_waveform waveform; ///< design_waveform_limited on the method's grid
    struct design_watch *watch;      ///< NULL: nobody watches
    bool silent;                     ///< scores are on a grid of their own: the watch is not told
    double *packed;                  ///< one buffer of waveform.packed_length doubles
    double *best;                    ///< 2 line_count doubles: the phases to be returned
    double best_score;               ///< what was smallest: by default the largest signal in units of its limit
    double tolerance;                ///< of log |c_k|, either way; 0: amplitudes are as prescribed
    double *share; ///< line_count: of the torque's power at prescribed amplitudes; NULL without tolerance
};

/// Grid of the search: the samples themselves, or at least 40 points per highest line.
/// Returns false if memory is short (nothing is held then).
bool design_search_create(const struct design_request *request, const struct design_spectrum *spectrum,
                          struct design_search *out_search);
/// The same with the amplitudes' tolerance of the request, on a grid and with a fold (waveform.h) of the caller's
/// choice.
bool design_search_create_on(const struct design_request *request, const struct design_spectrum *spectrum, size_t grid,
                             size_t fold, struct design_search *out_search);
void design_search_free(struct design_search *self);

/// Puts the signals at c into self->packed; returns the largest, in units of its limit.
double design_search_peak(struct design_search *self, const double *c);

/// Makes c the best if its score is smaller than the best so far; the first always is.
void design_search_offer(struct design_search *self, const double *c, double score);

/// Offers c with its peak at unit power as the score, which is returned; the signals stay in self->packed.
double design_search_try(struct design_search *self, const double *c);

/// Says how many evaluations are to come, for the progress.
void design_search_plan(struct design_search *self, size_t evaluations);

/// Asked once per evaluation: false if the method is to return with its best so far.
bool design_search_goes_on(struct design_search *self);

/// Root of the mean torque power with amplitudes |c_k|, 1 at the prescribed ones.
double design_search_power_root(const struct design_search *self, const double *c);

/// Scales each of line_count complex numbers to length 1; one without direction keeps its old value.
void design_search_keep_directions(size_t line_count, const double *y, double *inout_c);

#endif
