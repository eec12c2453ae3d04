/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/motion.h"

#include "lab/diagnose/oddities.h"
#include "lab/diagnose/recording.h"
#include "lab/numeric/filter.h"
#include "lab/numeric/least_squares.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double turn = 6.283185307179586;

/// Central differences of order 8: at a tenth of the sample rate the error is 4e-5 of the value.
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

/// Squared noise of differentiate()'s output per sample of a position with white noise: what noise adds to the power of
/// a derivative it does not add to its product with the speed column, and a gain would come out too small.
static double derivative_noise(double sigma_p, double rate_hz)
{
    const double squared_weights = 1.36289; // of differentiate(), both sides
    return squared_weights * sigma_p * sigma_p * rate_hz * rate_hz;
}

/// `product` over `power` less the noise in it; one where noise is most of it, which says nothing.
static double gain_beside_noise(double product, double power, double noise)
{
    const double most = 0.75;
    return power > 0.0 && noise < most * power ? product / (power - noise) : 1.0;
}

struct agreement {
    double gain;         ///< of the speed column over the derivative of the position
    double delay;        ///< of the speed column, samples
    double nearest_gain; ///< of the gains at different places of the travel, the one nearest to one
};

enum { places = 8 };

/// Gain of the speed column where it is nearest to one: a sensor that is wrong by position is wrong both ways over the
/// travel, a column in a wrong unit is wrong everywhere.
static double nearest_gain(size_t n, const double *position, const double *derivative, const double *velocity,
                           double noise)
{
    double low = INFINITY, high = -INFINITY, dd[places] = {0}, dv[places] = {0}, all = 0.0, best = INFINITY;
    double samples[places] = {0};
    for (size_t i = 0; i < n; i++) {
        low = fmin(low, position[i]);
        high = fmax(high, position[i]);
    }
    for (size_t i = 6; i + 6 < n && high > low; i++) {
        size_t at = (size_t)fmin((position[i] - low) / (high - low) * places, places - 1);
        dd[at] += derivative[i] * derivative[i];
        dv[at] += derivative[i] * velocity[i];
        samples[at] += 1.0;
        all += derivative[i] * derivative[i];
    }
    const double enough = 0.02; // of the travel's power: a place that was hardly passed says nothing
    bool above = false, below = false;
    for (size_t i = 0; i < places; i++) {
        if (!(dd[i] > enough * all))
            continue;
        double off = gain_beside_noise(dv[i], dd[i], samples[i] * noise) - 1.0;
        above = above || off >= 0.0;
        below = below || off <= 0.0;
        best = fabs(off) < fabs(best) ? off : best;
    }
    return (above && below) || !isfinite(best) ? 1.0 : 1.0 + best;
}

/// Least squares of speed = gain * derivative - delay * d(derivative)/dn.
static struct agreement compare_speed(size_t n, const double *position, const double *derivative,
                                      const double *velocity, double noise)
{
    double dd = 0.0, dv = 0.0, ss = 0.0, se = 0.0;
    for (size_t i = 6; i + 6 < n; i++) {
        double slope = 0.5 * (derivative[i + 1] - derivative[i - 1]);
        dd += derivative[i] * derivative[i];
        dv += derivative[i] * velocity[i];
        ss += slope * slope;
        se += slope * (velocity[i] - derivative[i]);
    }
    struct agreement a = {gain_beside_noise(dv, dd, n > 12 ? (double)(n - 12) * noise : 0.0), ss > 0.0 ? -se / ss : 0.0,
                          nearest_gain(n, position, derivative, velocity, noise)};
    return a;
}

/// Least squares of v[i] = keep v[i-1] + share[0] d[i] + share[1] d[i-1].
static bool fit_low_pass(size_t n, const double *derivative, const double *velocity, double out[3])
{
    size_t rows = n - 1;
    double *A = malloc(4 * rows * sizeof *A);
    if (!A)
        return false;
    memcpy(A, velocity, rows * sizeof *A);
    memcpy(A + rows, derivative + 1, rows * sizeof *A);
    memcpy(A + 2 * rows, derivative, rows * sizeof *A);
    memcpy(A + 3 * rows, velocity + 1, rows * sizeof *A);
    bool good = least_squares_solve(rows, 3, A, A + 3 * rows, NULL, NULL, out, NULL);
    free(A);
    return good;
}

