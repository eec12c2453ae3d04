/* SPDX-License-Identifier: MIT */
#include "lab/design/report_rows.h"

#include <math.h>
#include <string.h>

static const double two_pi = 6.283185307179586;

void report_rows_make(const struct design_request *request, const struct design_result *result,
                      struct report_row rows[report_rows])
{
    const bool linear = request->linear;
    const struct design_limits *limits = &request->limits;
    const struct design_peaks *at = &result->peak;
    const struct design_peaks *between = &result->peak_continuous;
    const struct report_row all[report_rows] = {
        [report_torque] = {.name = linear ? "force" : "torque",
                           .unit = linear ? "N" : "Nm",
                           .series = result->torque_Nm,
                           .limit = limits->torque_Nm,
                           .peak = at->torque_Nm,
                           .peak_continuous = between->torque_Nm},
        [report_velocity] = {.name = "velocity",
                             .unit = linear ? "m/s" : "rad/s",
                             .series = result->velocity_rad_per_s,
                             .limit = limits->velocity_rad_per_s,
                             .peak = at->velocity_rad_per_s,
                             .peak_continuous = between->velocity_rad_per_s},
        [report_position] = {.name = "position",
                             .unit = linear ? "m" : "rad",
                             .series = result->position_rad,
                             .limit = limits->position_rad,
                             .peak = at->position_rad,
                             .peak_continuous = between->position_rad},
        [report_acceleration] = {.name = "acceleration",
                                 .unit = linear ? "m/s²" : "rad/s²",
                                 .series = result->acceleration_rad_per_s2,
                                 .limit = limits->acceleration_rad_per_s2,
                                 .peak = at->acceleration_rad_per_s2,
                                 .peak_continuous = between->acceleration_rad_per_s2},
    };
    memcpy(rows, all, sizeof all);
    for (size_t i = 0; i < report_rows; i++) {
        const bool between_too = request->grid == design_grid_continuous;
        const double peak = between_too ? fmax(rows[i].peak, rows[i].peak_continuous) : rows[i].peak;
        rows[i].used = rows[i].limit > 0 ? peak / rows[i].limit : 0;
    }
}

void report_rows_amplitudes(const struct design_request *request, const struct design_result *result,
                            double *out_frequency_hz, double *out_torque_Nm, double *out_velocity_rad_per_s)
{
    const double rate_hz = (double)request->rate_num_hz / request->rate_den;
    const double line_hz = rate_hz / (double)result->period_samples;
    for (size_t k = 0; k < result->bin_count; k++) {
        const double omega = two_pi * line_hz * result->bins[k];
        out_frequency_hz[k] = line_hz * result->bins[k];
        out_velocity_rad_per_s[k] = omega * result->amplitude_rad[k];
        out_torque_Nm[k] = request->inertia_kgm2 * omega * omega * result->amplitude_rad[k];
    }
}
