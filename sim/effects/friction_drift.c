/* SPDX-License-Identifier: MIT */
// Friction changes while the machine runs, mostly falls as it warms up: all friction times 1 + d (1 - exp(-t / T)), t
// since the run began.
#include "sim/effect.h"
#include "sim/model.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

static void drift_oppose(const double *p, const struct sim_motion *motion, struct sim_opposing *io_opposing)
{
    double factor = 1.0 - p[0] * expm1(-motion->time_s / p[1]);
    io_opposing->positive_factor *= factor;
    io_opposing->negative_factor *= factor;
}

static bool drift_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index, double *out)
{
    static const double shares[] = {0.1, 0.3, 1.0, 2.5};
    enum { count = sizeof shares / sizeof shares[0] };
    (void)model;
    if (index >= 2 * count)
        return false;
    out[0] = index < count ? -0.1 : 0.1;
    out[1] = fmin(fmax(shares[index % count] * coverage->duration_s, 1e-3), 1e6);
    return true;
}

/// Neither over before what counts begins nor so slow that it has not begun when that ends: otherwise it is a factor on
/// friction, whatever name that deserves.
static bool drift_testable(const double *p, const struct sim_coverage *coverage, char *out_why, size_t size)
{
    const double least = 0.05; // of the whole drift
    double begin = coverage->start_s, end = coverage->duration_s;
    double seen = exp(-begin / p[1]) - exp(-end / p[1]);
    if (seen >= least)
        return true;
    snprintf(out_why, size,
             "with a time constant of %.3g s %.2g %% of the drift falls between %.3g and %.3g s, it takes %.2g", p[1],
             100.0 * seen, begin, end, 100.0 * least);
    return false;
}

static void drift_say(const struct sim_finding *f, char *out_text, size_t size)
{
    snprintf(out_text, size,
             "All friction drifts by %.3g +- %.2g %% of what it was at the start, with a time constant of %.3g +- %.2g "
             "s.",
             100.0 * f->parameters[0], 100.0 * f->deviations[0], f->parameters[1], f->deviations[1]);
}

const struct sim_effect sim_effect_friction_drift = {
    .id = "friction_drift",
    .place = sim_place_friction_scale,
    .parameter_count = 2,
    .parameters = {{.name = "drift_ratio",
                    .linear_name = "drift_ratio",
                    .kind = sim_parameter_linear,
                    .minimum = -0.95,
                    .maximum = 20.0,
                    .linear_minimum = -0.95,
                    .linear_maximum = 20.0,
                    .model_offset = SIZE_MAX},
                   {.name = "time_constant_s",
                    .linear_name = "time_constant_s",
                    .kind = sim_parameter_positive,
                    .minimum = 1e-3,
                    .maximum = 1e6,
                    .linear_minimum = 1e-3,
                    .linear_maximum = 1e6,
                    .model_offset = SIZE_MAX}},
    .in_time = true,
    .oppose = drift_oppose,
    .scan = drift_scan,
    .testable = drift_testable,
    .measure = "the same excitation for some minutes from a cold start",
    .say = drift_say,
};