/// Corner in Hz of the first-order low-pass that makes the speed column of the derivative; 0 if none does.
static double find_low_pass(size_t n, double rate_hz, const double *derivative, const double *velocity)
{
    const double alike = 0.05, unexplained = 0.01;
    double x[3], state = velocity[0], rest = 0.0, power = 0.0;
    if (!fit_low_pass(n, derivative, velocity, x) || !(x[0] > 0.0 && x[0] < 1.0))
        return 0.0;
    for (size_t i = 1; i < n; i++) {
        state = x[0] * state + x[1] * derivative[i] + x[2] * derivative[i - 1];
        rest += (velocity[i] - state) * (velocity[i] - state);
        power += velocity[i] * velocity[i];
    }
    bool fits = fabs((x[1] + x[2]) / (1.0 - x[0]) - 1.0) < alike && rest < unexplained * power;
    return fits ? -log(x[0]) * rate_hz / turn : 0.0;
}

/// First-order low-passes, twice forward and twice backward: no phase shift, and steep enough that nothing of the
/// position's images is left in the upper part of the band.
static void low_pass(size_t n, double omega, double *io)
{
    double keep = exp(-omega);
    for (int pass = 0; pass < 2; pass++) {
        double state = 0.0;
        for (size_t i = 0; i < n; i++) {
            state = keep * state + (1.0 - keep) * io[i];
            io[i] = state;
        }
        state = 0.0;
        for (size_t i = n; i-- > 0;) {
            state = keep * state + (1.0 - keep) * io[i];
            io[i] = state;
        }
    }
}

/// Power of the low-passed difference of two columns that stays when an offset, a gain and a delay have been allowed
/// for, and how much of that noise would account for: the scatter of periods or, without them, what white noises let
/// through.
static void measure_difference(size_t n, const double *difference, const double *derivative, size_t period,
                               double white, double *out_power, double *out_noise)
{
    double c[2][3] = {{0}}, offset = 0.0; // normal equations of difference on derivative and its slope
    for (size_t i = 0; i < n; i++)
        offset += difference[i] / (double)n;
    for (size_t i = 1; i + 1 < n; i++) {
        double x[2] = {derivative[i], 0.5 * (derivative[i + 1] - derivative[i - 1])};
        for (size_t a = 0; a < 2; a++) {
            for (size_t b = 0; b < 2; b++)
                c[a][b] += x[a] * x[b];
            c[a][2] += x[a] * (difference[i] - offset);
        }
    }
    double determinant = c[0][0] * c[1][1] - c[0][1] * c[1][0];
    bool apart = determinant > 1e-9 * c[0][0] * c[1][1];
    double gain = apart ? (c[0][2] * c[1][1] - c[1][2] * c[0][1]) / determinant : 0.0;
    double delay = apart ? (c[1][2] * c[0][0] - c[0][2] * c[1][0]) / determinant : 0.0;
    size_t length = period > 0 && n >= 3 * period ? period : n, first = length < n ? period : 0;
    double mean_power = 0.0, scatter = 0.0, count = (double)((n - first) / length);
    for (size_t i = 1; i + 1 < length; i++) {
        double mean = 0.0, square = 0.0;
        for (size_t j = first + i; j + length - i <= n; j += length) {
            double rest = difference[j] - offset - gain * derivative[j] -
                          delay * 0.5 * (derivative[j + 1 < n ? j + 1 : j] - derivative[j - 1]);
            mean += rest / count;
            square += rest * rest / count;
        }
        mean_power += mean * mean / (double)length;
        scatter += (square - mean * mean) / (double)length;
    }
    *out_power = mean_power;
    *out_noise = count >= 2.0 ? scatter / (count - 1.0) : white;
}

/// v + L (d - v) where the two columns agree but for noise; else the speed column as it is: an error of one column
/// below the crossover and of the other above it would be nobody's.
static bool blend(size_t n, double omega, double sigma_v, size_t period, const double *derivative,
                  const double *velocity, double *out)
{
    for (size_t i = 0; i < n; i++)
        out[i] = derivative[i] - velocity[i];
    low_pass(n, omega, out);
    // Four first-order low-passes let 5/32 omega of white noise through; the position's is as strong at the crossover.
    double white = 2.0 * 5.0 / 32.0 * omega * sigma_v * sigma_v, power, noise;
    const double beyond = 2.0;
    measure_difference(n, out, derivative, period, white, &power, &noise);
    bool agree = !(power > beyond * noise);
    for (size_t i = 0; i < n; i++)
        out[i] = agree ? out[i] + velocity[i] : velocity[i];
    return agree;
}

