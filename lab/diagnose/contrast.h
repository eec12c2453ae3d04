/* SPDX-License-Identifier: MIT */
/// What differs between the periods of a run: evidence of effects that depend on time, which the mean of the periods
/// does not show. An effect that does not depend on time acts alike in every period and leaves the contrasts as they
/// are, to first order, so they are looked at only for models that have one that does.
#ifndef SERVOSCOPE_DIAGNOSE_CONTRAST_H
#define SERVOSCOPE_DIAGNOSE_CONTRAST_H

#include "lab/diagnose/recording.h"
#include "sim/model.h"

struct evidence;

struct contrast {
    size_t width;     ///< values per period, 1 + 2 band: the mechanics channel of bins 0..band
    size_t values;    ///< periods x width; 0 for a run without periods
    double *base;     ///< whitened deviations of the periods' residuals from their mean, no effect in time taken out
    double without;   ///< sum of their squares
    double reference; ///< the same under the model that the noise was estimated with
};

/// Whether a model has an effect on that depends on time.
bool contrast_concerns(const struct sim_model *model);

/// Whether an effect is a line in time, with a phase: it can only begin where a line stands out.
bool contrast_is_line(int effect);

/// Errors: false if memory is short.
bool contrast_init(struct contrast *self, const struct recording *recording);
void contrast_free(struct contrast *self);

/// Takes the deviations of the periods from their mean under a model, whose effects in time are put back.
/// Shapes: deviations: per period `stride` doubles, of which the first 2 (band + 1) are the DFT of the mechanics
/// Errors: false if memory is short
bool contrast_take(struct evidence *evidence, const struct sim_model *model, const double *deviations, size_t stride);

/// Residual of the contrasts under a model, and what its effects in time do on the mean of the periods beyond what they
/// do where the block's clock stands.
/// Equation:  d_p = base_p + W (F_p - mean F),  F_p the DFT of the opposing torque over the mean motion at period p's
///            times, W the whitening;  out_mean[n] = mean_p f_p[n] - f[n](block->start_s)
/// Shapes:    out_residual: values, or NULL; out_mean: block samples, Nm of mechanics, or NULL
/// Errors:    false if memory is short
bool contrast_residual(const struct evidence *evidence, const struct sim_model *model, double *out_residual,
                       double *out_mean);

/// The model as the evidence's run sees it: the phase of an effect in time is anyone's guess in every run but the first
/// that was fitted, and is taken as the one that fits best.
/// Errors: false if memory is short
bool contrast_align(const struct evidence *evidence, const struct sim_model *model, struct sim_model *out_model);

/// Sets size and phase of an effect that starts at `io_values` to what suits the contrasts best beside `model`, which
/// does not have it. Effects without a phase are left as they are.
/// Errors: false if memory is short
bool contrast_size_effect(const struct evidence *evidence, const struct sim_model *model, int effect,
                          double *io_values);

/// Finds the strongest lines in what a model leaves, between the harmonics of the period if there is one: those whose
/// power is beyond chance against that of the spectrum about them.
/// They become the evidence's, the strongest first.
/// Shapes: mechanics: residual of every row (periodic) or of the block
/// Errors: false if memory is short
bool contrast_find_tones(struct evidence *evidence, const double *mechanics);

#endif
