/* SPDX-License-Identifier: MIT */
#include "sim/model.h"

#include "sim/effect.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

void sim_model_default(struct sim_model *out_model)
{
    memset(out_model, 0, sizeof *out_model);
    out_model->structure = sim_structure_rigid;
    out_model->motor_inertia_kgm2 = 0.00516;
    out_model->pulley_radius_m = 0.0159;
    out_model->sample_rate_hz = 1000.0;
    out_model->seed = 1;
    out_model->controller = (struct sim_controller){
        .position_gain_per_s = 40.0,
        .velocity_gain_Nms_per_rad = 0.6,
        .velocity_integral_time_s = 0.05,
        .velocity_feedforward = 1.0,
        .torque_feedforward = 1.0,
    };
    out_model->sensors = (struct sim_sensors){
        .counts_per_rev = 1048576.0,
        .position_noise_rad = 5e-6,
        .velocity_noise_rad_per_s = 2e-3,
        .torque_noise_Nm = 3e-3,
    };
}

struct range {
    const char *name;
    double value;
    double minimum, maximum;
};

static const char *check_ranges(const struct range *ranges, size_t count, char *buffer, size_t size)
{
    for (size_t i = 0; i < count; i++) {
        const struct range *r = &ranges[i];
        if (!(r->value >= r->minimum && r->value <= r->maximum)) {
            snprintf(buffer, size, "%s: %g is not within %g..%g", r->name, r->value, r->minimum, r->maximum);
            return buffer;
        }
    }
    return NULL;
}

static const char *check_effects(const struct sim_model *model, char *buffer, size_t size)
{
    for (size_t e = 0; sim_effects[e]; e++) {
        if (!model->effect_on[e])
            continue;
        if (sim_effects[e]->place == sim_place_belt && model->structure != sim_structure_two_mass) {
            snprintf(buffer, size, "effects.%s: a drive of two masses is needed, this one is rigid",
                     sim_effects[e]->id);
            return buffer;
        }
        for (size_t i = 0; i < sim_effects[e]->parameter_count; i++) {
            const struct sim_parameter *p = &sim_effects[e]->parameters[i];
            double value = model->effect_parameters[e][i];
            double low = model->linear ? p->linear_minimum : p->minimum;
            double high = model->linear ? p->linear_maximum : p->maximum;
            if (!(value >= low && value <= high)) {
                snprintf(buffer, size, "effects.%s.%s: %g is not within %g..%g", sim_effects[e]->id,
                         model->linear ? p->linear_name : p->name, value, low, high);
                return buffer;
            }
        }
    }
    return NULL;
}

const char *sim_model_check(const struct sim_model *model, char *buffer, size_t size)
{
    const double large = 1e9;
    const double tiny = model->linear ? 1e-6 : 1e-12; // less would make every acceleration overflow
    bool two = model->structure == sim_structure_two_mass;
    const struct range ranges[] = {
        {"sample_rate_hz", model->sample_rate_hz, 1.0, 1e6},
        {"motor_inertia_kgm2", model->motor_inertia_kgm2, two ? tiny : 0.0, large},
        {"load_inertia_kgm2", model->load_inertia_kgm2, two ? tiny : 0.0, large},
        {"motor_inertia_kgm2 + load_inertia_kgm2", model->motor_inertia_kgm2 + model->load_inertia_kgm2, tiny,
         2.0 * large},
        {"belt_stiffness_Nm_per_rad", model->belt_stiffness_Nm_per_rad, two ? tiny : 0.0, 1e12},
        {"belt_damping_Nms_per_rad", model->belt_damping_Nms_per_rad, 0.0, large},
        {"viscous_friction_Nms_per_rad", model->viscous_friction_Nms_per_rad, 0.0, large},
        {"coulomb_friction_Nm", model->coulomb_friction_Nm, 0.0, large},
        {"torque_lag_s", model->torque_lag_s, 0.0, 10.0},
        {"dead_time_s", model->dead_time_s, 0.0, 60.0 / model->sample_rate_hz},
        {"pulley_radius_m", model->pulley_radius_m, 0.0, large},
        {"process_noise_Nm", model->process_noise_Nm, 0.0, large},
        {"controller.position_gain_per_s", model->controller.position_gain_per_s, 0.0, large},
        {"controller.velocity_gain_Nms_per_rad", model->controller.velocity_gain_Nms_per_rad, 0.0, large},
        {"controller.velocity_integral_time_s", model->controller.velocity_integral_time_s, -large, large},
        {"controller.velocity_feedforward", model->controller.velocity_feedforward, 0.0, 1.0},
        {"controller.torque_feedforward", model->controller.torque_feedforward, 0.0, 1.0},
        {"sensors.counts_per_rev", model->sensors.counts_per_rev, 0.0, 1e15},
        {"sensors.position_noise_rad", model->sensors.position_noise_rad, 0.0, large},
        {"sensors.velocity_noise_rad_per_s", model->sensors.velocity_noise_rad_per_s, 0.0, large},
        {"sensors.torque_noise_Nm", model->sensors.torque_noise_Nm, 0.0, large},
        {"sensors.velocity_filter_s", model->sensors.velocity_filter_s, 0.0, 10.0},
    };
    const char *wrong = check_ranges(ranges, sizeof ranges / sizeof ranges[0], buffer, size);
    if (wrong)
        return wrong;
    if (model->has_end_stops && !(model->end_stops_rad[0] < model->end_stops_rad[1])) {
        snprintf(buffer, size, "end_stops_rad: %g, %g: the first has to be below the second", model->end_stops_rad[0],
                 model->end_stops_rad[1]);
        return buffer;
    }
    return check_effects(model, buffer, size);
}

int sim_effect_find(const char *id)
{
    for (size_t e = 0; sim_effects[e]; e++)
        if (strcmp(sim_effects[e]->id, id) == 0)
            return (int)e;
    return -1;
}
