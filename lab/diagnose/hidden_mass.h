/* SPDX-License-Identifier: MIT */
/// Fits of structures that the given model does not have, with masses that nobody measured. The measured motion of the
/// motor shakes such a mass, its noise too: how noisy a residual is depends on the parameters, and weights that stay
/// what they were pull the fit to where there is less noise, a third off and more. So the weights follow the
/// parameters.
/// Equation:  V(theta) = sum_k e_k(theta)^H C_k(theta)^-1 e_k(theta),  C_k from the scatter of the periods: the sample
///            maximum likelihood of errors in variables (Pintelon and Schoukens, System Identification, 2nd ed., 2012)
#ifndef SERVOSCOPE_DIAGNOSE_HIDDEN_MASS_H
#define SERVOSCOPE_DIAGNOSE_HIDDEN_MASS_H

#include "lab/diagnose/fit.h"
#include "sim/effect.h"

/// Whether an effect brings a mass that nobody measured.
bool hidden_mass_is(int effect);

/// Whether a hypothesis names a hidden mass and all runs have periods.
bool hidden_mass_concerns(const struct fit_data *data, const struct hypothesis *hypothesis);

/// Improves hypothesis->x, the noise following; on return the noise is that at the returned x, and the fit is complete.
/// Errors: false if memory is short.
bool hidden_mass_fit(struct fit_data *data, struct evidence *evidence, struct fit *fit,
                     struct hypothesis *io_hypothesis);

/// A cost that is to be believed. The noise that follows the parameters is a mean over neighbouring bins: a resonance
/// sharper than that gathers it where the residual happens to be small, and leaves less than noise can. What is below
/// the lowest twentieth of chance is no evidence.
double hidden_mass_credible_cost(const struct fit_data *data, double cost);

/// Keeps the coordinates of a structure where they are, for a search in which the noise stays; out_free: the boxes that
/// hidden_mass_release() gives back to those that are still there.
void hidden_mass_hold(struct hypothesis *io_hypothesis, struct hypothesis *out_free);
void hidden_mass_release(const struct hypothesis *free, struct hypothesis *io_hypothesis);

/// Whether a named effect is kept where it is.
bool hidden_mass_holds(const struct hypothesis *hypothesis, int effect);

/// A mass that swings on a rigid axis is half of what an elastic axis is: fits the structures that may be named beside
/// `before`, from a few places. Returns whether one does as well as `cost`, with what it has fewer parameters for
/// granted; io_h and the fit are its then. `io_h` names the mass on entry.
bool hidden_mass_instead(struct fit_data *data, struct evidence *evidence, const struct sim_coverage *coverage,
                         const struct hypothesis *before, double cost, struct fit *fit, struct hypothesis *io_h);

#endif
