/* SPDX-License-Identifier: MIT */
/// Model files: one JSON object, read into struct sim_model and written from it.
///
///     {
///       "structure": "two_mass",                required: "rigid" or "two_mass"
///       "motor_inertia_kgm2": 0.0004,           at least one inertia; a two-mass drive needs both
///       "load_inertia_kgm2": 0.0047,            carriage mass times pulley radius squared; 0 if left out
///       "belt_stiffness_Nm_per_rad": 60,        required for a two-mass drive, else 0
///       "belt_damping_Nms_per_rad": 0.01,       0
///       "viscous_friction_Nms_per_rad": 0.003,  0
///       "coulomb_friction_Nm": 0.05,            0
///       "torque_lag_s": 0.0005,                 0: no lag
///       "dead_time_s": 0,                       0
///       "pulley_radius_m": 0.0159,              that of sim_model_default
///       "sample_rate_hz": 1000,                 1000
///       "effects": {"cogging": {"amplitude_Nm": 0.03, "periods_per_rev": 12, "phase_rad": 0.4}},
///       "std": {"coulomb_friction_Nm": 0.001},  beside estimated numbers, in an effect's object too; not read
///       "controller": {"position_gain_per_s", "velocity_gain_Nms_per_rad", "velocity_integral_time_s",
///                      "velocity_feedforward", "torque_feedforward"},
///       "sensors": {"counts_per_rev", "position_noise_rad", "velocity_noise_rad_per_s", "torque_noise_Nm",
///                   "velocity_filter_s"},
///       "process_noise_Nm": 0.001, "end_stops_rad": [-10, 10], "seed": 1
///     }
///
/// Defaults of the optional blocks, number by number, are those of sim_model_default, with the velocity gain scaled by
/// the total inertia (the same bandwidth). No end stops unless they are given. A seed above 2^53 is a string of digits,
/// because a JSON number cannot hold it.
///
/// Effects are named as in sim/effects/; every parameter that is not a phase (0 by default) or optional (sim_parameter)
/// has to be there, and all are totals, not differences. An effect whose parameter is a field above (viscous_friction,
/// inertia, torque_lag ...) sets that field, over what the field itself says; belt_elasticity also makes the structure
/// "two_mass". An effect that this build does not know is refused: the model without it would be another drive.
///
/// A linear axis uses the twins of these names and no others: motor_mass_kg (0) and mass_kg, belt_stiffness_N_per_m,
/// belt_damping_Ns_per_m, viscous_friction_Ns_per_m, coulomb_friction_N, velocity_gain_Ns_per_m, counts_per_m,
/// position_noise_m, velocity_noise_m_per_s, force_noise_N, process_noise_N, end_stops_m, and the linear names of
/// effect parameters. One such name, or "linear": true, makes the model linear; its default sensors and noise are the
/// rotary ones seen through the pulley.
///
/// Unknown keys are ignored on reading and not written back. Numbers are written so that they read back bit for bit.
#ifndef SERVOSCOPE_RECORD_MODEL_FILE_H
#define SERVOSCOPE_RECORD_MODEL_FILE_H

#include "lab/record/error.h"
#include "sim/model.h"

#include <stdbool.h>
#include <stddef.h>

/// Standard deviations of what was estimated, written beside it. Strings are borrowed from the caller.
struct model_deviation {
    const char *effect; ///< effect id, or NULL for a field of the base model
    const char *name;   ///< rotary or linear name, as in the file: "amplitude_Nm", "mass_kg"
    double std;         ///< >= 0; 0: known exactly (an integer that was chosen)
};

enum { model_deviations_max = 64 };

struct model_deviations {
    size_t count;
    struct model_deviation entries[model_deviations_max];
};

/// Adds one standard deviation; false if there is no room.
bool model_deviations_add(struct model_deviations *self, const char *effect, const char *name, double std);

/// Reads a model.
/// Errors: error_refused with file, line, key, value and expectation: no JSON, a duplicate or missing key, a
///         wrong type, rotary and linear names together, whatever sim_model_check objects to. *out_model is unspecified
///         then.
/// Test:   tests/unit/test_model_file.c, tests/fault/test_record_files.c
int model_file_read(const char *path, struct sim_model *out_model, struct error *out_error);

/// Writes a model with every field, so that it does not depend on defaults; `deviations` may be NULL.
/// Errors: error_refused if the model is not valid (sim_model_check), a deviation is not finite, or the disk refuses;
///         `path` is as it was then.
/// Test:   tests/unit/test_model_file.c
int model_file_write(const char *path, const struct sim_model *model, const struct model_deviations *deviations,
                     struct error *out_error);

#endif
