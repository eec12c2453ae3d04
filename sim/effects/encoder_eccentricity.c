/* SPDX-License-Identifier: MIT */
// The encoder's disc runs out of true: it says th + a cos(th + phase). A speed that is derived from it is wrong with
// it, v (1 - r a sin(th + phase)) with r = 1; one from a sensor of its own is not, r = 0. On a linear axis the encoder
// is the motor's and th the position over the pulley's radius.
// Two columns alone show a (1 - r): r is one or the other.
#include "sim/effect.h"
#include "sim/model.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

static const double turn = 6.283185307179586;

static void eccentricity_sense(const double *p, const struct sim_motion *motion, struct sim_sensed *io_sensed)
{
    double angle = motion->position / motion->radius + p[1];
    io_sensed->position += p[0] * cos(angle);
    io_sensed->velocity -= p[2] * p[0] / motion->radius * sin(angle) * motion->velocity;
}

/// With the speed from the encoder, then with a speed of its own.
static bool eccentricity_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index,
                              double *out)
{
    (void)coverage;
    out[0] = model->linear ? 1e-3 * model->pulley_radius_m : 1e-3;
    out[1] = 0.0;
    out[2] = index == 0 ? 1.0 : 0.1;
    return index < 2 && out[0] > 0.0;
}

/// Turns that a recording covers; a recording of a linear axis does not know its pulley: a usual one.
static double covered_turns(const struct sim_coverage *coverage)
{
    const double usual_radius_m = 0.0159;
    return coverage->position_span / (turn * (coverage->linear ? usual_radius_m : 1.0));
}

static bool eccentricity_testable(const double *p, const struct sim_coverage *coverage, char *out_why, size_t size)
{
    const double fewest = 0.6;
    double turns = covered_turns(coverage);
    (void)p;
    if (turns >= fewest)
        return true;
    snprintf(out_why, size, "%.2g of a turn was covered, it takes %.2g", turns, fewest);
    return false;
}

static bool eccentricity_blind(const struct sim_coverage *coverage, char *out_why, size_t size)
{
    return !coverage->linear && !eccentricity_testable(NULL, coverage, out_why, size);
}

static void eccentricity_say(const struct sim_finding *f, char *out_text, size_t size)
{
    snprintf(out_text, size,
             "The measured %s is wrong by up to %.3g +- %.2g %s, once a %s (encoder out of true); the measured speed "
             "carries %.0f %% of that.",
             f->linear ? "position" : "angle", f->parameters[0], f->deviations[0], f->linear ? "m" : "rad",
             f->linear ? "revolution of the pulley" : "turn", 100.0 * f->parameters[2]);
}

const struct sim_effect sim_effect_encoder_eccentricity = {
    .id = "encoder_eccentricity",
    .place = sim_place_sensor,
    .parameter_count = 3,
    .parameters = {{.name = "amplitude_rad",
                    .linear_name = "amplitude_m",
                    .kind = sim_parameter_amplitude,
                    .minimum = 0.0,
                    .maximum = 0.3,
                    .linear_minimum = 0.0,
                    .linear_maximum = 0.3,
                    .model_offset = SIZE_MAX},
                   {.name = "phase_rad",
                    .linear_name = "phase_rad",
                    .kind = sim_parameter_phase,
                    .minimum = -1e3,
                    .maximum = 1e3,
                    .linear_minimum = -1e3,
                    .linear_maximum = 1e3,
                    .model_offset = SIZE_MAX},
                   {.name = "speed_error_ratio",
                    .linear_name = "speed_error_ratio",
                    .kind = sim_parameter_linear,
                    .minimum = 0.0,
                    .maximum = 1.0,
                    .linear_minimum = 0.0,
                    .linear_maximum = 1.0,
                    .optional = true,
                    .usual = 1.0,
                    .near_whole = 0.05,
                    .model_offset = SIZE_MAX}},
    .sense = eccentricity_sense,
    .scan = eccentricity_scan,
    .testable = eccentricity_testable,
    .blind = eccentricity_blind,
    .measure = "at least one turn at constant speed, or a slow stroke over more than a turn under the excitation",
    .say = eccentricity_say,
};
