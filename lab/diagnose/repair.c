/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/repair.h"

#include "lab/diagnose/gain.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double *either(const struct run *run, const char *rotary, const char *linear)
{
    return run_column(run, run->linear ? linear : rotary);
}

static void notice(const struct run *run, bool *rows, bool *io_lost, struct repair_finding *io_finding)
{
    struct sim_columns columns = {.rows = run->rows,
                                  .sample_rate_hz = run->sample_rate_hz,
                                  .torque = gain_find_input(run).measured,
                                  .position = either(run, "position_rad", "position_m"),
                                  .velocity = either(run, "velocity_rad_per_s", "velocity_m_per_s")};
    double doubt = 12.0 + 0.5 * log((double)run->rows);
    for (int e = 0; sim_effects[e]; e++) {
        struct repair_finding f = {.effect = e};
        if (!sim_effects[e]->notice || !sim_effects[e]->notice(&columns, f.values, f.deviations, &f.evidence, rows) ||
            !(f.evidence > doubt))
            continue;
        for (size_t n = 0; n < run->rows; n++)
            io_lost[n] = io_lost[n] || rows[n];
        if (io_finding->effect < 0 || f.evidence > io_finding->evidence)
            *io_finding = f; // spikes are looked for after this
    }
}

/// Turn of which an angle holds only the rest: jumps by one, no other step of more than a tenth; 0 if there is none.
static double find_turn(size_t rows, const double *x, size_t *out_jumps)
{
    static const double turns[] = {6.283185307179586, 360.0, 1.0};
    const double near = 0.1;
    double low = INFINITY, high = -INFINITY, step = 0.0, least = INFINITY;
    size_t jumps = 0;
    for (size_t n = 0; n < rows; n++) {
        low = fmin(low, x[n]);
        high = fmax(high, x[n]);
    }
    for (size_t n = 1; n < rows; n++) {
        double d = fabs(x[n] - x[n - 1]);
        bool jump = d > 0.5 * (high - low);
        jumps += jump;
        if (jump)
            least = fmin(least, d);
        else
            step = fmax(step, d);
    }
    *out_jumps = jumps;
    for (size_t i = 0; jumps > 0 && i < sizeof turns / sizeof turns[0]; i++)
        if (high - low <= (1.0 + 1e-6) * turns[i] && least > (1.0 - near) * turns[i] && step < near * turns[i])
            return turns[i];
    return 0.0;
}

