/* SPDX-License-Identifier: MIT */
/// Names what a simulation gets wrong about recordings, or says that it cannot.
/// Order of work: the given model; its own numbers refitted within a few percent; causes by forward selection on the
/// fit runs; what is left held against a black box; everything judged on data the fit has not seen. docs/theory.md,
/// "Diagnosis".
#ifndef SERVOSCOPE_DIAGNOSE_DIAGNOSIS_H
#define SERVOSCOPE_DIAGNOSE_DIAGNOSIS_H

#include "lab/diagnose/misfit.h"
#include "lab/diagnose/oddities.h"
#include "lab/record/error.h"
#include "lab/record/model_file.h"
#include "lab/record/run.h"
#include "sim/model.h"

#include <stdbool.h>
#include <stddef.h>

enum diagnosis_verdict { diagnosis_explained, diagnosis_unexplained, diagnosis_no_discrepancy };

enum { diagnosis_causes_max = 8, diagnosis_ties_max = 8, diagnosis_gain = -1 };

/// How well one model does on the validation data.
struct diagnosis_figures {
    double validation_nrmse; ///< torque that the model lacks or misplaces, over the measured torque's RMS; validate.h
    double whitened_rms;     ///< one-step prediction errors over their expected standard deviation, all periods
    double mean_rms;         ///< the same of the mean of the periods, where noise hides less of what is wrong
};

/// What a cause is worth on data that the fit has not seen; NaN: not known.
struct cause_gain {
    struct diagnosis_figures without; ///< of the extended model without it, the rest refitted
    double unseen_nats;               ///< what it earns there, everything else kept
};

/// An effect found, with estimates.
struct diagnosis_cause {
    int effect;      ///< index in sim_effects
    double evidence; ///< nats: what the fit loses without it
    double values[sim_effect_parameters_max];
    double deviations[sim_effect_parameters_max];
    double nominal[sim_effect_parameters_max]; ///< of the given model, 0 where it has none
    struct cause_gain gain;
    char says[400];
};

struct diagnosis_tie {
    int effects[2]; ///< the second may be diagnosis_gain: the free gain of a current or a voltage
    char next[320]; ///< the command that finds the measurement which separates them, and what that may be
};

struct diagnosis_untestable {
    int effect;
    char why[200];
};

/// Curves for the report, from the validation data. All arrays are owned and have the stated number of values.
struct diagnosis_curves {
    size_t bins; ///< looked at, from the first above zero
    double *frequency_hz;
    double *torque_Nm;                              ///< magnitude of the measured torque per bin
    double *nominal_Nm, *refitted_Nm, *extended_Nm; ///< magnitude of what each model is off by
    double *two_sigma_Nm;                           ///< expected of a perfect model, from the noise
    size_t samples;                                 ///< of one block
    double rate_hz;
    double *time_s, *position, *velocity;
    double *friction_measured;                    ///< torque left after inertia, belt and what depends on position
    double *residual_nominal, *residual_extended; ///< Nm, excited band
    size_t curve_points;
    double *curve_velocity, *curve_nominal, *curve_extended; ///< friction against speed as the models have it
};

struct diagnosis {
    enum diagnosis_verdict verdict;
    bool inertia_seen;                   ///< without a model: the recordings say what the inertia is
    bool linear, model_given, held_back; ///< held_back: validated on the last part of the only run
    char runs[512], judged[512];         ///< what was fitted, what was judged on
    char motion_from[280];               ///< one sentence on the filtering
    const char *input_unit;              ///< "A", "V", or NULL: a torque or a force
    double input_gain;                   ///< torque or force per unit of the input
    double input_gain_deviation;         ///< its standard deviation, 0 where it was not estimated
    struct oddities oddities;            ///< about the recordings, and details that no model of the kind given has
    struct sim_model given, refitted_model, extended_model;
    struct model_deviations deviations; ///< of extended_model
    size_t cause_count, candidate_count, tie_count, untestable_count;
    size_t detail_count; ///< of what the extended model has beside, without being a cause; the oddities say it
    struct diagnosis_cause causes[diagnosis_causes_max], candidates[diagnosis_causes_max];
    struct diagnosis_tie ties[diagnosis_ties_max];
    struct diagnosis_untestable untestable[sim_effects_max];
    struct diagnosis_figures nominal, refitted, extended;
    double noise_floor_nrmse;
    double black_box_rms;   ///< mean_rms of the extended model with a black box that learned on the fit runs: where
                            ///< that is not below extended.mean_rms, no function of speed and position is left to find
    double mean_rms_chance; ///< what the noise lets a perfect model's mean_rms exceed once in twenty
    double fit_misfit;      ///< mean squared whitened residual of the extended model on the fit runs, 1 is perfect
    struct misfit misfit, fitted_misfit; ///< where the models are wrong: on unseen data, on the fitted runs
    char where[640];                     ///< unexplained: in words, empty otherwise
    int rest_shape;                      ///< unexplained: enum blackbox_group of what would explain it; -1: not known
    bool rest_in_time;                   ///< unexplained: it differs between the periods, or creeps
    double unexplained_share;            ///< of the nominal model's misfit, 0..1
    struct diagnosis_curves curves;
};

struct diagnosis_request {
    const struct run *fit; ///< fit_count runs of one drive, same rate
    size_t fit_count;
    const struct run *validate;
    size_t validate_count;                          ///< 0: the last third of the first run is held back
    const struct sim_model *model;                  ///< NULL: a rigid body without friction, its inertia free
    bool (*progress)(void *user, const char *what); ///< NULL: none; false stops with the best so far
    void *user;
};

/// Errors: error_refused with place and expectation; *out_diagnosis is empty then.
int diagnosis_run(const struct diagnosis_request *request, struct diagnosis *out_diagnosis, struct error *out_error);
void diagnosis_free(struct diagnosis *self);

const char *diagnosis_verdict_str(enum diagnosis_verdict verdict);

/// The contract's JSON object (DESIGN, "Diagnosis"); NULL if memory is short; the caller deletes it.
struct cJSON *diagnosis_json(const struct diagnosis *self);

/// One self-contained HTML page (lab/diagnose/report.c), written whole or not at all.
int diagnosis_report(const struct diagnosis *self, const char *path, struct error *out_error);

#endif
