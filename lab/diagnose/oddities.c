/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/oddities.h"

#include "lab/diagnose/gain.h"
#include "lab/diagnose/recording.h"
#include "lab/estimate/period_search.h"
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

static void find_range(const double *x, size_t rows, double *out_low, double *out_high)
{
    *out_low = INFINITY;
    *out_high = -INFINITY;
    for (size_t n = 0; n < rows; n++) {
        *out_low = fmin(*out_low, x[n]);
        *out_high = fmax(*out_high, x[n]);
    }
}

/// Whether a column runs into its extremes instead of coming to rest there: the steps before it stands are as large as
/// its steps are elsewhere.
static bool runs_into(const double *x, size_t rows, double low, double high)
{
    const double share = 0.2;
    double into = 0.0, all = 0.0;
    size_t stops = 0;
    for (size_t n = 1; n < rows; n++)
        all += (x[n] - x[n - 1]) * (x[n] - x[n - 1]);
    for (size_t n = 2; n + 1 < rows; n++)
        if ((x[n] == low || x[n] == high) && x[n + 1] == x[n] && x[n - 1] != x[n]) {
            into += fabs(x[n - 1] - x[n - 2]);
            stops++;
        }
    return stops > 0 && into / (double)stops > share * sqrt(all / (double)(rows - 1));
}

