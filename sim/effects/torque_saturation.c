/* SPDX-License-Identifier: MIT */
// The drive makes no more than so much torque, whatever is asked for: a clip behind dead time and lag, so that the
// measured torque shows it.
#include "sim/effect.h"
#include "sim/model.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

static double saturation_limit(const double *p, double torque)
{
    return fmin(fmax(torque, -p[0]), p[0]);
}

/// A clip lies at the largest torque that is measured, or below where noise adds to it.
static bool saturation_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index,
                            double *out)
{
    static const double shares[] = {0.99, 0.95, 0.85, 0.7, 0.5};
    (void)model;
    if (index >= sizeof shares / sizeof shares[0])
        return false;
    double peak = coverage->torque_peak > 0.0 ? coverage->torque_peak : 3.0 * coverage->torque_rms;
    out[0] = fmax(shares[index] * peak, coverage->linear ? 1e-6 : 1e-9);
    return true;
}

/// Only a torque that was asked for and not made shows a limit.
static bool saturation_testable(const double *p, const struct sim_coverage *coverage, char *out_why, size_t size)
{
    if (p[0] < coverage->reference_peak)
        return true;
    snprintf(out_why, size, "no more than %.3g %s was asked for", coverage->reference_peak,
             coverage->linear ? "N" : "Nm");
    return false;
}

static void saturation_say(const struct sim_finding *f, char *out_text, size_t size)
{
    snprintf(out_text, size, "The drive makes no more than %.4g +- %.2g %s, even where more is asked for (saturation).",
             f->parameters[0], f->deviations[0], f->linear ? "N" : "Nm");
}

const struct sim_effect sim_effect_torque_saturation = {
    .id = "torque_saturation",
    .place = sim_place_actuator,
    .parameter_count = 1,
    .parameters = {{.name = "torque_limit_Nm",
                    .linear_name = "torque_limit_N",
                    .kind = sim_parameter_positive,
                    .minimum = 1e-9,
                    .maximum = 1e6,
                    .linear_minimum = 1e-6,
                    .linear_maximum = 1e9,
                    .model_offset = SIZE_MAX}},
    .limit = saturation_limit,
    .scan = saturation_scan,
    .testable = saturation_testable,
    .measure = "at a level that asks for more torque",
    .say = saturation_say,
};
