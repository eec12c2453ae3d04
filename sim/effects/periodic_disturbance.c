/* SPDX-License-Identifier: MIT */
// A sinusoid in time that nothing in the motion explains: an unbalanced neighbour, mains, a pump. a cos(2 pi f t +
// phase) against the motor, t since the run began.
#include "sim/effect.h"
#include "sim/model.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

static const double turn = 6.283185307179586;

static void disturbance_oppose(const double *p, const struct sim_motion *motion, struct sim_opposing *io_opposing)
{
    io_opposing->smooth += p[0] * cos(turn * p[2] * motion->time_s + p[1]);
}

/// The lines that stand out where nothing was excited. Where none were looked for: one between the excited ones.
static bool disturbance_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index,
                             double *out)
{
    (void)model;
    out[0] = 0.01 * coverage->torque_rms;
    out[1] = 0.0;
    if (coverage->tone_count == 0)
        out[2] = fmin(fmax(0.3 * coverage->frequency_max_hz, 1e-4), 1e5);
    else if (index < coverage->tone_count)
        out[2] = fmin(fmax(coverage->tones_hz[index], 1e-4), 1e5);
    return index < (coverage->tone_count > 0 ? coverage->tone_count : 1);
}

/// At constant speed what repeats in time repeats with the position.
static bool disturbance_blind(const struct sim_coverage *coverage, char *out_why, size_t size)
{
    const double constant = 0.999;
    if (!(coverage->steadiness > constant))
        return false;
    snprintf(out_why, size, "the axis moved at constant speed: what repeats in time repeats with the position as well");
    return true;
}

static bool disturbance_testable(const double *p, const struct sim_coverage *coverage, char *out_why, size_t size)
{
    const double fewest = 2.0;
    if (disturbance_blind(coverage, out_why, size))
        return false;
    double periods = p[2] * coverage->duration_s;
    if (periods >= fewest)
        return true;
    snprintf(out_why, size, "%.2g of its periods were recorded, it takes %.2g", periods, fewest);
    return false;
}

static void disturbance_say(const struct sim_finding *f, char *out_text, size_t size)
{
    snprintf(out_text, size,
             "A %s of %.3g +- %.2g %s disturbs the motor at %.6g +- %.2g Hz, whatever the motion (periodic "
             "disturbance).",
             f->linear ? "force" : "torque", f->parameters[0], f->deviations[0], f->linear ? "N" : "Nm",
             f->parameters[2], f->deviations[2]);
}

const struct sim_effect sim_effect_periodic_disturbance = {
    .id = "periodic_disturbance",
    .place = sim_place_motor,
    .parameter_count = 3,
    .parameters = {{.name = "amplitude_Nm",
                    .linear_name = "amplitude_N",
                    .kind = sim_parameter_amplitude,
                    .minimum = 0.0,
                    .maximum = 1e6,
                    .linear_minimum = 0.0,
                    .linear_maximum = 1e9,
                    .model_offset = SIZE_MAX},
                   {.name = "phase_rad",
                    .linear_name = "phase_rad",
                    .kind = sim_parameter_phase,
                    .minimum = -1e3,
                    .maximum = 1e3,
                    .linear_minimum = -1e3,
                    .linear_maximum = 1e3,
                    .model_offset = SIZE_MAX},
                   {.name = "frequency_hz",
                    .linear_name = "frequency_hz",
                    .kind = sim_parameter_positive,
                    .minimum = 1e-4,
                    .maximum = 1e5,
                    .linear_minimum = 1e-4,
                    .linear_maximum = 1e5,
                    .model_offset = SIZE_MAX}},
    .in_time = true,
    .oppose = disturbance_oppose,
    .scan = disturbance_scan,
    .testable = disturbance_testable,
    .blind = disturbance_blind,
    .measure = "the torque at standstill, or at two constant speeds for a minute each",
    .say = disturbance_say,
};