size_t repair_unwrap(size_t rows, double *io_position)
{
    size_t jumps;
    double turn = find_turn(rows, io_position, &jumps), added = 0.0, before = rows > 0 ? io_position[0] : 0.0;
    for (size_t n = 1; turn > 0.0 && n < rows; n++) {
        double now = io_position[n];
        added += now - before > 0.5 * turn ? -turn : now - before < -0.5 * turn ? turn : 0.0;
        before = now;
        io_position[n] += added;
    }
    return turn > 0.0 ? jumps : 0;
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/// How far row n is from the middle of its neighbours.
static double off_neighbours(const double *x, size_t n)
{
    return fabs(x[n] - 0.5 * (x[n - 1] + x[n + 1]));
}

/// Marks single rows that are far off both neighbours, which agree with each other: nothing that has a mass does that.
static void find_spikes(size_t rows, const double *x, double *work, bool *io_lost, struct repair_finding *io_finding)
{
    const double far = 20.0, of_range = 0.02, agree = 0.25, nearly_all = 0.99, most = 0.003;
    double low = x[0], high = x[0];
    for (size_t n = 1; n + 1 < rows; n++) {
        work[n - 1] = off_neighbours(x, n);
        low = fmin(low, x[n]);
        high = fmax(high, x[n]);
    }
    qsort(work, rows - 2, sizeof *work, ascending);
    double usual = work[(size_t)(nearly_all * (double)(rows - 2))], least = fmax(far * usual, of_range * (high - low));
    for (int marking = 0; marking < 2; marking++) {
        size_t count = 0;
        for (size_t n = 1; n + 1 < rows; n++) {
            double off = off_neighbours(x, n);
            if (!(off > least) || !(fabs(x[n + 1] - x[n - 1]) < agree * off))
                continue;
            count++;
            if (!marking || io_lost[n])
                continue;
            io_lost[n] = true;
            if (io_finding->spikes++ == 0 || n < io_finding->first_spike)
                io_finding->first_spike = n;
        }
        if ((double)count > most * (double)rows)
            return; // so many are the signal
    }
}

static void notice_spikes(const struct run *run, bool *io_lost, struct repair_finding *io_finding)
{
    const double *columns[] = {either(run, "position_rad", "position_m"),
                               either(run, "velocity_rad_per_s", "velocity_m_per_s")};
    double *copy = malloc(2 * run->rows * sizeof *copy);
    for (size_t i = 0; copy && run->rows > 2 && i < 2; i++) {
        if (!columns[i])
            continue;
        memcpy(copy, columns[i], run->rows * sizeof *copy);
        if (i == 0 && !run->linear)
            repair_unwrap(run->rows, copy); // an angle that dithers about its zero does not jump away
        find_spikes(run->rows, copy, copy + run->rows, io_lost, io_finding);
    }
    free(copy);
}

size_t repair_find(const struct run *run, bool *out_lost, struct repair_finding *out_finding)
{
    const double *valid = run_column(run, "valid");
    bool *rows = calloc(run->rows, sizeof *rows);
    size_t count = 0;
    *out_finding = (struct repair_finding){.effect = -1};
    for (size_t n = 0; n < run->rows; n++)
        out_lost[n] = valid && valid[n] == 0.0;
    if (rows)
        notice(run, rows, out_lost, out_finding);
    free(rows);
    notice_spikes(run, out_lost, out_finding);
    for (size_t n = 0; n < run->rows; n++)
        count += out_lost[n];
    return count;
}

/// Value between the rows a and b, the last measured one before a gap and the first after it.
static double between(size_t rows, const bool *lost, const double *x, size_t a, size_t b, size_t n)
{
    double width = (double)(b - a), u = (double)(n - a) / width, rise = x[b] - x[a];
    double slope_a = a > 0 && !lost[a - 1] ? width * (x[a] - x[a - 1]) : rise;
    double slope_b = b + 1 < rows && !lost[b + 1] ? width * (x[b + 1] - x[b]) : rise;
    return x[a] + u * (slope_a + u * (3 * rise - 2 * slope_a - slope_b + u * (slope_a + slope_b - 2 * rise)));
}

struct repairing {
    size_t rows, period;
    size_t first; ///< row from which on rows count for the mean
    const bool *lost;
    double *mean;  ///< per phase of the period
    size_t *count; ///< measured rows per phase
};

/// Mean over the periods but the first, which holds the transient of the start.
static void average(const struct repairing *r, const double *x)
{
    for (size_t n = r->first; n < r->rows; n++) {
        size_t phase = n % r->period;
        if (r->lost[n])
            continue;
        r->count[phase]++;
        r->mean[phase] += (x[n] - r->mean[phase]) / (double)r->count[phase];
    }
}

static bool all_phases_known(const struct repairing *r, size_t first, size_t last)
{
    for (size_t n = first; n <= last; n++)
        if (r->count[n % r->period] < 2)
            return false;
    return true;
}

/// How far a measured row is from the mean of the other periods, which is what a row within the gap is compared with.
static double deviation(const struct repairing *r, const double *x, size_t n)
{
    size_t phase = n % r->period;
    double own = x[n] - r->mean[phase];
    return n < r->first ? own : own * (double)r->count[phase] / (double)(r->count[phase] - 1);
}

static void fill_gap(const struct repairing *r, size_t a, size_t b, double *x)
{
    bool known = r->period > 0 && all_phases_known(r, a, b);
    double at_a = known ? deviation(r, x, a) : 0.0, at_b = known ? deviation(r, x, b) : 0.0;
    for (size_t n = a + 1; n < b; n++) {
        double u = (double)(n - a) / (double)(b - a);
        x[n] = known ? r->mean[n % r->period] + at_a + u * (at_b - at_a) : between(r->rows, r->lost, x, a, b, n);
    }
}

static void fill(const struct repairing *r, double *x)
{
    for (size_t n = 0; n < r->rows; n++) {
        if (!r->lost[n])
            continue;
        size_t end = n;
        while (end < r->rows && r->lost[end])
            end++;
        if (n > 0 && end < r->rows)
            fill_gap(r, n - 1, end, x);
        else
            for (size_t i = n; i < end; i++)
                x[i] = n > 0 ? x[n - 1] : end < r->rows ? x[end] : 0.0;
        n = end;
    }
}

bool repair_fill(size_t rows, const bool *lost, size_t period, double *io_column)
{
    struct repairing r = {.rows = rows, .period = period, .lost = lost};
    r.first = rows >= 3 * period ? period : 0;
    r.mean = calloc(period + 1, sizeof *r.mean);
    r.count = calloc(period + 1, sizeof *r.count);
    bool good = r.mean && r.count;
    if (good && period > 0)
        average(&r, io_column);
    if (good)
        fill(&r, io_column);
    free(r.mean);
    free(r.count);
    return good;
}