static void say_clipped(const struct run *run, const char *name, bool rests, struct oddities *io)
{
    const double *x = run_column(run, name);
    double low = 0.0, high = 0.0;
    if (x)
        find_range(x, run->rows, &low, &high);
    if (!(high > low) || (rests && !runs_into(x, run->rows, low, high)))
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
    double power[hush_bands], low, high;
    if (!x || run->rows < hush_rows + 3 || !find_noise(x, run->rows, power))
        return;
    find_range(x, run->rows, &low, &high);
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

/// Counts of an encoder: whole numbers and no others.
static int refuse_counts(const struct run *run, struct error *out_error)
{
    const char *name = run->linear ? "position_m" : "position_rad";
    const double *x = run_column(run, name), fewest = 16.0;
    double low = 0.0, high = 0.0;
    for (size_t n = 0; x && n < run->rows; n++)
        if (x[n] != floor(x[n]))
            return 0;
    if (x)
        find_range(x, run->rows, &low, &high);
    if (!(high - low >= fewest))
        return 0;
    return error_set(out_error, error_refused,
                     "%s: %s holds whole numbers only, from %.0f to %.0f: it looks like encoder counts; expected %s "
                     "(--map %s=COLUMN*X with X = %s)",
                     path_of(run), name, low, high, run->linear ? "m" : "rad", name,
                     run->linear ? "metres per count" : "6.283185 / counts per turn");
}

/// Straight line of the measured torque over its reference, at the delay of a few rows at which they go together best.
static double follow(const double *reference, const double *measured, size_t rows, double *out_correlation)
{
    const size_t latest = 8; // rows
    double gain = 0.0;
    *out_correlation = 0.0;
    for (size_t late = 0; late <= latest && late < rows; late++) {
        double n = (double)(rows - late), x = 0.0, y = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;
        for (size_t i = late; i < rows; i++) {
            x += reference[i - late] / n;
            y += measured[i] / n;
        }
        for (size_t i = late; i < rows; i++) {
            double a = reference[i - late] - x, b = measured[i] - y;
            xx += a * a;
            yy += b * b;
            xy += a * b;
        }
        double correlation = xx > 0.0 && yy > 0.0 ? xy / sqrt(xx * yy) : 0.0;
        if (fabs(correlation) > fabs(*out_correlation)) {
            *out_correlation = correlation;
            gain = xy / xx;
        }
    }
    return gain;
}

/// A torque that follows its reference closely, but by another factor than a drive's, has another unit or sign. One
/// that saturates or lags so much that it is halved does not follow closely.
static int refuse_reference(const struct run *run, struct error *out_error)
{
    const double closely = 0.95, most = 2.0;
    struct gain_input input = gain_find_input(run);
    double correlation = 0.0;
    double gain = input.reference ? follow(input.reference, input.measured, run->rows, &correlation) : 0.0;
    if (!(fabs(correlation) > closely) || (gain > 1.0 / most && gain < most))
        return 0;
    const char *quantity = !input.unit            ? run->linear ? "force" : "torque"
                           : input.unit[0] == 'A' ? "current"
                                                  : "voltage";
    const char *unit = input.unit ? input.unit : run->linear ? "N" : "Nm";
    if (fabs(gain) > 1.0 / most && fabs(gain) < most)
        return error_set(
            out_error, error_refused,
            "%s: %s_ref_%s has the opposite sign of %s_%s (correlation %.3f): one of them counts the other "
            "way round (--map %s_ref_%s=COLUMN*-1)",
            path_of(run), quantity, unit, quantity, unit, correlation, quantity, unit);
    return error_set(
        out_error, error_refused,
        "%s: %s_ref_%s is %.3g times %s_%s (correlation %.3f): one of them is in another unit than %s, such "
        "as m%s or a share of the rated %s (--map %s_ref_%s=COLUMN*%.4g)",
        path_of(run), quantity, unit, 1.0 / gain, quantity, unit, correlation, unit, unit, quantity, quantity, unit,
        gain);
}

/// A speed a thousand times what the position makes of the time stamps: these are in ms.
static int refuse_milliseconds(const struct run *run, struct error *out_error)
{
    const double *x = run_column(run, "position_rad"), *v = run_column(run, "velocity_rad_per_s");
    const double *time = run_column(run, "time_s");
    double dd = 0.0, dv = 0.0, vv = 0.0;
    for (size_t n = 1; x && v && time && n + 1 < run->rows; n++) {
        double d = 0.5 * run->sample_rate_hz * (x[n + 1] - x[n - 1]);
        dd += d * d;
        dv += d * v[n];
        vv += v[n] * v[n];
    }
    const double closely = 0.9, thousand = 1000.0, tolerance = 0.1;
    if (!(dv > closely * sqrt(dd * vv)) || !(fabs(dv / dd / thousand - 1.0) < tolerance))
        return 0;
    return error_set(
        out_error, error_refused,
        "%s: the speed is %.4g times the change of the position per time: time_s looks like ms, %.4g Hz in "
        "all; expected s (--map time_s=COLUMN*0.001)",
        path_of(run), dv / dd, run->sample_rate_hz);
}

static void say_repairs(const struct run *run, const struct recording *recording, struct oddities *io)
{
    const struct repair_finding *f = &recording->finding;
    if (f->spikes > 0)
        oddities_add(io,
                     "%s: position or speed jumps away for one row and back at %zu rows, first at row %zu: these rows "
                     "were taken as lost.",
                     path_of(run), f->spikes, f->first_spike + 1);
    if (recording->filled > f->spikes)
        oddities_add(io,
                     "%s: %zu of %zu rows were lost or repeat the one before; they were filled from the rows "
                     "about them%s.",
                     path_of(run), recording->filled - f->spikes, run->rows,
                     recording->periodic ? " and the other periods" : " and do not count as evidence");
    if (recording->turns > 0)
        oddities_add(io, "%s: the position begins anew at every turn, %zu times: it was put together.", path_of(run),
                     recording->turns);
}

int oddities_of_run(const struct run *run, const struct recording *recording, struct oddities *io_oddities,
                    struct error *out_error)
{
    static const char *const names[] = {"torque_ref_Nm", "force_ref_N", "torque_Nm",          "force_N",
                                        "current_A",     "voltage_V",   "velocity_rad_per_s", "velocity_m_per_s"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        say_clipped(run, names[i], false, io_oddities);
    const char *position = run->linear ? "position_m" : "position_rad";
    say_clipped(run, position, true, io_oddities);
    say_jitter(run, io_oddities);
    say_hushed(run, position, io_oddities);
    say_repairs(run, recording, io_oddities);
    int status = refuse_counts(run, out_error);
    if (status == 0)
        status = refuse_reference(run, out_error);
    return status == 0 ? refuse_milliseconds(run, out_error) : status;
}

/// Mean square of what differs from one period to the next, if the period were `period` rows.
static double scatter(const double *x, size_t rows, size_t period)
{
    double sum = 0.0;
    for (size_t n = period; n < rows; n++)
        sum += (x[n] - x[n - period]) * (x[n] - x[n - period]);
    return rows > period ? sum / (double)(rows - period) : INFINITY;
}

static double variance(const double *x, size_t rows)
{
    double mean = 0.0, sum = 0.0;
    for (size_t n = 0; n < rows; n++)
        mean += x[n] / (double)rows;
    for (size_t n = 0; n < rows; n++)
        sum += (x[n] - mean) * (x[n] - mean);
    return sum / (double)rows;
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
    struct period_search search;
    const double nothing = 0.1,
                 nearly_exact = 0.99; // in power, against a signal that does not repeat at all; correlation
    if (best == said && scatter(torque, run->rows, said) > 2.0 * nothing * variance(torque, run->rows) &&
        period_search_run(torque, run->rows, &search) == period_search_ok && search.correlation >= nearly_exact)
        best = search.period_samples;
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

void oddities_of_names(const struct run *runs, size_t count, const struct run *like, struct oddities *io_oddities)
{
    const char *said = like ? run_key(like, "columns_named") : NULL;
    for (size_t i = 0; i < count; i++) {
        const char *names = run_key(&runs[i], "columns_named");
        if (names && (!said || strcmp(names, said) != 0))
            oddities_add(io_oddities, "%s: columns were named by the units in their names: --map %s", path_of(&runs[i]),
                         names);
        said = names ? names : said;
    }
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

/// An inertia off by more than any drive and its model are, with what would make that of it if something would.
static int refuse_inertia(const struct run *run, double inertia, double measured, struct error *out_error)
{
    static const struct {
        double factor;
        const char *rotary, *linear;
    } mistakes[] = {{1e3, "the torque looks like mNm instead of Nm (--map torque_Nm=COLUMN*0.001)",
                     "the force looks like mN instead of N (--map force_N=COLUMN*0.001)"},
                    {1e6, "the time looks like ms instead of s (--map time_s=COLUMN*0.001)",
                     "the time looks like ms instead of s (--map time_s=COLUMN*0.001)"}};
    const double tolerance = 0.1;
    const char *unit = run->linear ? "kg" : "kgm2", *means = "a wrong unit, or a model of something else";
    for (size_t i = 0; i < sizeof mistakes / sizeof mistakes[0]; i++)
        if (fabs(measured / inertia / mistakes[i].factor - 1.0) < tolerance)
            means = run->linear ? mistakes[i].linear : mistakes[i].rotary;
    return error_set(out_error, error_refused,
                     "%s: the torque over the acceleration makes %.3g %s, %.3g times the model's %.3g %s: %s",
                     path_of(run), measured, unit, measured / inertia, inertia, unit, means);
}

/// Both positive: nothing to say of what a model may be off by, a sentence of more, an error of what none is off by.
static int compare_inertia(const struct run *run, double inertia, double measured, bool rigid, struct oddities *io,
                           struct error *out_error)
{
    // Beside a resonance torque and acceleration say little of the whole inertia.
    const double far = rigid ? 3.0 : 10.0, absurd = 100.0;
    double off = fmax(inertia / measured, measured / inertia);
    const char *unit = run->linear ? "kg" : "kgm2";
    if (off > absurd)
        return refuse_inertia(run, inertia, measured, out_error);
    if (off > far)
        oddities_add(io,
                     "%s: the torque over the acceleration makes %.3g %s, the model's %s is %.3g %s: a wrong unit, "
                     "or a model of something else.",
                     path_of(run), measured, unit, run->linear ? "mass" : "inertia", inertia, unit);
    return 0;
}

int oddities_of_inertia(const struct run *run, const struct recording *recording, double inertia, bool rigid,
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
    return compare_inertia(run, inertia, measured, rigid, io_oddities, out_error);
}
