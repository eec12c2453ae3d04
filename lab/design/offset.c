/* SPDX-License-Identifier: MIT */
#include "lab/design/offset.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;
static const double shortest_fade_s = 0.05;
static const double longest_fade_s = 10.0;
/// 1.5 times Bohr's pi / 2, over the 2 pi of the lowest line's angular frequency.
static const double fade_in_lowest_periods = 0.375;

static bool has_stroke(const struct design_offset *self)
{
    return self->stroke_rad > 0;
}

static bool has_bias(const struct design_offset *self)
{
    return fabs(self->bias_velocity_rad_per_s) > 0;
}

/// Periods of the multisine in one of the table.
static size_t repetitions(const struct design_offset *self)
{
    return has_stroke(self) ? self->stroke_periods : 1;
}

static double table_period_s(const struct design_offset *self, const struct design_request *request)
{
    return (double)repetitions(self) * (double)request->period_samples * request->rate_den / request->rate_num_hz;
}

static int check_stroke(const struct design_offset *self, const struct design_request *request, struct error *out_error)
{
    if (!(self->stroke_rad >= 0 && isfinite(self->stroke_rad))) {
        return error_set(out_error, error_usage, "stroke: %g %s, expected a positive number", self->stroke_rad,
                         request->linear ? "m" : "rad");
    }
    if (!has_stroke(self)) {
        return 0;
    }
    const size_t most = design_period_samples_max / request->period_samples;
    if (self->stroke_periods < 2 || self->stroke_periods > most) {
        return error_set(out_error, error_usage,
                         "stroke: %zu periods of the multisine, expected 2 to %zu (a table has at most %d samples)",
                         self->stroke_periods, most, (int)design_period_samples_max);
    }
    return 0;
}

static int check_offset(const struct design_offset *self, const struct design_request *request, struct error *out_error)
{
    const char *unit = request->linear ? "m/s" : "rad/s";
    if (request->rate_num_hz == 0 || request->rate_den == 0 || request->period_samples == 0 ||
        request->bin_count == 0 || !request->bins || request->bins[0] == 0) {
        return error_set(out_error, error_usage, "stroke and bias velocity: expected a rate, a period and lines first");
    }
    int status = check_stroke(self, request, out_error);
    if (status) {
        return status;
    }
    if (!isfinite(self->bias_velocity_rad_per_s)) {
        return error_set(out_error, error_usage, "bias velocity: %g %s, expected a finite number",
                         self->bias_velocity_rad_per_s, unit);
    }
    if (has_bias(self) && request->torque_mode) {
        return error_set(out_error, error_usage,
                         "bias velocity: %g %s, expected none in torque mode, in which nothing holds a speed",
                         self->bias_velocity_rad_per_s, unit);
    }
    if (has_bias(self) && request->limits.position_rad > 0 && self->played_periods == 0) {
        return error_set(out_error, error_usage,
                         "bias velocity: %g %s with a position limit, expected the number of periods that will be "
                         "played, settling ones included",
                         self->bias_velocity_rad_per_s, unit);
    }
    return 0;
}

/// What the offset takes of one limit; both parts are proportional to their cause.
struct share {
    const char *name, *unit;
    double *limit; ///< 0: does not limit
    double stroke, bias;
    bool travelled; ///< by the bias velocity in all periods
};

static void describe_taken(const struct design_offset *self, const struct share *share, char *out_text, size_t size)
{
    char stroke[48] = "";
    char bias[96] = "";
    if (share->stroke > 0) {
        snprintf(stroke, sizeof stroke, "the stroke takes %.4g of it", share->stroke);
    }
    if (share->bias > 0 && share->travelled) {
        snprintf(bias, sizeof bias, "the bias velocity takes %.4g of it in %zu periods and the fades", share->bias,
                 self->played_periods);
    } else if (share->bias > 0) {
        snprintf(bias, sizeof bias, "the bias velocity takes %.4g of it", share->bias);
    }
    snprintf(out_text, size, "%s%s%s", stroke, stroke[0] && bias[0] ? " and " : "", bias);
}

