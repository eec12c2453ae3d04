/* SPDX-License-Identifier: MIT */
/// The two causes of a separation: what a model is without them, and how large each one is.
#ifndef SERVOSCOPE_EXPERIMENT_CAUSE_H
#define SERVOSCOPE_EXPERIMENT_CAUSE_H

#include "lab/experiment/contest.h"

/// Where a cause's numbers come from.
enum separation_source {
    separation_of_model, ///< the model has the cause
    separation_of_scan,  ///< its own scan values, at a size that the excitation as given shows clearly
    separation_of_rival, ///< where it imitates the other cause best under the excitation as given
};

struct separation_cause {
    int effect;
    double values[sim_effect_parameters_max];
    enum separation_source source;
    bool has_values;        ///< `values` say something
    struct sim_model drive; ///< the given model with the cause, as it is simulated
};

/// Takes a cause out of a model, keeping its numbers; out_cause->source is separation_of_scan if the model has none.
/// A cause that is a number of the model (a friction, an inertia, a lag) stays: it is a change of that number.
void cause_take_out(int effect, struct sim_model *io_model, struct separation_cause *out_cause);

/// Whether diagnosis may name a cause beside a model at all.
/// Errors: error_refused with what the cause needs
int cause_check(int effect, const struct sim_model *given, struct error *out_error);

/// How sizes are tried out.
struct cause_trial {
    const struct contest *without; ///< runs of the drive without the cause
    /// Plays the drive with the cause and says how many nats it gains over the model without it, refitted.
    int (*evidence)(void *user, const struct separation_cause *cause, double *out_nats, struct error *out_error);
    void *user;
};

/// Chooses numbers from the scan values, at a size (first parameter, where the cause grows with it from nothing) that
/// the excitation as given shows with about 100 nats.
/// Errors: error_refused if no scan value shows, and those of trying out
int cause_choose_size(const struct cause_trial *trial, struct separation_cause *io_cause, struct error *out_error);

/// Sets the drive that has a cause at its present values.
void cause_make_drive(const struct sim_model *given, struct separation_cause *io_cause);

#endif
