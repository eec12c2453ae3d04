/* SPDX-License-Identifier: MIT */
// Torque ripple bound to the motor's angle: a cos(n th + phase); on a linear motor a cos(2 pi x / period + phase).
#include "sim/effect.h"
#include "sim/model.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

static const double turn = 6.283185307179586;

/// Ripple phase per rad or m: the third parameter counts periods per turn, or is the period in m.
static double phase_rate(double third, bool linear)
{
    return linear ? turn / third : third;
}

static void cogging_oppose(const double *p, const struct sim_motion *motion, struct sim_opposing *io_opposing)
{
    io_opposing->smooth += p[0] * cos(phase_rate(p[2], motion->linear) * motion->position + p[1]);
}

/// Ripple needs room to show: from 1.5 periods over the covered span, in steps that half a period at its end cannot
/// slip through, up to 110.
static bool cogging_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index, double *out)
{
    const double fewest = 1.5, step = 0.2, most = 110.0;
    double periods = fewest + step * (double)index;
    double rate = turn * periods / coverage->position_span;
    out[0] = 0.01 * coverage->torque_rms;
    out[1] = 0.0;
    out[2] = model->linear ? turn / rate : rate;
    return periods <= most;
}

static bool cogging_testable(const double *p, const struct sim_coverage *coverage, char *out_why, size_t size)
{
    double periods = phase_rate(p[2], coverage->linear) * coverage->position_span / turn;
    const double fewest = 1.5;
    if (periods >= fewest)
        return true;
    snprintf(out_why, size, "%.2g periods of the ripple were covered, it takes %.2g", periods, fewest);
    return false;
}

/// A motor's ripple usually repeats at least twelve times a turn; on a linear axis the pitch is not known beforehand.
static bool cogging_blind(const struct sim_coverage *coverage, char *out_why, size_t size)
{
    const double fewest = 1.5, usual = 12.0;
    if (coverage->linear || coverage->position_span > turn * fewest / usual)
        return false;
    snprintf(out_why, size, "%.3f of a turn was covered: ripple that repeats fewer than %.0f times a turn cannot show",
             coverage->position_span / turn, ceil(turn * fewest / coverage->position_span));
    return true;
}

static void cogging_say(const struct sim_finding *f, char *out_text, size_t size)
{
    if (f->linear)
        snprintf(out_text, size, "A force ripple of %.4g +- %.2g N repeats every %.5g m of travel (cogging).",
                 f->parameters[0], f->deviations[0], f->parameters[2]);
    else
        snprintf(out_text, size, "A torque ripple of %.4g +- %.2g Nm repeats %.5g times a turn (cogging).",
                 f->parameters[0], f->deviations[0], f->parameters[2]);
}

const struct sim_effect sim_effect_cogging = {
    .id = "cogging",
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
                   {.name = "periods_per_rev",
                    .linear_name = "period_m",
                    .kind = sim_parameter_positive,
                    .minimum = 0.01,
                    .maximum = 1e4,
                    .linear_minimum = 1e-9,
                    .linear_maximum = 1e3,
                    .model_offset = SIZE_MAX}},
    .oppose = cogging_oppose,
    .scan = cogging_scan,
    .testable = cogging_testable,
    .blind = cogging_blind,
    .measure = "one slow turn at constant speed, or a slow stroke under the excitation",
    .say = cogging_say,
};
