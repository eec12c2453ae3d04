/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/motion.h"

#include "lab/diagnose/recording.h"
#include "lab/numeric/filter.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double turn = 6.283185307179586;

/// Central differences of order 8: at a tenth of the sampling rate the error is 4e-5 of the value.
static void differentiate(size_t n, double rate_hz, const double *x, double *out)
{
    static const double weights[] = {4.0 / 5, -1.0 / 5, 4.0 / 105, -1.0 / 280};
    for (size_t i = 0; i < n; i++) {
        size_t reach = i < n - 1 - i ? i : n - 1 - i;
        if (reach >= 4) {
            double sum = 0.0;
            for (size_t j = 1; j <= 4; j++)
                sum += weights[j - 1] * (x[i + j] - x[i - j]);
            out[i] = sum * rate_hz;
        } else if (reach >= 1) {
            out[i] = 0.5 * (x[i + 1] - x[i - 1]) * rate_hz;
        } else {
            out[i] = (i == 0 ? x[1] - x[0] : x[i] - x[i - 1]) * rate_hz;
        }
    }
}

/// Standard deviation of the white part of a signal, from third differences: motion is smooth from sample to sample,
/// noise is not. In a periodic run the difference to the period before takes the motion out altogether.
static double white_noise(size_t n, const double *x, size_t period)
{
    double sum = 0.0;
    size_t count = 0;
    double gain = period > 0 ? 40.0 : 20.0; // sum of squares of 1 -3 3 -1, twice for the difference of two periods
    for (size_t i = period + 3; i < n; i++) {
        double d = x[i] - 3 * x[i - 1] + 3 * x[i - 2] - x[i - 3];
        if (period > 0) {
            const double *y = x - period;
            d -= y[i] - 3 * y[i - 1] + 3 * y[i - 2] - y[i - 3];
        }
        sum += d * d;
        count++;
    }
    return count > 0 ? sqrt(sum / (gain * (double)count)) : 0.0;
}

struct agreement {
    double gain;  ///< of the speed column over the derivative of the position
    double delay; ///< of the speed column, samples
};

/// Least squares of speed = gain * derivative - delay * d(derivative)/dn.
static struct agreement compare_speed(size_t n, const double *derivative, const double *velocity)
{
    double dd = 0.0, dv = 0.0, ss = 0.0, se = 0.0;
    for (size_t i = 6; i + 6 < n; i++) {
        double slope = 0.5 * (derivative[i + 1] - derivative[i - 1]);
        dd += derivative[i] * derivative[i];
        dv += derivative[i] * velocity[i];
        ss += slope * slope;
        se += slope * (velocity[i] - derivative[i]);
    }
    struct agreement a = {dd > 0.0 ? dv / dd : 1.0, ss > 0.0 ? -se / ss : 0.0};
    return a;
}

/// v + L (d - v) with L first-order low-passes, twice forward and twice backward: no phase shift, and steep enough that
/// nothing of the position's images is left in the upper part of the band.
static void blend(size_t n, double omega, const double *derivative, const double *velocity, double *out)
{
    double keep = exp(-omega);
    for (size_t i = 0; i < n; i++)
        out[i] = derivative[i] - velocity[i];
    for (int pass = 0; pass < 2; pass++) {
        double state = 0.0;
        for (size_t i = 0; i < n; i++) {
            state = keep * state + (1.0 - keep) * out[i];
            out[i] = state;
        }
        state = 0.0;
        for (size_t i = n; i-- > 0;) {
            state = keep * state + (1.0 - keep) * out[i];
            out[i] = state;
        }
    }
    for (size_t i = 0; i < n; i++)
        out[i] += velocity[i];
}

