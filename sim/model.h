/* SPDX-License-Identifier: MIT */
/// The one model of a drive: both what stands in for hardware and what diagnosis corrects.
/// Numbers are seen from the motor. On a linear axis (`linear`) the same fields hold the twins: kg for kgm2, N for Nm,
/// m for rad. A model is plain data; files are read and written by lab/record/model_file.h.
#ifndef SERVOSCOPE_SIM_MODEL_H
#define SERVOSCOPE_SIM_MODEL_H

#include "sim/effect.h"

#include <stdbool.h>
#include <stdint.h>

enum sim_structure { sim_structure_rigid, sim_structure_two_mass };

/// Cascade: velocity command = position_gain (ref - pos) + velocity feed-forward;
/// torque command = velocity_gain (cmd - vel) + integral + torque feed-forward.
struct sim_controller {
    double position_gain_per_s;
    double velocity_gain_Nms_per_rad;
    double velocity_integral_time_s; ///< <= 0: no integral part
    double velocity_feedforward;     ///< 0..1
    double torque_feedforward;       ///< 0..1
};

struct sim_sensors {
    double counts_per_rev; ///< encoder resolution (counts per rad times 2 pi; per m on a linear axis); 0: unquantised
    double position_noise_rad; ///< standard deviations, white
    double velocity_noise_rad_per_s;
    double torque_noise_Nm;
    double velocity_filter_s; ///< time constant of the speed signal's first-order filter, 0: none
};

struct sim_model {
    enum sim_structure structure;
    bool linear;
    double motor_inertia_kgm2;
    double load_inertia_kgm2;
    double belt_stiffness_Nm_per_rad;
    double belt_damping_Nms_per_rad;
    double viscous_friction_Nms_per_rad;
    double coulomb_friction_Nm;
    double torque_lag_s;
    double dead_time_s;
    double pulley_radius_m;
    double sample_rate_hz;
    double process_noise_Nm; ///< white torque on the motor, standard deviation per sample
    bool has_end_stops;
    double end_stops_rad[2];
    uint64_t seed;
    struct sim_controller controller;
    struct sim_sensors sensors;
    bool effect_on[sim_effects_max]; ///< indexed like sim_effects
    double effect_parameters[sim_effects_max][sim_effect_parameters_max];
};

/// The belt drive of the first paper with usual friction and sensors: every field valid.
void sim_model_default(struct sim_model *out_model);

/// First thing wrong with a model as one line (field, value, expectation), or NULL. The text lives in `buffer`.
const char *sim_model_check(const struct sim_model *model, char *buffer, size_t size);

#endif
