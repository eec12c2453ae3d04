/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/blackbox.h"

#include "lab/numeric/least_squares.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    speed_knots = 7,     // per direction
    position_knots = 11, // over the covered span
    balance_knots = 127, // where torque is held against the position: ripple of 60 periods over the span
    direction_knots = 5,
    filter_taps = 6,
};

static const size_t group_sizes[blackbox_groups] = {2 * speed_knots + 2, position_knots, direction_knots,
                                                    2 * filter_taps + 3};

const char *blackbox_group_name(enum blackbox_group group)
{
    static const char *const names[blackbox_groups] = {"a function of speed", "a function of position",
                                                       "friction that changes with position",
                                                       "a linear filter or a gain"};
    return names[group];
}

/// Expected size of a filter tap the model lacks, as a share of the torque.
static const double tap_deviation = 0.03;

/// Triangular basis function number `knot` of `count` over 0..1.
static double hat(double u, size_t knot, size_t count)
{
    return fmax(0.0, 1.0 - fabs(u * (double)(count - 1) - (double)knot));
}

/// Speeds are dense near zero, so knots are: u = sqrt(|v| / peak).
static double speed_function(double peak, double v, size_t index)
{
    if (index == 2 * speed_knots)
        return v; // the knots are no straight line, and this function is one that models have
    if (index == 2 * speed_knots + 1)
        return v * fabs(v);
    bool negative = index >= speed_knots;
    if ((v < 0.0) != negative)
        return 0.0;
    double u = sqrt(fmin(fabs(v) / peak, 1.0));
    return hat(u, index % speed_knots, speed_knots);
}

static const double *driving_signal(const struct recording *r)
{
    return r->block.torque_ref ? r->block.torque_ref : r->block.torque;
}

static size_t back(const struct recording *r, size_t n, size_t steps)
{
    size_t samples = r->block.samples;
    if (n >= steps)
        return n - steps;
    return r->periodic ? n + samples - steps : 0;
}

struct builder {
    const struct recording *r;
    double low, span, peak; ///< of position and speed: where the knots are
    double torque_rms;
    size_t knots; ///< of functions of position
};

static struct builder builder_on(const struct recording *r, size_t knots)
{
    struct builder b = {.r = r,
                        .low = r->block.position[0],
                        .span = r->coverage.position_span,
                        .peak = r->coverage.velocity_peak,
                        .torque_rms = r->coverage.torque_rms,
                        .knots = knots};
    for (size_t n = 0; n < r->block.samples; n++)
        b.low = fmin(b.low, r->block.position[n]);
    return b;
}

static double position_function(const struct builder *b, double x, size_t index, size_t knots)
{
    return hat((x - b->low) / b->span, index, knots);
}

/// Filter regressor number `index` at sample n: taps of the torque, taps of the change of speed, on either channel.
static void filter_function(const struct builder *b, size_t n, size_t index, double *out_mechanics,
                            double *out_actuator)
{
    const struct recording *r = b->r;
    const double *u = driving_signal(r);
    double torque = u[n], scale = 1.0 / b->torque_rms;
    *out_mechanics = *out_actuator = 0.0;
    if (r->block.still && index < group_sizes[blackbox_filter] - 1)
        return; // what is to be explained is the torque itself
    if (index < filter_taps)
        *out_mechanics = u[back(r, n, index)];
    else if (index < 2 * filter_taps)
        *out_actuator = u[back(r, n, index - filter_taps)];
    else if (index == 2 * filter_taps)
        *out_mechanics = torque * torque * torque * scale * scale;
    else if (index == 2 * filter_taps + 1)
        *out_actuator = torque * torque * torque * scale * scale;
    else
        *out_mechanics = r->block.position[n];
}

static void regressor(const struct builder *b, enum blackbox_group group, size_t index, size_t n, double *out_mechanics,
                      double *out_actuator)
{
    const struct recording *r = b->r;
    size_t last = r->block.samples - 1, next = n < last ? n + 1 : r->periodic ? 0 : last;
    double v = 0.5 * (r->block.velocity[n] + r->block.velocity[next]);
    double x = r->block.position[n];
    *out_actuator = 0.0;
    switch (group) {
    case blackbox_speed:
        *out_mechanics = speed_function(b->peak, v, index);
        break;
    case blackbox_position:
        *out_mechanics = position_function(b, x, index, b->knots);
        break;
    case blackbox_direction:
        *out_mechanics = (v > 0.0 ? 1.0 : -1.0) * position_function(b, x, index, direction_knots);
        break;
    case blackbox_filter:
    case blackbox_groups:
        filter_function(b, n, index, out_mechanics, out_actuator);
        break;
    }
}

/// like: the recording whose range the knots divide; NULL: its own.
static bool build_run(const struct blackbox *self, const struct evidence *evidence, const struct recording *like,
                      size_t values, size_t offset)
{
    const struct recording *r = evidence->recording;
    size_t samples = r->block.samples;
    double *signal = malloc(2 * samples * sizeof *signal);
    if (!signal)
        return false;
    struct builder b =
        builder_on(like ? like : r, self->group_begin[blackbox_position + 1] - self->group_begin[blackbox_position]);
    b.r = r;
    for (int group = 0; group < blackbox_groups; group++)
        for (size_t i = 0; self->group_begin[group] + i < self->group_begin[group + 1]; i++) {
            for (size_t n = 0; n < samples; n++)
                regressor(&b, (enum blackbox_group)group, i, n, &signal[n], &signal[samples + n]);
            evidence_whiten(evidence, signal, signal + samples,
                            self->matrix + (self->group_begin[group] + i) * values + offset);
        }
    free(signal);
    return true;
}

