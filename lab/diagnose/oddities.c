/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/oddities.h"

#include "lab/diagnose/recording.h"
#include "lab/numeric/fft.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void oddities_add(struct oddities *self, const char *format, ...)
{
    va_list arguments;
    if (self->count == oddities_max)
        return;
    va_start(arguments, format);
    vsnprintf(self->texts[self->count], sizeof self->texts[0], format, arguments);
    va_end(arguments);
    for (size_t i = 0; i < self->count; i++)
        if (strcmp(self->texts[i], self->texts[self->count]) == 0)
            return;
    self->count++;
}

static const char *path_of(const struct run *run)
{
    return run->path ? run->path : "run";
}

/// Rows in stretches of three or more that all stand at the column's largest or smallest value.
static size_t rows_at(const double *x, size_t rows, double limit)
{
    const size_t fewest = 3;
    size_t count = 0;
    for (size_t n = 0; n < rows; n++) {
        size_t first = n;
        while (n < rows && x[n] == limit)
            n++;
        count += n - first >= fewest ? n - first : 0;
    }
    return count;
}

static void say_clipped(const struct run *run, const char *name, struct oddities *io)
{
    const double *x = run_column(run, name);
    double low = INFINITY, high = -INFINITY;
    for (size_t n = 0; x && n < run->rows; n++) {
        low = fmin(low, x[n]);
        high = fmax(high, x[n]);
    }
    if (!x || !(high > low))
        return;
    size_t top = rows_at(x, run->rows, high), bottom = rows_at(x, run->rows, low);
    // A motor that rests at the end of its travel stands at one extreme as well, a clipped signal mostly at both.
    const double least_share = 0.002;
    if ((double)(top + bottom) < least_share * (double)run->rows || top == 0 || bottom == 0)
        return;
    oddities_add(io,
                 "%s: %s stands at its largest value (%.4g) in %zu rows and at its smallest (%.4g) in %zu: it is "
                 "clipped; what was beyond is not in the recording.",
                 path_of(run), name, high, top, low, bottom);
}

static void say_jitter(const struct run *run, struct oddities *io)
{
    const double *time = run_column(run, "time_s");
    const double least = 0.05; // of a sample
    if (!time || run->rows < 3)
        return;
    double mean = (time[run->rows - 1] - time[0]) / (double)(run->rows - 1), sum = 0.0;
    for (size_t n = 0; n < run->rows; n++) {
        double off = (time[n] - time[0] - mean * (double)n) / mean;
        sum += off * off;
    }
    double rms = sqrt(sum / (double)run->rows);
    if (rms > least && rms < 1e3)
        oddities_add(
            io, "%s: the time stamps wander by %.2g samples (RMS) about %.6g Hz; rows are taken as equally spaced.",
            path_of(run), rms, 1.0 / mean);
}

enum { hush_rows = 4096, hush_bands = 40 };

/// Power of a column's noise in bands of equal width up to half the rate, from third differences, which leave little of
/// the motion to leak; false if memory is short.
static bool find_noise(const double *x, size_t rows, double out_power[hush_bands])
{
    struct fft_plan *plan = fft_plan_create(hush_rows);
    double *in = calloc(4 * hush_rows, sizeof *in);
    bool good = plan && in;
    memset(out_power, 0, hush_bands * sizeof *out_power);
    for (size_t from = 3; good && from + hush_rows <= rows; from += hush_rows / 2) {
        for (size_t i = 0; i < hush_rows; i++) {
            const double *at = x + from + i;
            double taper = sin(3.14159265358979324 * ((double)i + 0.5) / hush_rows);
            in[2 * i] = taper * taper * taper * taper * (at[0] - 3.0 * at[-1] + 3.0 * at[-2] - at[-3]);
            in[2 * i + 1] = 0.0;
        }
        fft_forward(plan, in, in + 2 * hush_rows);
        for (size_t k = 1; k < hush_rows / 2; k++) {
            const double *out = in + 2 * hush_rows + 2 * k;
            double gain = pow(2.0 * sin(3.14159265358979324 * (double)k / hush_rows), 6.0);
            out_power[k * hush_bands * 2 / hush_rows] += (out[0] * out[0] + out[1] * out[1]) / gain;
        }
    }
    if (plan)
        fft_plan_destroy(plan);
    free(in);
    return good;
}

/// A position whose noise is gone at high frequencies, as no sensor's is.
static void say_hushed(const struct run *run, const char *name, struct oddities *io)
{
    const double *x = run_column(run, name);
    double power[hush_bands], low = INFINITY, high = -INFINITY;
    if (!x || run->rows < hush_rows + 3 || !find_noise(x, run->rows, power))
        return;
    for (size_t n = 0; n < run->rows; n++) {
        low = fmin(low, x[n]);
        high = fmax(high, x[n]);
    }
    // Per band there are so many bins, each with the power of a window's squared taper (35/128 of the rows).
    double bins = hush_rows / 2.0 / hush_bands, windows = floor(((double)run->rows - 3.0) / (hush_rows / 2.0)) - 1.0;
    double quiet = power[hush_bands - 2],
           deviation = sqrt(quiet / (bins * fmax(windows, 1.0) * hush_rows * 35.0 / 128.0));
    const double finest = 1e-9, about = 10.0;
    if (!(deviation < finest * (high - low)))
        return;
    size_t from = hush_bands - 2;
    while (from > 0 && power[from - 1] < about * quiet)
        from--;
    oddities_add(
        io,
        "%s: above %.3g Hz %s resolves %.1g of its range, which no sensor does: it was low-pass filtered before "
        "it was recorded, or simulated. The noise found in it is less than the sensor's.",
        path_of(run), 0.5 * run->sample_rate_hz * (double)from / hush_bands, name, deviation / (high - low));
}