static void describe_accepted(const struct design_offset *self, const struct share *share, bool linear, char *out_text,
                              size_t size)
{
    char stroke[64] = "";
    char bias[64] = "";
    const double limit = *share->limit;
    if (share->stroke > 0 && share->bias < limit) {
        snprintf(stroke, sizeof stroke, "a stroke below %.4g %s",
                 self->stroke_rad * (limit - share->bias) / share->stroke, linear ? "m" : "rad");
    }
    if (share->bias > 0 && share->stroke < limit) {
        snprintf(bias, sizeof bias, "a bias velocity below %.4g %s",
                 fabs(self->bias_velocity_rad_per_s) * (limit - share->stroke) / share->bias, linear ? "m/s" : "rad/s");
    }
    snprintf(out_text, size, "%s%s%s", stroke, stroke[0] && bias[0] ? ", or " : "", bias);
}

static int refuse_share(const struct design_offset *self, const struct share *share, bool linear,
                        struct error *out_error)
{
    char taken[160];
    char accepted[160];
    describe_taken(self, share, taken, sizeof taken);
    describe_accepted(self, share, linear, accepted, sizeof accepted);
    return error_set(out_error, error_refused,
                     "%s limit of %.6g %s: %s, which leaves nothing for the multisine; expected %s", share->name,
                     *share->limit, share->unit, taken, accepted[0] ? accepted : "both to be smaller");
}

int design_offset_reduce(const struct design_offset *self, const struct design_request *request,
                         struct design_limits *out_limits, struct error *out_error)
{
    int status = check_offset(self, request, out_error);
    if (status) {
        return status;
    }
    const bool linear = request->linear;
    const double period_s = table_period_s(self, request);
    const double omega = two_pi / period_s;
    // With a stroke its own line is the lowest.
    const double lowest = has_stroke(self) ? 1 : request->bins[0];
    const double fade_s = fmin(fmax(fade_in_lowest_periods * period_s / lowest, shortest_fade_s), longest_fade_s);
    const double speed = fabs(self->bias_velocity_rad_per_s);
    const double travel = speed * ((double)self->played_periods * period_s + fade_s);
    const double acceleration = omega * omega * self->stroke_rad;
    struct design_limits limits = request->limits;
    const struct share shares[] = {
        {"position", linear ? "m" : "rad", &limits.position_rad, self->stroke_rad, travel, true},
        {"velocity", linear ? "m/s" : "rad/s", &limits.velocity_rad_per_s, omega * self->stroke_rad, speed, false},
        {"acceleration", linear ? "m/s2" : "rad/s2", &limits.acceleration_rad_per_s2, acceleration, 0, false},
        {linear ? "force" : "torque", linear ? "N" : "Nm", &limits.torque_Nm, request->inertia_kgm2 * acceleration, 0,
         false},
    };
    for (size_t i = 0; i < sizeof shares / sizeof shares[0]; i++) {
        const double left = *shares[i].limit - shares[i].stroke - shares[i].bias;
        if (*shares[i].limit > 0 && !(left > 0)) {
            return refuse_share(self, &shares[i], linear, out_error);
        }
        *shares[i].limit = *shares[i].limit > 0 ? left : *shares[i].limit;
    }
    *out_limits = limits;
    return 0;
}

enum { series_count = 4 };

static void list_series(struct design_result *result, double **out_series[series_count])
{
    out_series[0] = &result->torque_Nm;
    out_series[1] = &result->position_rad;
    out_series[2] = &result->velocity_rad_per_s;
    out_series[3] = &result->acceleration_rad_per_s2;
}