static bool init_like(struct blackbox *self, const struct fit_data *data, const struct recording *like)
{
    memset(self, 0, sizeof *self);
    bool still = data->runs > 0 && data->evidence[0].recording->block.still;
    size_t knots = data->values / 6; // most of what there is has to stay noise
    knots = knots > balance_knots ? balance_knots : knots < position_knots ? position_knots : knots;
    for (int group = 0; group < blackbox_groups; group++) {
        size_t size = still && group == blackbox_position ? knots : group_sizes[group];
        self->group_begin[group + 1] = self->group_begin[group] + size;
    }
    self->columns = self->group_begin[blackbox_groups];
    self->matrix = malloc(self->columns * data->values * sizeof(double));
    size_t offset = 0;
    for (size_t i = 0; self->matrix && i < data->runs; i++) {
        if (!build_run(self, &data->evidence[i], like, data->values, offset)) {
            blackbox_free(self);
            return false;
        }
        offset += data->evidence[i].values;
    }
    return self->matrix != NULL;
}

bool blackbox_init(struct blackbox *self, const struct fit_data *data)
{
    return init_like(self, data, NULL);
}

void blackbox_free(struct blackbox *self)
{
    free(self->matrix);
    memset(self, 0, sizeof *self);
}

/// Copies one group's columns to A from column m on, with their weights; returns the new number of columns.
static size_t take_group(const struct blackbox *self, size_t rows, int group, size_t m, double *A, double *weight)
{
    for (size_t i = self->group_begin[group]; i < self->group_begin[group + 1]; i++, m++) {
        double norm = 0.0;
        memcpy(A + rows * m, self->matrix + rows * i, rows * sizeof *A);
        for (size_t j = 0; j < rows; j++)
            norm += A[rows * m + j] * A[rows * m + j];
        // Groups overlap (constants, slopes), hence a ridge. Taps of the torque get a real prior: torque and motion
        // together could otherwise rebuild the residual itself, noise and all, as minus one times the model.
        weight[m] = fmax(1e-4 * sqrt(norm), group == blackbox_filter ? 1.0 / tap_deviation : 0.0);
    }
    return m;
}

/// Solves for the columns and leaves b - A x in b; returns its square and the priors'. Infinite if it cannot be solved.
static double solve_rest(size_t rows, size_t m, const double *A, const double *weight, const double *centre, double *x,
                         double *io_b)
{
    if (!least_squares_solve(rows, m, A, io_b, weight, centre, x, NULL))
        return INFINITY;
    double cost = 0.0;
    for (size_t i = 0; i < m; i++) {
        cost += weight[i] * weight[i] * (x[i] - centre[i]) * (x[i] - centre[i]);
        for (size_t j = 0; j < rows; j++)
            io_b[j] -= A[rows * i + j] * x[i];
    }
    for (size_t j = 0; j < rows; j++)
        cost += io_b[j] * io_b[j];
    return cost;
}

double blackbox_gain(const struct blackbox *self, const struct fit_data *data, const struct hypothesis *hypothesis,
                     const struct fit *fit, unsigned mask, double *out_cost, double *out_left)
{
    size_t rows = data->values, most = self->columns + hypothesis->count, m = hypothesis->count;
    double *A = calloc(rows * most + rows + 3 * most, sizeof *A);
    double cost = fit->cost;
    if (A) {
        double *b = A + rows * most, *weight = b + rows, *centre = weight + most, *x = centre + most;
        fit_linear(fit, data, hypothesis, A, weight, centre);
        for (int group = 0; group < blackbox_groups; group++)
            if (mask >> group & 1)
                m = take_group(self, rows, group, m, A, weight);
        for (size_t j = 0; j < rows; j++)
            b[j] = -fit->residual[j];
        // The prior at the fit is in its cost already; what contrasts add, a black box does not change.
        double left = solve_rest(rows, m, A, weight, centre, x, b) + fit_contrast_cost(fit, data);
        if (left < cost) {
            cost = left;
            for (size_t j = 0; out_left && j < rows; j++)
                out_left[j] = -b[j];
        }
    }
    free(A);
    if (out_cost)
        *out_cost = cost;
    return 0.5 * (fit->cost - cost);
}

/// Coefficients of all functions from what a fit leaves. Errors: false if memory is short or they cannot be solved for.
static bool learn(const struct blackbox *self, size_t rows, const double *residual, double *out_x)
{
    size_t most = self->columns, m = 0;
    double *A = calloc(rows * most + rows + 2 * most, sizeof *A);
    if (!A)
        return false;
    double *b = A + rows * most, *weight = b + rows, *centre = weight + most;
    for (int group = 0; group < blackbox_groups; group++)
        m = take_group(self, rows, group, m, A, weight);
    for (size_t j = 0; j < rows; j++)
        b[j] = -residual[j];
    bool good = isfinite(solve_rest(rows, m, A, weight, centre, out_x, b));
    free(A);
    return good;
}

double blackbox_ceiling(const struct fit_data *data, const double *residual, const struct fit_data *unseen,
                        double *io_unseen)
{
    struct blackbox known, strange;
    const struct recording *like = data->evidence[0].recording;
    double sum = NAN;
    if (!init_like(&known, data, like))
        return sum;
    double *x = calloc(known.columns, sizeof *x);
    bool good = x && learn(&known, data->values, residual, x) && init_like(&strange, unseen, like);
    if (good && strange.columns == known.columns) {
        sum = 0.0;
        for (size_t j = 0; j < unseen->values; j++) {
            for (size_t i = 0; i < strange.columns; i++)
                io_unseen[j] += strange.matrix[i * unseen->values + j] * x[i];
            sum += io_unseen[j] * io_unseen[j];
        }
    }
    if (good)
        blackbox_free(&strange);
    free(x);
    blackbox_free(&known);
    return sqrt(sum / (double)unseen->values);
}
