/* SPDX-License-Identifier: MIT */
// Dry friction does not switch where motion reverses: it builds up over a distance, dF/dx = s Fd (1 - s F / Fd)^n /
// distance, Fd the level that Coulomb's and all other dry friction sets (Dahl's model with exponent n). With n = 1 it
// comes near its level as an exponential does; the smaller n, the more it goes straight there, as springs do that give
// way all at once.
// Bristles are damped, too: while the friction changes it is more by a time times its rate (LuGre's sigma1 / sigma0).
#include "sim/effect.h"
#include "sim/model.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

/// Below this the motor is as good as stuck: motion estimated from a measurement is no finer. Rad, and m.
static const double least = 1e-4, linear_least = 1e-6;
/// Where a search begins, as a share of that: no dry friction switches, and the shorter way shows next to reversals.
static const double finest = 0.06;

static double presliding_build_up(const double *p, double *out_exponent, double *out_damping_s)
{
    *out_damping_s = p[2];
    *out_exponent = p[1] > 0.0 ? p[1] : 1.0;
    return p[0];
}

static bool presliding_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index,
                            double *out)
{
    const double growth = 3.2;
    double start = coverage->linear ? linear_least : least;
    (void)model;
    out[0] = finest * start * pow(growth, (double)index);
    out[1] = 1.0;
    out[2] = 1e-4;
    return index == 0 || (index < 11 && out[0] < 0.2 * coverage->position_span);
}

static bool presliding_testable(const double *p, const struct sim_coverage *coverage, char *out_why, size_t size)
{
    double low = coverage->linear ? linear_least : least, high = 0.5 * coverage->position_span;
    if (p[0] >= low && p[0] <= high)
        return true;
    snprintf(out_why, size, "its distance %.2g %s is outside of %.2g..%.2g, where this motion could show it", p[0],
             coverage->linear ? "m" : "rad", low, high);
    return false;
}

/// Dry friction of every drive builds up over a few atoms to a few asperities: Coulomb's switch is the simpler word.
static bool presliding_detail(const double *p, bool linear)
{
    return p[0] < (linear ? linear_least : least);
}

static void presliding_say(const struct sim_finding *f, char *out_text, size_t size)
{
    snprintf(
        out_text, size,
        "After a reversal dry friction builds up over %.3g +- %.2g %s of motion instead of switching (presliding).",
        f->parameters[0], f->deviations[0], f->linear ? "m" : "rad");
}

/// There has to be dry friction for it to build up.
static bool presliding_applies(const struct sim_model *model)
{
    return model->coulomb_friction_Nm > 0.0;
}

const struct sim_effect sim_effect_presliding = {
    .id = "presliding",
    .place = sim_place_friction,
    .parameter_count = 3,
    .parameters = {{.name = "presliding_distance_rad",
                    .linear_name = "presliding_distance_m",
                    .kind = sim_parameter_positive,
                    .minimum = 1e-7,
                    .maximum = 10.0,
                    .linear_minimum = 1e-9,
                    .linear_maximum = 1.0,
                    .model_offset = SIZE_MAX},
                   {.name = "presliding_exponent",
                    .linear_name = "presliding_exponent",
                    .kind = sim_parameter_positive,
                    .minimum = 0.1,
                    .maximum = 3.0,
                    .linear_minimum = 0.1,
                    .linear_maximum = 3.0,
                    .optional = true,
                    .usual = 1.0,
                    .model_offset = SIZE_MAX},
                   {.name = "presliding_damping_s",
                    .linear_name = "presliding_damping_s",
                    .kind = sim_parameter_linear,
                    .minimum = 0.0,
                    .maximum = 0.01,
                    .linear_minimum = 0.0,
                    .linear_maximum = 0.01,
                    .optional = true,
                    .usual = 0.0,
                    .model_offset = SIZE_MAX}},
    .build_up = presliding_build_up,
    .applies = presliding_applies,
    .scan = presliding_scan,
    .testable = presliding_testable,
    .detail = presliding_detail,
    .measure = "small and slow motions with many reversals",
    .say = presliding_say,
};
