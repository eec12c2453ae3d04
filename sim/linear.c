/* SPDX-License-Identifier: MIT */
#include "sim/linear.h"

/// What a belt that is stretched at 1 rad/s pulls: D = d + k / (j w).
static double complex belt_impedance(const struct sim_model *model, double omega)
{
    return model->belt_damping_Nms_per_rad - I * (model->belt_stiffness_Nm_per_rad / omega);
}

void sim_linear_response(const struct sim_model *model, double omega_rad_per_s, struct sim_linear_response *out)
{
    const double complex s = I * omega_rad_per_s;
    const double friction = model->viscous_friction_Nms_per_rad;
    if (model->structure == sim_structure_rigid) {
        out->motor_velocity = 1 / (s * (model->motor_inertia_kgm2 + model->load_inertia_kgm2) + friction);
        out->load_velocity = out->motor_velocity;
        return;
    }
    const double complex belt = belt_impedance(model, omega_rad_per_s);
    const double complex load = s * model->load_inertia_kgm2;
    // The determinant written out, so that D, which is large at low frequencies, meets only what it multiplies.
    const double complex motor = s * model->motor_inertia_kgm2 + friction;
    const double complex determinant = motor * (load + belt) + load * belt;
    out->motor_velocity = (load + belt) / determinant;
    out->load_velocity = belt / determinant;
}

double complex sim_linear_actuator(const struct sim_model *model, double omega_rad_per_s)
{
    return cexp(-I * omega_rad_per_s * model->dead_time_s) / (1 + I * omega_rad_per_s * model->torque_lag_s);
}

size_t sim_linear_sensitivities(const struct sim_model *model, double omega_rad_per_s,
                                double complex out_sensitivities[sim_linear_parameters_max])
{
    struct sim_linear_response response;
    const double complex s = I * omega_rad_per_s;
    sim_linear_response(model, omega_rad_per_s, &response);
    const double complex motor = response.motor_velocity;
    out_sensitivities[sim_linear_inertia] = -s * motor * motor;
    out_sensitivities[sim_linear_viscous_friction] = -motor * motor;
    if (model->structure == sim_structure_rigid) {
        return 2;
    }
    const double complex load = response.load_velocity;
    // v_m - v_l = v_l j w J_l / D: the difference itself would lose its digits where both masses move as one.
    const double complex twist = load * s * model->load_inertia_kgm2 / belt_impedance(model, omega_rad_per_s);
    out_sensitivities[sim_linear_load_inertia] = -s * load * load;
    out_sensitivities[sim_linear_belt_stiffness] = -twist * twist / s;
    out_sensitivities[sim_linear_belt_damping] = -twist * twist;
    return sim_linear_parameters_max;
}