void oddities_of_run(const struct run *run, const struct recording *recording, struct oddities *io_oddities)
{
    static const char *const names[] = {"torque_ref_Nm", "force_ref_N", "torque_Nm", "force_N"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        say_clipped(run, names[i], io_oddities);
    static const char *const motion[] = {"velocity_rad_per_s", "velocity_m_per_s"};
    for (size_t i = 0; i < sizeof motion / sizeof motion[0]; i++)
        say_clipped(run, motion[i], io_oddities);
    say_jitter(run, io_oddities);
    say_hushed(run, run->linear ? "position_m" : "position_rad", io_oddities);
    if (recording->filled > 0)
        oddities_add(io_oddities,
                     "%s: %zu of %zu rows were lost or repeat the one before; they were filled from the rows "
                     "about them%s.",
                     path_of(run), recording->filled, run->rows,
                     recording->periodic ? " and the other periods" : " and do not count as evidence");
}

/// Mean square of what differs from one period to the next, if the period were `period` rows.
static double scatter(const double *x, size_t rows, size_t period)
{
    double sum = 0.0;
    for (size_t n = period; n < rows; n++)
        sum += (x[n] - x[n - period]) * (x[n] - x[n - period]);
    return rows > period ? sum / (double)(rows - period) : INFINITY;
}

size_t oddities_period(const struct run *run, const double *torque, struct oddities *io_oddities)
{
    size_t said = run->period_samples, best = said;
    const size_t shortest = 16;
    if (!torque || said < shortest || run->rows < 3 * said)
        return said;
    const double clearly = 0.1; // in power
    double least = clearly * scatter(torque, run->rows, said);
    for (size_t n = said - 1; n <= said + 1; n += 2) {
        double s = scatter(torque, run->rows, n);
        if (s < least) {
            least = s;
            best = n;
        }
    }
    if (best != said)
        oddities_add(io_oddities, "%s: period_samples says %zu, but the torque repeats every %zu rows: that was taken.",
                     path_of(run), said, best);
    return best;
}

struct unit {
    double factor; ///< how much too large the column's numbers are
    const char *name;
};

static const struct unit angles[] = {{57.29577951308232, "degrees instead of rad"},
                                     {0.15915494309189535, "turns instead of rad"}};
static const struct unit speeds[] = {{57.29577951308232, "degrees/s instead of rad/s"},
                                     {9.549296585513721, "rpm instead of rad/s"},
                                     {0.15915494309189535, "turns/s instead of rad/s"}};
static const struct unit lengths[] = {
    {1000.0, "mm instead of m"}, {1e6, "um instead of m"}, {100.0, "cm instead of m"}};

const char *oddities_unit(double factor, bool linear, bool motion, double *out_scale)
{
    const double tolerance = 0.05;
    const struct unit *units = linear ? lengths : motion ? angles : speeds;
    size_t count = linear   ? sizeof lengths / sizeof lengths[0]
                   : motion ? sizeof angles / sizeof angles[0]
                            : sizeof speeds / sizeof speeds[0];
    for (size_t i = 0; i < count; i++)
        if (fabs(fabs(factor) / units[i].factor - 1.0) < tolerance) {
            *out_scale = copysign(1.0 / units[i].factor, factor);
            return units[i].name;
        }
    return NULL;
}

/// Torque over acceleration, both without their mean; 0 if they do not go together at all.
static double measured_inertia(const struct recording *r)
{
    const struct stretch *b = &r->block;
    double ta = 0.0, aa = 0.0, tt = 0.0, mean = 0.0;
    for (size_t n = 0; n < b->samples; n++)
        mean += b->torque[n] / (double)b->samples;
    for (size_t n = 1; n + 1 < b->samples; n++) {
        double a = 0.5 * r->rate_hz * (b->velocity[n + 1] - b->velocity[n - 1]), t = b->torque[n] - mean;
        ta += t * a;
        aa += a * a;
        tt += t * t;
    }
    const double least_correlation = 0.5;
    return fabs(ta) > least_correlation * sqrt(aa * tt) ? ta / aa : 0.0;
}

int oddities_of_inertia(const struct run *run, const struct recording *recording, double inertia,
                        struct oddities *io_oddities, struct error *out_error)
{
    double measured = measured_inertia(recording), scale;
    bool linear = recording->linear;
    const char *name = linear ? "mass" : "inertia", *unit = linear ? "kg" : "kgm2";
    if (measured == 0.0 || !(inertia > 0.0))
        return 0;
    // Too large numbers of the motion make the inertia too small. A wrong inertia is a cause; a unit is a mistake.
    double factor = inertia / measured;
    const char *what = fabs(factor) > 6.0 || fabs(factor) < 0.2 ? oddities_unit(factor, linear, true, &scale) : NULL;
    if (what)
        return error_set(
            out_error, error_refused,
            "%s: the motion is %.3g times what the model's %s of %.4g %s makes of the torque: it looks like %s; "
            "expected %s (--map %s=COLUMN*%.6g)",
            path_of(run), fabs(factor), name, inertia, unit, what, linear ? "m" : "rad",
            linear ? "position_m" : "position_rad", fabs(scale));
    if (measured < 0.0)
        return error_set(
            out_error, error_refused,
            "%s: positive torque makes the motion accelerate backward: the sign of the torque or of the motion "
            "is wrong (--map %s=COLUMN*-1)",
            path_of(run), linear ? "force_N" : "torque_Nm");
    const double far = 3.0;
    if (factor > far || factor < 1.0 / far)
        oddities_add(io_oddities,
                     "%s: the torque over the acceleration is a %s of %.3g %s, the model has %.3g: a wrong unit, "
                     "or a model of something else.",
                     path_of(run), name, measured, unit, inertia);
    return 0;
}
