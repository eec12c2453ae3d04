/* SPDX-License-Identifier: MIT */
/// The methods that make a frequency response from a recording, and what all of them share.
/// One file per method; this table is the only place that knows them all.
#ifndef SERVOSCOPE_ESTIMATE_METHOD_H
#define SERVOSCOPE_ESTIMATE_METHOD_H

#include "lab/estimate/arbitrary.h"
#include "lab/estimate/options.h"
#include "lab/estimate/periodic.h"
#include "lab/record/frf_file.h"

#include <complex.h>

struct estimate_method {
    const char *name;      ///< as given to --method
    const char *summary;   ///< one line
    bool models_transient; ///< no period needs to be left out for settling (periodic_settle_keep)
    /// From whole periods. Errors: error_refused with the reason; *out_frf is empty then.
    int (*estimate)(const struct periodic *recording, const struct estimate_options *options, struct frf *out_frf,
                    struct error *out_error);
    /// From a recording without a period; NULL: the method needs one. Errors as above.
    int (*estimate_arbitrary)(const struct arbitrary *recording, const struct estimate_options *options,
                              struct frf *out_frf, struct error *out_error);
};

/// All methods; the last one has no name.
extern const struct estimate_method estimate_methods[];

/// Finds a method by name.
/// Errors: NULL for one that is not there; *out_error (error_usage) lists those that are.
const struct estimate_method *estimate_method_find(const char *name, struct error *out_error);

/// A line counts as excited if scatter alone explains its mean input with less than this chance.
extern const double estimate_chance_of_dead_line;

/// For methods: allocates a response with frequencies, names, units, periods and real degrees of freedom.
int estimate_begin(const struct periodic *recording, const char *method, double degrees_of_freedom, struct frf *out_frf,
                   struct error *out_error);

/// The same for a recording without a period, with lines at step_hz, 2 step_hz, ...
int estimate_begin_arbitrary(const struct arbitrary *recording, const char *method, double degrees_of_freedom,
                             size_t lines, double step_hz, struct frf *out_frf, struct error *out_error);

/// For methods: puts in one valid line. The one recording tells no distortion from the response, so that the total
/// standard deviation is that of the noise.
void estimate_set_line(struct frf *io_frf, size_t line, double complex response, double std);

/// For methods: refuses a response without a single valid line (and frees it), else adds the keys that say how it was
/// made: settle_periods, settle_from, lost_periods, confidence_95_factor and others.
int estimate_end(const struct periodic *recording, struct frf *io_frf, struct error *out_error);

int estimate_end_arbitrary(const struct arbitrary *recording, struct frf *io_frf, struct error *out_error);

/// For methods: gives up a response because memory is short, and says so.
int estimate_refuse_memory(struct frf *io_frf, struct error *out_error);

/// For methods that divide by the input's own power: what that does in a closed loop, as the key `warning`.
bool estimate_warn_of_feedback(const char *reference, struct frf *io_frf);

/// For methods that divide by a reference: a default reference that may belong to the loop, as the key `warning`.
bool estimate_warn_of_reference(const char *reference, struct frf *io_frf);

/// Value of a key of a response; "" if it is not there.
const char *estimate_key(const struct frf *frf, const char *key);

/// Sets the key confidence_95_factor from the degrees of freedom. Errors: false if memory is short.
bool estimate_set_confidence(struct frf *io_frf);

/// Sets a key of a response, replacing an equal one. Errors: false if memory is short.
bool estimate_set_key(struct frf *io_frf, const char *key, const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 3, 4)))
#endif
    ;

/// The same for a text of any length; estimate_set_key() cuts at 799 characters.
bool estimate_set_long_key(struct frf *io_frf, const char *key, const char *text);

/// For what puts several responses together: allocates one with the frequencies, names, units and method of the first,
/// the sum of their periods, and the keys that all of them say alike, lost_periods added up and sample_rate_hz as their
/// mean. Lines and degrees of freedom are left to the caller.
/// Errors: error_refused if the lines (by more than 0.05 % of their frequency or a tenth of their distance) or the
///         names of input and output differ; *out_frf is empty then
int estimate_begin_common(const struct frf *responses, size_t count, struct frf *out_frf, struct error *out_error);

/// The keys of that. Errors: false if memory is short.
bool estimate_set_common_keys(struct frf *io_frf, const struct frf *responses, size_t count);

/// Averages the responses of several realisations (runs with other phases or levels, same lines) with equal weights.
///
/// Equation:  G = mean G_r;  noise_std = sqrt(sum noise_std_r^2) / R
///            std = sqrt(sum |G_r - G|^2 / (R )): noise and stochastic nonlinear distortion together
///            distortion levels: root of their mean power, where every realisation has one
/// Validity:  a line is valid if it is in every realisation; degrees of freedom 2, of noise_std the sum of all
///            realisations' (key noise_degrees_of_freedom). Whether they differ: agreement.h
/// Keys:      as estimate_begin_common, realisations, noise_degrees_of_freedom
/// Errors:    as estimate_begin_common
int estimate_average(const struct frf *realisations, size_t count, struct frf *out_frf, struct error *out_error);

#endif
