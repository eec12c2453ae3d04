/* SPDX-License-Identifier: MIT */
/// The noise of a recording as the residuals see it, estimated from the recording, and residuals whitened by it.
#ifndef SERVOSCOPE_DIAGNOSE_NOISE_H
#define SERVOSCOPE_DIAGNOSE_NOISE_H

#include "lab/diagnose/contrast.h"
#include "lab/diagnose/kinematics.h"
#include "lab/diagnose/recording.h"
#include "sim/model.h"

struct fft_plan;

enum { evidence_allowances = 8 };

/// A recording with its noise: what a likelihood needs. Channels: mechanics, and actuator if there is a reference.
struct evidence {
    const struct recording *recording;
    double scale_inertia; ///< of predict(); the same for every model that is compared
    size_t channels;      ///< 1 or 2
    size_t values;        ///< length of a whitened residual
    struct fft_plan *plan;
    double *covariance; ///< per bin 0..band: S_mm, S_aa, Re S_am, Im S_am of the block's DFT divided by its length
    double *factor;     ///< per bin: inverse Cholesky factor, l_mm, l_aa, Re l_am, Im l_am
    size_t *slow;       ///< per bin: slow courses over the periods that are no noise, slow.h; 0 nearly everywhere
    double scatter;     ///< whitened squares of what differs between the periods, all summed; 0 without periods
    double *between; ///< spectra, mechanics and actuator: half of what the mean of the periods' residuals has over that
                     ///< of their mean; zeros without periods
    size_t allowance_count;
    double *allowances;                         ///< values each: unit vectors of what no cause is, but no noise either
    double allowance_kept[evidence_allowances]; ///< share that is kept of a residual along each, one after the other
    double *work;
    struct contrast contrast;
    struct kinematics kinematics;
    bool phase_free; ///< the phase of effects in time is this run's own: it is not the first run of a fit
    size_t tone_count;
    double tones_hz[sim_tones_max]; ///< of sim_coverage, found with the noise
    double tone_nats;               ///< of the strongest, against the spectrum about it
};

/// Prepares the evidence for a recording. Errors: false if memory is short.
bool evidence_init(struct evidence *self, const struct recording *recording, double scale_inertia);
void evidence_free(struct evidence *self);

/// Estimates the noise under a model: from the scatter of the periods' residuals about their mean, averaged over
/// neighbouring bins, without slow courses over the periods where these stand out of it; in a run without periods from
/// the smoothed spectrum of the residual itself, an upper bound.
/// Equation:  C_k = 1 / (P (P-1)) sum_p (R_p - mean) (R_p - mean)^H, smoothed;  R = DFT / N
///            The whitening factor is smaller than C_k^-1 by what the few scatters behind an estimate make its inverse
///            too large.
/// Errors: false if memory is short.
bool evidence_estimate_noise(struct evidence *self, const struct sim_model *model);

/// The whitening of a run with periods under a model, and nothing else that belongs to its noise: for fits in which the
/// noise follows the model. Errors: false if memory is short, or without periods.
bool evidence_renew_noise(struct evidence *self, const struct sim_model *model);

/// In a run without periods: the noise from a whitened residual (by the present noise) out of which everything that a
/// black box can explain has been taken. Nothing is done for periodic runs. Errors: false if memory is short.
bool evidence_sharpen_noise(struct evidence *self, const double *whitened);

/// Residual of a model on the block, whitened: independent, unit variance if the model is right.
/// Shapes: out_whitened: self->values; order: bin by bin, mechanics before actuator, real before imaginary; after them
/// the kinematics.
/// out_contrasts: self->contrast.values, residual of the contrasts, written for a model that concerns them; NULL: not
/// wanted.
void evidence_residual(const struct evidence *self, const struct sim_model *model, double *out_whitened,
                       double *out_contrasts);

/// Residual signals of a model on the block, not whitened: mechanics and actuator (NULL: not wanted).
/// Shapes: block samples each
/// Errors: false if memory is short
bool evidence_signals(const struct evidence *self, const struct sim_model *model, double *out_mechanics,
                      double *out_actuator);

/// Whitens residual signals of the block (actuator NULL: zeros; kinematics: zeros).
void evidence_whiten(const struct evidence *self, const double *mechanics, const double *actuator,
                     double *out_whitened);

/// DFT of one real signal of the block at bins 0..band, divided by its length, tapered if the block is no period;
/// out: 2 (band + 1) values.
void evidence_transform(const struct evidence *self, const double *signal, double *out_spectrum);

/// Expected square of sample i of the block's noise over the mean of all: the ends of a run without periods are
/// tapered.
double evidence_weight(const struct evidence *self, size_t i);

/// Bin that value number i of a whitened residual belongs to, and its channel: 0 mechanics, 1 actuator, 2 kinematics.
size_t evidence_bin(const struct evidence *self, size_t i, size_t *out_channel);

#endif
