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
            *io_finding = f;
    }
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
