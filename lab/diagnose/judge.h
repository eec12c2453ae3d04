/* SPDX-License-Identifier: MIT */
/// Whether the named causes are the answer: what a black box still finds, which names survive it, which cannot be told
/// apart.
#ifndef SERVOSCOPE_DIAGNOSE_JUDGE_H
#define SERVOSCOPE_DIAGNOSE_JUDGE_H

#include "lab/diagnose/diagnosis.h"
#include "lab/diagnose/fit.h"
#include "lab/diagnose/structure.h"

struct judgement {
    bool unexplained, of_mean; ///< of_mean: of the mean of the periods, not only over time
    double leftover;           ///< nats that the black box still gains over the named causes
    double leftover_in_time;   ///< nats of structure over time that stays; 0: none
    size_t count;              ///< of named effects that stand
    bool stands[sim_effects_max];
    int shape;       ///< enum blackbox_group of what would explain the rest, or alone the whole; -1: not known
    char where[300]; ///< what is left, in words
};

/// What data that the fit has not seen say of the extended model.
struct judge_validation {
    double mean_rms;            ///< diagnosis_figures
    bool worse;                 ///< it errs more there than the refitted model
    bool astray;                ///< judge_is_astray
    struct structure over_time; ///< that it leaves there
};

/// Judges a finished search.
/// Unexplained: the black box gains more than chance allows (its expected gain plus twelve standard deviations) and
/// more than a third of the noise in amplitude, or one group of it does as well as three names, or the residual on fit
/// or validation data is a quarter larger than the noise (half as large again without a given model, a seventh where
/// nothing is named), or its torque goes astray, or periods differ beyond chance.
/// A name stands if it explains a visible share of the torque and, where something stays unexplained, far more than
/// what stays and more than the black box can do without it.
/// Errors: false if memory is short.
bool judge(const struct fit_data *data, const struct sim_coverage *coverage, const struct hypothesis *hypothesis,
           const struct fit *fit, const struct judge_validation *validation, struct judgement *out_judgement);

/// A second opinion on runs without periods, whose noise is what a smooth black box leaves of the residual: what that
/// cannot follow passes for noise. An error far above what the spectrum above the excitation would make is not
/// explained; and where noise is larger than all that was measured, no name stands. Returns whether it changed the
/// judgement.
bool judge_distance(double error, double noise_floor, struct judgement *io_judgement);

/// Whether a model errs more on unseen data than noise makes it, by a quarter and by more than a name is worth. Weights
/// take little notice where noise, or what is allowed for, hides most of a residual; torque does.
bool judge_is_astray(double error, double noise_floor);

/// Whether an effect's size is not known: every parameter but phases, of a sinusoid its amplitude alone, lies within
/// two of its deviations of nothing, or of the given model's value.
bool judge_is_vague(const struct sim_effect *effect, const double *values, const double *deviations,
                    const double *nominal);

/// Structure over time in what a model leaves of runs, whose noise must have been estimated.
/// Errors: false if memory is short
bool judge_structure(const struct fit_data *data, const struct sim_model *model, struct structure *out_structure);

/// Named effects that another effect could replace within 6 nats. Returns how many were written.
size_t judge_ties(const struct fit_data *data, const struct sim_coverage *coverage, const struct hypothesis *hypothesis,
                  const struct fit *fit, struct diagnosis_tie *out_ties, size_t most);

#endif