/// Each series `count` times, one after the other.
static int repeat(struct design_result *result, size_t count, struct error *out_error)
{
    const size_t period = result->period_samples;
    double **series[series_count];
    double *longer[series_count] = {NULL};
    bool complete = true;
    list_series(result, series);
    for (size_t i = 0; i < series_count; i++) {
        longer[i] = malloc(count * period * sizeof(double));
        complete = complete && longer[i];
    }
    for (size_t i = 0; i < series_count; i++) {
        for (size_t p = 0; p < count && complete; p++) {
            memcpy(longer[i] + p * period, *series[i], period * sizeof(double));
        }
        free(complete ? *series[i] : longer[i]);
        *series[i] = complete ? longer[i] : *series[i];
    }
    if (!complete) {
        return error_set(out_error, error_refused, "memory is short for a table of %zu samples", count * period);
    }
    result->period_samples = count * period;
    for (size_t k = 0; k < result->bin_count; k++) {
        result->bins[k] *= (uint32_t)count;
    }
    return 0;
}

/// Phase of A cos(omega t + phase) at start_index.
static double stroke_phase(const struct design_offset *self, const struct design_request *request,
                           const struct design_result *result)
{
    const double half_turn = two_pi / 2;
    if (!request->torque_mode) {
        return self->bias_velocity_rad_per_s < 0 ? half_turn / 2 : -half_turn / 2;
    }
    return result->acceleration_rad_per_s2[result->start_index] > 0 ? 0 : half_turn;
}

static void add_stroke(const struct design_offset *self, const struct design_request *request,
                       struct design_result *result)
{
    const double omega = two_pi / table_period_s(self, request);
    const double phase = stroke_phase(self, request, result);
    const size_t period = result->period_samples;
    for (size_t n = 0; n < period; n++) {
        const size_t since_start = (n + period - result->start_index) % period;
        const double angle = two_pi * (double)since_start / (double)period + phase;
        const double acceleration = -omega * omega * self->stroke_rad * cos(angle);
        result->position_rad[n] += self->stroke_rad * cos(angle);
        result->velocity_rad_per_s[n] -= omega * self->stroke_rad * sin(angle);
        result->acceleration_rad_per_s2[n] += acceleration;
        result->torque_Nm[n] += request->inertia_kgm2 * acceleration;
    }
    result->peak_continuous.position_rad += self->stroke_rad;
    result->peak_continuous.velocity_rad_per_s += omega * self->stroke_rad;
    result->peak_continuous.acceleration_rad_per_s2 += omega * omega * self->stroke_rad;
    result->peak_continuous.torque_Nm += request->inertia_kgm2 * omega * omega * self->stroke_rad;
}

static double peak_of(const double *series, size_t count)
{
    double peak = 0;
    for (size_t n = 0; n < count; n++) {
        peak = fmax(peak, fabs(series[n]));
    }
    return peak;
}

int design_offset_add(const struct design_offset *self, const struct design_request *request,
                      struct design_result *io_result, struct error *out_error)
{
    int status = check_offset(self, request, out_error);
    if (status) {
        return status;
    }
    if (has_stroke(self)) {
        status = repeat(io_result, self->stroke_periods, out_error);
        if (status) {
            return status;
        }
        add_stroke(self, request, io_result);
    }
    const size_t period = io_result->period_samples;
    for (size_t n = 0; n < period; n++) {
        io_result->velocity_rad_per_s[n] += self->bias_velocity_rad_per_s;
    }
    io_result->travel_per_period_rad = self->bias_velocity_rad_per_s * table_period_s(self, request);
    io_result->peak_continuous.velocity_rad_per_s += fabs(self->bias_velocity_rad_per_s);
    io_result->peak = (struct design_peaks){
        .position_rad = peak_of(io_result->position_rad, period),
        .velocity_rad_per_s = peak_of(io_result->velocity_rad_per_s, period),
        .acceleration_rad_per_s2 = peak_of(io_result->acceleration_rad_per_s2, period),
        .torque_Nm = peak_of(io_result->torque_Nm, period),
    };
    return 0;
}