/// Which column is wrong nobody can say from the two alone: the position is kept, because its noise is the smaller one.
static void say_contradiction(const struct agreement *a, char *out_text, size_t size)
{
    double scale;
    const char *unit = NULL;
    for (int linear = 0; linear < 2 && !unit; linear++)
        unit = oddities_unit(a->gain, linear == 1, false, &scale);
    for (int linear = 0; linear < 2 && !unit && a->gain != 0.0; linear++)
        if ((unit = oddities_unit(1.0 / a->gain, linear == 1, true, &scale)))
            scale = 0.0;
    const double nearly = 0.05;
    char hint[120] = "";
    if (fabs(a->gain + 1.0) < nearly)
        snprintf(hint, sizeof hint, " Its sign is wrong (--map with *-1).");
    else if (unit && scale != 0.0)
        snprintf(hint, sizeof hint, " It looks like %s%s (--map with *%.6g).", unit,
                 a->gain < 0.0 ? ", and the wrong sign" : "", scale);
    else if (unit)
        snprintf(hint, sizeof hint, " The position looks like %s.", unit);
    snprintf(out_text, size,
             "The speed column is %.3g times the derivative of the position and %.2g samples late: left out.%s",
             a->gain, a->delay, hint);
}

/// Of a position that walks by what a noisy speed adds per sample and is measured with noise of its own, `ratio` of the
/// two's deviations: the steady gain of the Kalman filter.
static double position_gain(double ratio)
{
    const double only_position = 100.0;
    return ratio < only_position ? 0.5 * ratio * (sqrt(ratio * ratio + 4.0) - ratio) : 1.0;
}

static bool from_both(size_t n, double rate_hz, const double *velocity, size_t period, const double *derivative,
                      struct stretch *out, char *out_text, size_t size)
{
    double sigma_p = white_noise(n, out->position, period), sigma_v = white_noise(n, velocity, period);
    struct agreement a = compare_speed(n, out->position, derivative, velocity, derivative_noise(sigma_p, rate_hz));
    const double most_gain = 0.02, most_delay = 0.1;
    if (fabs(a.nearest_gain - 1.0) > most_gain || fabs(a.delay) > most_delay) {
        // Below its corner a low-pass is a delay: only one that takes something away can be told from that.
        const double visible = 0.8;
        double corner_hz = fabs(a.gain) < visible ? find_low_pass(n, rate_hz, derivative, velocity) : 0.0;
        if (corner_hz > 0.0)
            snprintf(
                out_text, size,
                "The speed column is the derivative of the position through a first-order low-pass at %.3g Hz: left "
                "out.",
                corner_hz);
        else
            say_contradiction(&a, out_text, size);
        return false;
    }
    // Torque is held between samples, so speed has kinks, and position samples see their images as motion: an error of
    // (f / f_s)^2 of the speed. Below a fiftieth of the sample rate that is under a part in two thousand, and fades
    // fast.
    const double most = turn * 0.02;
    double ratio = sigma_p > 0.0 ? sigma_v / (sigma_p * rate_hz) : INFINITY;
    double omega = fmax(fmin(ratio, most), 1e-6);
    bool agree = blend(n, omega, sigma_v, period, derivative, velocity, out->velocity);
    out->position_gain = agree ? position_gain(ratio) : 1.0;
    if (agree)
        snprintf(out_text, size,
                 "Speed: from the position below %.3g Hz, from the speed column above, where each is less noisy.",
                 omega * rate_hz / turn);
    else
        snprintf(out_text, size,
                 "Speed: the speed column, which differs from the derivative of the position by more than noise.");
    return true;
}

static void integrate(size_t n, double rate_hz, const double *velocity, double *out)
{
    out[0] = 0.0;
    for (size_t i = 1; i < n; i++)
        out[i] = out[i - 1] + 0.5 * (velocity[i] + velocity[i - 1]) / rate_hz;
}

/// Continues a periodic signal by `more` samples, so that its last period is differentiated like the others; what it
/// travels from period to period it goes on travelling.
static double *extended(size_t rows, const double *x, size_t period, size_t more)
{
    double travel = 0.0;
    for (size_t i = rows - period; x && rows >= 2 * period && i < rows; i++)
        travel += (x[i] - x[i - period]) / (double)period;
    double *longer = x ? malloc((rows + more) * sizeof *longer) : NULL;
    if (!longer)
        return NULL;
    memcpy(longer, x, rows * sizeof *x);
    for (size_t i = rows; i < rows + more; i++)
        longer[i] = longer[i - period] + travel;
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
        out->kinematics = longer.kinematics;
        out->position_gain = longer.position_gain;
        longer.kinematics = NULL;
    }
    free(longer.kinematics);
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
    bool both = velocity && from_both(rows, rate_hz, velocity, period, derivative, out, out_text, size);
    if (both) {
        out->kinematics = malloc(rows * sizeof *out->kinematics);
        for (size_t i = 0; out->kinematics && i < rows; i++)
            out->kinematics[i] = velocity[i] - derivative[i];
    } else {
        memcpy(out->velocity, derivative, rows * sizeof *derivative);
        if (!velocity && !filtered)
            snprintf(out_text, size, "Speed: derivative of the position (central differences of order 8).");
    }
    free(derivative);
    return !both || out->kinematics;
}
