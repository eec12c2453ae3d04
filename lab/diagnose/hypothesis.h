/* SPDX-License-Identifier: MIT */
/// A hypothesis about what a model gets wrong: which effects are named causes, and which numbers may move meanwhile.
/// The given model's own numbers may always be off by a few percent: they move within a box around what was given, at a
/// small cost. Naming an effect opens the box for its parameters, or switches it on. Nothing here knows an effect by
/// name.
#ifndef SERVOSCOPE_DIAGNOSE_HYPOTHESIS_H
#define SERVOSCOPE_DIAGNOSE_HYPOTHESIS_H

#include "sim/model.h"

#include <stdbool.h>
#include <stddef.h>

enum { hypothesis_coordinates_max = 32 };

/// How a coordinate x becomes a value.
enum coordinate_scale {
    coordinate_linear,      ///< value = x * unit
    coordinate_logarithmic, ///< value = exp(x) * unit
    coordinate_cosine,      ///< amplitude and phase: x * unit = a cos(phase)
    coordinate_sine,        ///< the following coordinate: x * unit = a sin(phase)
};

struct coordinate {
    int effect;          ///< index in sim_effects, -1: a nuisance of the given model
    size_t parameter;    ///< of that effect
    size_t model_offset; ///< of the double in struct sim_model, SIZE_MAX: an effect's parameter
    enum coordinate_scale scale;
    double unit;
    double lower, upper;   ///< bounds of x
    double centre, weight; ///< prior: weight (x - centre), weight 0: none
};

struct hypothesis {
    const struct sim_model *given;
    bool inertia_free;  ///< no model was given: the rigid body's inertia has no prior and no box
    bool gain_free;     ///< the input is no torque: its gain takes the place of a rigid body's inertia
    bool actuator_seen; ///< the recordings have a torque reference: what lies between it and the torque can show
    bool sensors_seen;  ///< position and speed were recorded by columns of their own: what one says of the other counts
    double middle;      ///< of the travel: what is changed along it is named, and taken back, about there
    bool named[sim_effects_max];
    size_t count;
    struct coordinate coordinates[hypothesis_coordinates_max];
    double x[hypothesis_coordinates_max];
    struct sim_model engaged; ///< the given model with the structure of the named effects
};

/// Starts with the given model: no cause, its own numbers as nuisances.
void hypothesis_init(struct hypothesis *self, const struct sim_model *given, bool inertia_free, bool actuator_seen);

/// Whether an effect may be added at all (not named yet, applicable, room left).
bool hypothesis_may_name(const struct hypothesis *self, int effect);

/// Whether a named effect is no more than a detail of how the given model is made: fitted, but no claim.
bool hypothesis_is_detail(const struct hypothesis *self, int effect);

/// Named effects that are claims.
size_t hypothesis_claims(const struct hypothesis *self);

/// Names an effect, its parameters starting at `values`.
void hypothesis_name(struct hypothesis *self, int effect, const double *values);

/// The coordinate of the number that coordinate i's effect changes along the travel, or the count if there is none.
size_t hypothesis_along(const struct hypothesis *self, size_t i);

/// By how much the logarithm of that number has to move when coordinate i goes from x[i] to `to`, so that in mid
/// travel it is what it was.
double hypothesis_along_shift(const struct hypothesis *self, const double *x, size_t i, double to);

/// Takes a name back, and with it the names of effects that have nothing to act on without it; the parameters of the
/// others keep their values.
void hypothesis_unname(struct hypothesis *self, int effect);

/// The model at coordinates x (NULL: the hypothesis' own).
void hypothesis_model(const struct hypothesis *self, const double *x, struct sim_model *out_model);

/// Current values of an effect's parameters, and their standard deviations from the covariance of the coordinates
/// (count x count, NULL: none wanted).
void hypothesis_parameters(const struct hypothesis *self, int effect, const double *covariance, double *out_values,
                           double *out_deviations);

#endif
