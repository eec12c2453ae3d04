/* SPDX-License-Identifier: MIT */
// The belt's free lengths change along the travel, and its stiffness with them: k (1 + slope th), th = 0 where the
// recording's position is.
#include "sim/effect.h"
#include "sim/model.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

/// However far the axis goes, a belt keeps at least this share of its stiffness.
static const double softest = 0.05;

static double slope_along(const double *p, double position)
{
    return fmax(1.0 + p[0] * position, softest);
}

static void slope_bend(const double *p, const struct sim_motion *motion, struct sim_belt *io_belt)
{
    io_belt->stiffness *= slope_along(p, motion->position);
}

static bool slope_applies(const struct sim_model *model)
{
    return model->structure == sim_structure_two_mass;
}

/// A few percent over the covered travel, or from th = 0 to where the axis is, both ways.
static bool slope_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index, double *out)
{
    static const double changes[] = {0.02, -0.02, 0.2, -0.2};
    (void)model;
    if (index >= sizeof changes / sizeof changes[0])
        return false;
    out[0] = changes[index] / fmax(coverage->position_span, fabs(coverage->position_mean));
    return true;
}

static bool slope_testable(const double *p, const struct sim_coverage *coverage, char *out_why, size_t size)
{
    const double least = 1e-3;
    double change = fabs(p[0]) * coverage->position_span;
    if (change >= least)
        return true;
    snprintf(out_why, size, "stiffness changes by %.2g %% over the travel, it takes %.2g %%", 100.0 * change,
             100.0 * least);
    return false;
}

static bool slope_blind(const struct sim_coverage *coverage, char *out_why, size_t size)
{
    const double usual_turn = 6.283185307179586;
    if (coverage->linear || coverage->position_span > usual_turn / 4.0)
        return false;
    snprintf(out_why, size, "%.3f of a turn was covered: a stiffness that changes along the travel needs more of it",
             coverage->position_span / usual_turn);
    return true;
}

static void slope_say(const struct sim_finding *f, char *out_text, size_t size)
{
    snprintf(out_text, size, "The belt gets %.3g +- %.2g %% %s per %s of travel in positive direction.",
             100.0 * fabs(f->parameters[0]), 100.0 * f->deviations[0], f->parameters[0] > 0.0 ? "stiffer" : "softer",
             f->linear ? "metre" : "rad");
}

const struct sim_effect sim_effect_position_dependent_stiffness = {
    .id = "position_dependent_stiffness",
    .place = sim_place_belt,
    .parameter_count = 1,
    .parameters = {{.name = "stiffness_slope_per_rad",
                    .linear_name = "stiffness_slope_per_m",
                    .kind = sim_parameter_linear,
                    .minimum = -1e3,
                    .maximum = 1e3,
                    .linear_minimum = -1e5,
                    .linear_maximum = 1e5,
                    .model_offset = SIZE_MAX}},
    .bend = slope_bend,
    .along = slope_along,
    .along_offset = offsetof(struct sim_model, belt_stiffness_Nm_per_rad),
    .applies = slope_applies,
    .scan = slope_scan,
    .testable = slope_testable,
    .blind = slope_blind,
    .measure = "the same excitation at both ends of the travel",
    .say = slope_say,
};
