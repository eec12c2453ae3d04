/* SPDX-License-Identifier: MIT */
#include "lab/tune/gap.h"

#include <math.h>

/// Of a resonance on a machine, undamped: .005 to .01 for a steel frame, .02 to .05 for a belt.
static const double damping_least = 0.01;

/// 30 dB: a pair of damping .01 around 3/5 of the inertia.
static const double rise_most = 31.6;

/// Change per unit of log f and per Hz over lines [first, last].
struct trend {
    bool known;
    double log_magnitude, phase_per_hz;
};

static struct trend find_trend(const struct tune_plant *plant, const double complex *response, size_t first,
                               size_t last)
{
    const double *f = plant->frequency_hz;
    if (first >= last) {
        return (struct trend){.known = false};
    }
    double phase = 0.0;
    for (size_t k = first; k < last; k++) {
        const double turn = tune_plant_known_turn(plant, f[k], f[k + 1]);
        phase += carg(response[k + 1] / response[k] * cexp(-I * turn)) + turn;
    }
    return (struct trend){true, log(cabs(response[last] / response[first])) / log(f[last] / f[first]),
                          phase / (f[last] - f[first])};
}

/// How far off the continuation of its neighbours the step from a line to the next one is, relative.
static double find_bend(const struct tune_plant *plant, const double complex *response, size_t line)
{
    const double *f = plant->frequency_hz;
    const double ratio = f[line + 1] / f[line];
    size_t left = line, right = line + 1;
    // As wide as the step itself: closer lines would magnify noise, wider ones blur the trend.
    while (left > 0 && f[left] * ratio > f[line] * (1.0 + 1e-9)) {
        left--;
    }
    while (right + 1 < plant->count && f[right] < f[line + 1] * ratio * (1.0 - 1e-9)) {
        right++;
    }
    const struct trend below = find_trend(plant, response, left, line);
    const struct trend above = find_trend(plant, response, line + 1, right);
    const double share = below.known && above.known ? 0.5 : 1.0;
    const double log_magnitude = share * (below.log_magnitude + above.log_magnitude) * log(ratio);
    const double phase = share * (below.phase_per_hz + above.phase_per_hz) * (f[line + 1] - f[line]);
    return cabs(response[line + 1] / response[line] * cexp(-log_magnitude - I * phase) - 1.0);
}

double gap_lower_end_hz(const struct tune_plant *plant)
{
    const double ratio_least = 1.2;
    size_t k = 0;
    while (k + 1 < plant->count && plant->frequency_hz[k + 1] > ratio_least * plant->frequency_hz[k]) {
        k++;
    }
    return plant->frequency_hz[k];
}

/// Whether a step there is one of the grid's own, and the loop is above 1 and lags by less than 180 degrees: the circle
/// of a resonance behind its antiresonance, as a drive shows it to its own motor, then lies on the far side of L from
/// -1, whatever its size.
static bool is_lower_end(const struct tune_plant *plant, const double complex *loop, size_t line)
{
    const double ratio_most = 3.0, step_most = 2.5, gain_least = 2.0; // odd lines: 1 and 3
    const double *f = plant->frequency_hz;
    const double step = f[line + 1] - f[line];
    const double below = line > 0 ? f[line] - f[line - 1] : 0.0;
    const double above = line + 2 < plant->count ? f[line + 2] - f[line + 1] : 0.0;
    return f[line + 1] <= gap_lower_end_hz(plant) && f[line + 1] <= ratio_most * f[line] &&
           step <= step_most * fmax(below, above) && cabs(loop[line]) >= gain_least &&
           cabs(loop[line + 1]) >= gain_least && cimag(loop[line]) < 0.0 && cimag(loop[line + 1]) < 0.0;
}

/// A circle through L has to be as wide as -1 is away, and with its tangent along L, which is where a pair leaves from,
/// by |1 + L|/|sin| of the angle wider.
static double reach_at(double complex loop)
{
    const double distance = cabs(1.0 + loop);
    return distance * fmax(distance, 1.0) / cabs(loop);
}

struct gap gap_look(const struct tune_plant *plant, const double complex *response, const double complex *loop,
                    size_t line)
{
    const double *f = plant->frequency_hz;
    const double ratio = f[line + 1] / f[line], square = ratio * ratio;
    const double bend = fmax(find_bend(plant, response, line), 0.25 * (ratio - 1.0) * (ratio - 1.0));
    const bool crosses = (cabs(loop[line]) > 1.0) != (cabs(loop[line + 1]) > 1.0);
    const double reach =
        is_lower_end(plant, loop, line) ? INFINITY : fmin(reach_at(loop[line]), reach_at(loop[line + 1]));
    return (struct gap){.line = line,
                        .rise = fmin(0.25 * bend * (square - 1.0) / (damping_least * (square + 1.0)), rise_most),
                        .reach = crosses ? fmin(reach, 1.0) : reach};
}

size_t gap_find_worst(const struct tune_plant *plant, const double complex *response, const double complex *loop,
                      struct gap *out_worst)
{
    size_t count = 0;
    *out_worst = gap_look(plant, response, loop, 0);
    for (size_t k = 0; k + 1 < plant->count; k++) {
        const struct gap gap = gap_look(plant, response, loop, k);
        count += gap.rise > gap.reach;
        if (gap.rise / gap.reach > out_worst->rise / out_worst->reach) {
            *out_worst = gap;
        }
    }
    return count;
}
