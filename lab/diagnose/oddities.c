/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/oddities.h"

#include "lab/diagnose/recording.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
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

void oddities_of_run(const struct run *run, const struct recording *recording, struct oddities *io_oddities)
{
    static const char *const names[] = {"torque_ref_Nm", "force_ref_N", "torque_Nm", "force_N"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        say_clipped(run, names[i], io_oddities);
    static const char *const motion[] = {"velocity_rad_per_s", "velocity_m_per_s"};
    for (size_t i = 0; i < sizeof motion / sizeof motion[0]; i++)
        say_clipped(run, motion[i], io_oddities);
    say_jitter(run, io_oddities);
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