static bool from_both(size_t n, double rate_hz, const double *velocity, size_t period, const double *derivative,
                      struct stretch *out, char *out_text, size_t size)
{
    struct agreement a = compare_speed(n, derivative, velocity);
    const double most_gain = 0.02, most_delay = 0.1;
    if (fabs(a.gain - 1.0) > most_gain || fabs(a.delay) > most_delay) {
        snprintf(out_text, size,
                 "The speed column is %.3g times the derivative of the position and %.2g samples late: left out.",
                 a.gain, a.delay);
        return false;
    }
    double sigma_p = white_noise(n, out->position, period), sigma_v = white_noise(n, velocity, period);
    // Torque is held between samples, so speed has kinks, and position samples see their images as motion: an error of
    // (f / f_s)^2 of the speed. Below a fiftieth of the sampling rate that is under a part in two thousand, and fades
    // fast.
    const double most = turn * 0.02;
    double omega = sigma_p > 0.0 ? fmin(sigma_v / (sigma_p * rate_hz), most) : most;
    blend(n, fmax(omega, 1e-6), derivative, velocity, out->velocity);
    snprintf(out_text, size,
             "Speed: from the position below %.3g Hz, from the speed column above, where each is less noisy.",
             omega * rate_hz / turn);
    return true;
}

static void integrate(size_t n, double rate_hz, const double *velocity, double *out)
{
    out[0] = 0.0;
    for (size_t i = 1; i < n; i++)
        out[i] = out[i - 1] + 0.5 * (velocity[i] + velocity[i - 1]) / rate_hz;
}

/// Continues a periodic signal by `more` samples, so that its last period is differentiated like the others.
static double *extended(size_t rows, const double *x, size_t period, size_t more)
{
    double *longer = x ? malloc((rows + more) * sizeof *longer) : NULL;
    if (!longer)
        return NULL;
    memcpy(longer, x, rows * sizeof *x);
    for (size_t i = rows; i < rows + more; i++)
        longer[i] = longer[i - period];
    return longer;
}

static bool motion_of_rows(size_t rows, double rate_hz, const double *position, const double *velocity, size_t period,
                           struct stretch *out, char *out_text, size_t size);

bool motion_estimate(size_t rows, double rate_hz, const double *position, const double *velocity, size_t period,
                     struct stretch *out, char *out_text, size_t size)
{
    if (period == 0)
        return motion_of_rows(rows, rate_hz, position, velocity, 0, out, out_text, size);
    size_t more = period < 256 ? period : 256;
    double *longer_position = extended(rows, position, period, more),
           *longer_velocity = extended(rows, velocity, period, more);
    struct stretch longer = {.samples = rows + more,
                             .position = malloc((rows + more) * sizeof(double)),
                             .velocity = malloc((rows + more) * sizeof(double))};
    bool good = (!position || longer_position) && (!velocity || longer_velocity) && longer.position &&
                longer.velocity &&
                motion_of_rows(rows + more, rate_hz, longer_position, longer_velocity, period, &longer, out_text, size);
    if (good) {
        memcpy(out->position, longer.position, rows * sizeof(double));
        memcpy(out->velocity, longer.velocity, rows * sizeof(double));
    }
    free(longer_position);
    free(longer_velocity);
    free(longer.position);
    free(longer.velocity);
    return good;
}

static bool motion_of_rows(size_t rows, double rate_hz, const double *position, const double *velocity, size_t period,
                           struct stretch *out, char *out_text, size_t size)
{
    if (!position) {
        memcpy(out->velocity, velocity, rows * sizeof *velocity);
        integrate(rows, rate_hz, velocity, out->position);
        snprintf(out_text, size, "Position: the integral of the speed column.");
        return true;
    }
    memcpy(out->position, position, rows * sizeof *position);
    double *derivative = malloc(rows * sizeof *derivative);
    if (!derivative)
        return false;
    bool filtered = period == 0 && !velocity;
    if (filtered) {
        struct filter low = filter_butterworth(4, 0.2);
        if (!filter_zero_phase(&low, rows, out->position)) {
            free(derivative);
            return false;
        }
        snprintf(out_text, size,
                 "Speed: derivative of the position after a zero-phase 4th-order Butterworth low-pass at %.3g Hz.",
                 0.1 * rate_hz);
    }
    differentiate(rows, rate_hz, out->position, derivative);
    if (!velocity || !from_both(rows, rate_hz, velocity, period, derivative, out, out_text, size)) {
        memcpy(out->velocity, derivative, rows * sizeof *derivative);
        if (!velocity && !filtered)
            snprintf(out_text, size, "Speed: derivative of the position (central differences of order 8).");
    }
    free(derivative);
    return true;
}
