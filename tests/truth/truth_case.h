/* SPDX-License-Identifier: MIT */
#ifndef TRUTH_CASE_H
#define TRUTH_CASE_H

#include "tests/truth/truth_run.h"

/// A hidden effect: a drive, a nominal model of it that lacks the effect (and is off by a few percent besides), a run
/// to fit and a run to validate, and the answer. The kinds up to truth_kind_dead_time are named like the cause they
/// hide.
enum truth_kind {
    truth_kind_clean,
    truth_kind_viscous_friction,
    truth_kind_coulomb_friction,
    truth_kind_stribeck_friction,
    truth_kind_asymmetric_friction,
    truth_kind_load_bias,
    truth_kind_inertia,
    truth_kind_belt_elasticity,
    truth_kind_cogging,
    truth_kind_torque_lag,
    truth_kind_dead_time,
    truth_kind_quadratic_drag,    ///< not in the catalogue: q v |v|
    truth_kind_position_friction, ///< not in the catalogue: Coulomb friction that grows along the travel
    truth_kind_torque_constant,   ///< not in the catalogue: real torque = T (1 - c T^2), the torque column shows T
    truth_kind_count
};

enum truth_protocol { truth_protocol_any, truth_protocol_multisine, truth_protocol_stroke };

enum { TRUTH_PARAMETERS_MAX = 3 };

struct truth_parameter {
    const char *name;
    double value;
    int sign_free; ///< its sign is a matter of convention: compare sizes
};

struct truth_case {
    enum truth_kind kind;
    uint64_t seed;
    double size;
    enum truth_protocol protocol;
    int periods;
    struct truth_plant_spec truth;   ///< the drive
    struct truth_plant_spec without; ///< the drive without the effect
    struct truth_plant_spec nominal; ///< what is given to the diagnosis: `without`, a few percent off
    struct truth_controller controller;
    struct truth_sensors sensors;
    struct truth_excitation fit, validation;
    double expected_evidence_nats; ///< rough log-likelihood ratio of the truth over the refitted nominal
    int parameters;
    struct truth_parameter parameter[TRUTH_PARAMETERS_MAX];
};

const char *truth_kind_name(enum truth_kind kind);
/// The kind of that name, or truth_kind_count.
enum truth_kind truth_kind_find(const char *name);
/// Whether the effect is one that the diagnosis can name.
int truth_kind_is_catalogued(enum truth_kind kind);

/// Draw a case: same arguments, same case, bit for bit. `size` scales the effect; at 1 the expected evidence is at
/// least 1000 nats (drawn again until it is; the protocol goes to the stroke when the pure multisine cannot show it,
/// unless one is asked for).
void truth_case_make(struct truth_case *self, uint64_t seed, enum truth_kind kind, double size,
                     enum truth_protocol protocol);
/// Write run1.csv, run2.csv and nominal.json into `directory`, which is made if missing.
/// Returns 0, or -1 with a line on stderr.
int truth_case_write(const struct truth_case *self, const char *directory);
/// Write truth.json, the answer, into `directory`. Returns 0, or -1 with a line on stderr.
int truth_case_write_answer(const struct truth_case *self, const char *directory);

#endif
