/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/fit.h"

#include "lab/numeric/least_squares.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/// Of a logarithmic coordinate: twice or half.
static const double farthest_step = 0.7;

bool fit_init(struct fit *self, const struct fit_data *data)
{
    memset(self, 0, sizeof *self);
    size_t most = hypothesis_coordinates_max, rows = data->values + data->contrasts;
    self->residual = malloc(rows * sizeof(double));
    self->jacobian = malloc(rows * most * sizeof(double));
    self->covariance = malloc(most * most * sizeof(double));
    if (self->residual && self->jacobian && self->covariance)
        return true;
    fit_free(self);
    return false;
}

void fit_free(struct fit *self)
{
    free(self->residual);
    free(self->jacobian);
    free(self->covariance);
    memset(self, 0, sizeof *self);
}

size_t fit_residual(const struct fit_data *data, const struct sim_model *model, double *out_residual)
{
    bool in_time = data->contrasts > 0 && contrast_concerns(model);
    double *contrasts = out_residual + data->values;
    for (size_t i = 0; i < data->runs; i++) {
        evidence_residual(&data->evidence[i], model, out_residual, in_time ? contrasts : NULL);
        out_residual += data->evidence[i].values;
        contrasts += data->evidence[i].contrast.values;
    }
    return data->values + (in_time ? data->contrasts : 0);
}

static double prior_cost(const struct hypothesis *h, const double *x)
{
    double sum = 0.0;
    for (size_t i = 0; i < h->count; i++) {
        double d = h->coordinates[i].weight * (x[i] - h->coordinates[i].centre);
        sum += d * d;
    }
    return sum;
}

static double sum_of_squares(size_t n, const double *r)
{
    double sum = 0.0;
    for (size_t i = 0; i < n; i++)
        sum += r[i] * r[i];
    return sum;
}

/// Of a residual of `rows`. A hypothesis without an effect in time leaves the contrasts as they are.
static double contrast_cost(const struct fit_data *data, size_t rows, const double *residual)
{
    double sum = rows > data->values ? sum_of_squares(rows - data->values, residual + data->values) : 0.0;
    for (size_t i = 0; data->contrasts > 0 && i < data->runs; i++) {
        const struct contrast *c = &data->evidence[i].contrast;
        sum += (rows > data->values ? 0.0 : c->without) - c->reference;
    }
    return sum;
}

double fit_contrast_cost(const struct fit *self, const struct fit_data *data)
{
    return contrast_cost(data, self->rows, self->residual);
}

static double residual_at(const struct fit_data *data, const struct hypothesis *h, const double *x,
                          double *out_residual, size_t *out_rows)
{
    struct sim_model model;
    hypothesis_model(h, x, &model);
    for (size_t i = 0; data->renewed && i < data->runs; i++)
        if (!evidence_renew_noise(&data->renewed[i], &model))
            return INFINITY;
    *out_rows = fit_residual(data, &model, out_residual);
    double sum = sum_of_squares(data->values, out_residual) + contrast_cost(data, *out_rows, out_residual);
    return isfinite(sum) ? sum + prior_cost(h, x) : INFINITY;
}

double fit_cost(struct fit *self, const struct fit_data *data, const struct hypothesis *hypothesis, const double *x)
{
    self->cost = residual_at(data, hypothesis, x, self->residual, &self->rows);
    self->prior = prior_cost(hypothesis, x);
    return self->cost;
}

/// Moves coordinate i to `to`, and by what is returned the number that its effect changes along the travel, so
/// that in the middle it stays. Moved alone the two do nearly the same there, much more than either does elsewhere, and
/// of the difference of two such derivatives little would be right.
static double move(const struct hypothesis *h, size_t i, double to, double *io_x)
{
    size_t along = hypothesis_along(h, i);
    double shift = along < h->count ? hypothesis_along_shift(h, io_x, i, to) : 0.0;
    io_x[i] = to;
    if (along < h->count)
        io_x[along] += shift;
    return shift;
}

/// Takes out of a derivative what belongs to the coordinate that was moved along.
static void take_shift_back(const struct fit *self, const struct hypothesis *h, size_t i, double shift,
                            double *io_column)
{
    const double *other = self->jacobian + hypothesis_along(h, i) * self->rows;
    for (size_t j = 0; shift != 0.0 && j < self->rows; j++)
        io_column[j] -= shift * other[j];
}

/// One-sided differences, away from the nearer bound. The residual is nearly linear in most coordinates, so that a step
/// large enough to average over the instants at which friction changes sign costs no accuracy.
static void differentiate_by(const struct fit *self, const struct fit_data *data, const struct hypothesis *h, size_t i,
                             double *out_column)
{
    double x[hypothesis_coordinates_max];
    memcpy(x, h->x, sizeof x);
    const struct coordinate *c = &h->coordinates[i];
    double step = c->scale == coordinate_logarithmic ? 2e-4 : 1e-3 * fmax(fabs(h->x[i]), 0.3);
    if (h->x[i] + step > c->upper)
        step = -step;
    size_t rows;
    double shift = move(h, i, h->x[i] + step, x);
    residual_at(data, h, x, out_column, &rows);
    for (size_t j = 0; j < self->rows; j++)
        out_column[j] = (out_column[j] - self->residual[j]) / step;
    take_shift_back(self, h, i, shift / step, out_column);
}

/// Index of the same coordinate in another hypothesis, or its count.
static size_t find_coordinate(const struct hypothesis *h, const struct coordinate *c)
{
    for (size_t i = 0; i < h->count; i++) {
        const struct coordinate *d = &h->coordinates[i];
        if (d->effect == c->effect && d->parameter == c->parameter && d->model_offset == c->model_offset &&
            d->unit == c->unit)
            return i;
    }
    return h->count;
}

/// A column of another fit's Jacobian; if that had no effect in time, the contrasts do not depend on its coordinates
/// but through the effect in time itself, which is small as long as it is new.
static void take_column(const struct fit *from, size_t i, size_t rows, double *out_column)
{
    size_t shared = from->rows < rows ? from->rows : rows;
    memcpy(out_column, from->jacobian + i * from->rows, shared * sizeof *out_column);
    memset(out_column + shared, 0, (rows - shared) * sizeof *out_column);
}

/// Whose derivatives may be taken over, if anybody's.
struct lender {
    const struct hypothesis *hypothesis; ///< NULL: nobody
    const struct fit *fit;
};

/// A number of the given model that may be off by a few percent only: it hardly moves, and what else the model has
/// hardly changes what it does.
static bool is_nearly_known(const struct coordinate *c)
{
    const double narrow = 0.25;
    return c->effect < 0 && c->scale == coordinate_logarithmic && c->weight > 0.0 && c->upper - c->lower < narrow;
}

/// Those last whose derivatives need another's.
static void sort_coordinates(const struct hypothesis *h, size_t *out_order)
{
    size_t count = 0;
    for (int last = 0; last < 2; last++)
        for (size_t i = 0; i < h->count; i++)
            if ((hypothesis_along(h, i) < h->count) == (last == 1))
                out_order[count++] = i;
}

static void differentiate(struct fit *self, const struct fit_data *data, const struct hypothesis *h,
                          const struct lender *lender)
{
    size_t order[hypothesis_coordinates_max];
    sort_coordinates(h, order);
    for (size_t k = 0; k < h->count; k++) {
        size_t i = order[k];
        const struct coordinate *c = &h->coordinates[i];
        double *column = self->jacobian + i * self->rows;
        size_t j = lender->hypothesis && is_nearly_known(c) ? find_coordinate(lender->hypothesis, c) : SIZE_MAX;
        if (lender->hypothesis && j < lender->hypothesis->count)
            take_column(lender->fit, j, self->rows, column);
        else
            differentiate_by(self, data, h, i, column);
    }
}

void fit_linear(const struct fit *self, const struct fit_data *data, const struct hypothesis *hypothesis, double *out_A,
                double *out_weight, double *out_centre)
{
    size_t rows = data->values;
    for (size_t i = 0; i < hypothesis->count; i++) {
        const struct coordinate *c = &hypothesis->coordinates[i];
        const double *column = self->jacobian + i * self->rows;
        double prior = c->weight * c->weight, seen = sum_of_squares(self->rows - rows, column + rows);
        memcpy(out_A + i * rows, column, rows * sizeof *column);
        out_weight[i] = sqrt(prior + seen);
        out_centre[i] = prior + seen > 0.0 ? prior * (c->centre - hypothesis->x[i]) / (prior + seen) : 0.0;
    }
}

/// Where a step from the present value may end: within the box, and a ratio not farther than its derivative says
/// anything.
static double confined(const struct hypothesis *h, size_t i, double reach, double x)
{
    const struct coordinate *c = &h->coordinates[i];
    double lower = c->lower, upper = c->upper;
    if (c->scale == coordinate_logarithmic) {
        lower = fmax(lower, h->x[i] - reach);
        upper = fmin(upper, h->x[i] + reach);
    }
    return fmin(fmax(x, lower), upper);
}

/// Solves for the step; coordinates that would leave their box, or go farther than `reach` in the logarithm, are put on
/// its wall and the others solved again.
static bool solve_step(const struct fit *self, const struct hypothesis *h, double damping, double reach, double *work,
                       double *out_x, double *out_covariance)
{
    size_t n = h->count, rows = self->rows;
    bool held[hypothesis_coordinates_max] = {false};
    double weight[hypothesis_coordinates_max], centre[hypothesis_coordinates_max], step[hypothesis_coordinates_max];
    double *columns = work, *rhs = work + rows * n;
    memcpy(out_x, h->x, n * sizeof *out_x);
    for (int pass = 0; pass < 5; pass++) {
        size_t map[hypothesis_coordinates_max], m = 0;
        for (size_t j = 0; j < rows; j++)
            rhs[j] = -self->residual[j];
        for (size_t i = 0; i < n; i++) {
            const double *column = self->jacobian + i * rows;
            if (held[i]) {
                for (size_t j = 0; j < rows; j++)
                    rhs[j] -= column[j] * (out_x[i] - h->x[i]);
                continue;
            }
            memcpy(columns + m * rows, column, rows * sizeof *column);
            double prior = h->coordinates[i].weight;
            double marquardt = damping * sum_of_squares(rows, column);
            weight[m] = sqrt(prior * prior + marquardt);
            centre[m] =
                weight[m] > 0.0 ? prior * prior * (h->coordinates[i].centre - h->x[i]) / (weight[m] * weight[m]) : 0.0;
            map[m++] = i;
        }
        double covariance[hypothesis_coordinates_max * hypothesis_coordinates_max];
        if (m == 0 || !least_squares_solve(rows, m, columns, rhs, weight, centre, step, covariance))
            return m == 0;
        bool again = false;
        memset(out_covariance, 0, n * n * sizeof *out_covariance);
        for (size_t a = 0; a < m; a++) {
            size_t i = map[a];
            out_x[i] = confined(h, i, reach, h->x[i] + step[a]);
            if (out_x[i] != h->x[i] + step[a])
                held[i] = again = true;
            for (size_t b = 0; b < m; b++)
                out_covariance[i * n + map[b]] = covariance[a * m + b];
        }
        if (!again)
            return true;
    }
    return true;
}

/// A step is finished when no coordinate moved by more than this share of its scale.
static bool moved(const struct hypothesis *h, const double *x)
{
    const double small = 2e-5;
    for (size_t i = 0; i < h->count; i++)
        if (fabs(x[i] - h->x[i]) > small * fmax(fabs(h->x[i]), 1.0))
            return true;
    return false;
}

/// How far a fit is taken: all the way, or as long as there is something to be had.
struct course {
    size_t iterations;
    bool finish;    ///< derivatives and covariance at the x where it ends
    double settled; ///< of -2 log likelihood: a step that brings no more is the last
    double goal;    ///< cost that is out of reach when `iterations` more steps like the last one do not lead below it
};

/// Tries the step to x; takes it if it improves. Returns false when there is nothing more to be had.
static bool take_step(struct fit *self, const struct fit_data *data, struct hypothesis *h, const double *x,
                      double *trial, double settled, double *io_damping, bool *out_taken)
{
    size_t rows;
    double cost = residual_at(data, h, x, trial, &rows), before = self->cost;
    *out_taken = cost < before;
    if (!*out_taken) {
        *io_damping = *io_damping > 0.0 ? *io_damping * 8.0 : 1e-3;
        return *io_damping < 1e4;
    }
    memcpy(h->x, x, h->count * sizeof *x);
    memcpy(self->residual, trial, rows * sizeof *trial);
    self->cost = cost;
    *io_damping = *io_damping > 1e-6 ? *io_damping * 0.1 : 0.0;
    return before - cost > settled;
}

/// A number and what changes it along the travel make a curved valley.
static bool is_curved(const struct hypothesis *h)
{
    for (size_t i = 0; i < h->count; i++)
        if (hypothesis_along(h, i) < h->count)
            return true;
    return false;
}

/// Where a step to x, whose residual is in `trial`, ended on the side of a curved valley: one more with the same
/// derivatives leads back to its floor. `useful`: whether there is anything to be had.
static bool take_chord(struct fit *self, const struct fit_data *data, struct hypothesis *h, bool useful,
                       const double *x, double *work, double *trial)
{
    bool taken = false;
    double y[hypothesis_coordinates_max], damping = 0.0;
    double covariance[hypothesis_coordinates_max * hypothesis_coordinates_max];
    struct hypothesis there = *h;
    struct fit ended = *self;
    memcpy(there.x, x, h->count * sizeof *x);
    ended.residual = trial;
    if (useful && is_curved(h) && solve_step(&ended, &there, 0.0, farthest_step, work, y, covariance))
        take_step(self, data, h, y, trial, 0.0, &damping, &taken);
    return taken;
}

/// Width of a secant: as far as the residual changes by `far` standard deviations, if that is a step that a derivative
/// says anything about.
static double secant_width(const struct fit *self, const struct hypothesis *h, size_t i)
{
    const double far = 5.0;
    const struct coordinate *c = &h->coordinates[i];
    double size = c->scale == coordinate_logarithmic ? 1.0 : fmax(fabs(h->x[i]), 0.3);
    double slope = sqrt(sum_of_squares(self->rows, self->jacobian + i * self->rows) + c->weight * c->weight);
    return fmin(fmax(far / slope, 5e-4 * size), 0.1 * size);
}

/// Columns of the Jacobian by secants about x, from the present ones' sizes. `work`: rows.
static void take_secants(struct fit *self, const struct fit_data *data, const struct hypothesis *h, double *work)
{
    size_t order[hypothesis_coordinates_max];
    sort_coordinates(h, order);
    for (size_t k = 0; k < h->count; k++) {
        size_t i = order[k];
        double width = secant_width(self, h, i), *column = self->jacobian + i * self->rows;
        double x[hypothesis_coordinates_max];
        size_t rows;
        memcpy(x, h->x, sizeof x);
        double above = fmin(h->x[i] + width, h->coordinates[i].upper);
        double below = fmax(h->x[i] - width, h->coordinates[i].lower);
        if (!(above > below))
            continue;
        double shift = move(h, i, above, x);
        residual_at(data, h, x, column, &rows);
        shift -= move(h, i, below, memcpy(x, h->x, sizeof x));
        residual_at(data, h, x, work, &rows);
        for (size_t j = 0; j < self->rows; j++)
            column[j] = (column[j] - work[j]) / (above - below);
        take_shift_back(self, h, i, shift / (above - below), column);
    }
}

/// Takes the longest of the step and its halves that improves the fit. Returns by how much.
static double take_part(struct fit *self, const struct fit_data *data, struct hypothesis *h, const double *x,
                        double *trial)
{
    const double shortest = 0.1;
    for (double part = 1.0; part > shortest; part *= 0.5) {
        double y[hypothesis_coordinates_max], damping = 1e-3, before = self->cost;
        bool taken;
        for (size_t i = 0; i < h->count; i++)
            y[i] = h->x[i] + part * (x[i] - h->x[i]);
        take_step(self, data, h, y, trial, 0.0, &damping, &taken);
        if (taken)
            return before - self->cost;
    }
    return 0.0;
}

/// Goes on from where a fit ended whose residual is rough: derivatives are secants then, so that neither jumps nor
/// kinks of single instants stop the fit or pass for information.
static bool polish(struct fit *self, const struct fit_data *data, struct hypothesis *io_hypothesis)
{
    enum { most = 4 };
    const double settled = 0.05;
    size_t rows = data->values + data->contrasts;
    double *work = malloc((rows * io_hypothesis->count + 2 * rows) * sizeof *work);
    if (!work)
        return false;
    double *trial = work + rows * io_hypothesis->count + rows, x[hypothesis_coordinates_max];
    bool good = true;
    for (int pass = 0; good && pass < most; pass++) {
        take_secants(self, data, io_hypothesis, trial);
        good = solve_step(self, io_hypothesis, 0.0, farthest_step, work, x, self->covariance);
        if (good && !(take_part(self, data, io_hypothesis, x, trial) > settled))
            break;
    }
    self->prior = prior_cost(io_hypothesis, io_hypothesis->x);
    free(work);
    return good;
}

/// A belt that goes slack and tight does so at instants that jump with every number of the model. Where the noise
/// follows the model, too, derivatives cost ten times as much and stay as they are.
static bool is_rough(const struct fit_data *data, const struct hypothesis *h)
{
    struct sim_model model;
    hypothesis_model(h, NULL, &model);
    for (size_t e = 0; sim_effects[e]; e++)
        if (model.effect_on[e] && sim_effects[e]->bend)
            return !data->renewed;
    return false;
}

/// Covariance, by the derivatives at x or, for a rough residual, by secants about it.
static bool finish(struct fit *self, const struct fit_data *data, struct hypothesis *h, double *work)
{
    double x[hypothesis_coordinates_max];
    bool good = solve_step(self, h, 0.0, INFINITY, work, x, self->covariance);
    return good && is_rough(data, h) ? polish(self, data, h) : good;
}

/// Whether steps like the last one, from a cost of `before`, still lead to the goal; before == cost: none was taken.
static bool leads_on(const struct fit *self, const struct course *course, size_t done, double before)
{
    double fall = before - self->cost;
    return !(fall > 0.0) || self->cost - (double)(course->iterations - done) * fall < course->goal;
}

static bool improve(struct fit *self, const struct fit_data *data, struct hypothesis *h, const struct lender *lender,
                    const struct course *course)
{
    size_t rows = data->values + data->contrasts;
    double *work = malloc((rows * h->count + 2 * rows) * sizeof *work);
    if (!work)
        return false;
    double *trial = work + rows * h->count + rows;
    double damping = 0.0, x[hypothesis_coordinates_max];
    bool good = true, fresh = false, more = true;
    self->cost = residual_at(data, h, h->x, self->residual, &self->rows);
    const size_t tries = 3; // per iteration: one that fails costs a residual, but no derivatives
    size_t i = 0;
    for (size_t tried = 0; i < course->iterations && tried < tries * course->iterations && good && more; tried++) {
        bool first = !fresh;
        if (first)
            differentiate(self, data, h, lender);
        fresh = true;
        good = solve_step(self, h, damping, farthest_step, work, x, self->covariance);
        bool taken = false;
        double before = self->cost;
        more = good && moved(h, x) && take_step(self, data, h, x, trial, course->settled, &damping, &taken);
        taken = taken || (first && take_chord(self, data, h, more, x, work, trial));
        i += taken;
        more = more && leads_on(self, course, i, before);
        fresh = !taken;
    }
    if (good && course->finish) {
        if (!fresh)
            differentiate(self, data, h, lender);
        good = finish(self, data, h, work);
    }
    self->prior = prior_cost(h, h->x);
    free(work);
    return good;
}

bool fit_run(struct fit *self, const struct fit_data *data, struct hypothesis *io_hypothesis, size_t iterations)
{
    struct course course = {.iterations = iterations, .finish = true, .settled = 1e-3, .goal = INFINITY};
    return improve(self, data, io_hypothesis, &(struct lender){0}, &course);
}

bool fit_roughly(struct fit *self, const struct fit_data *data, const struct hypothesis *base,
                 const struct fit *base_fit, struct hypothesis *io_hypothesis, size_t iterations, double goal)
{
    bool alike = base && base->engaged.structure == io_hypothesis->engaged.structure;
    struct lender lender = {alike ? base : NULL, base_fit};
    struct course course = {.iterations = iterations, .settled = 0.05, .goal = goal};
    return improve(self, data, io_hypothesis, &lender, &course);
}

bool fit_step(struct fit *self, const struct fit_data *data, const struct hypothesis *base, const struct fit *base_fit,
              struct hypothesis *io_trial)
{
    struct hypothesis *h = io_trial;
    size_t most = data->values + data->contrasts;
    double *work = malloc((most * h->count + 2 * most) * sizeof *work);
    if (!work)
        return false;
    self->cost = residual_at(data, h, h->x, self->residual, &self->rows);
    for (size_t i = 0; i < h->count; i++) {
        size_t j = find_coordinate(base, &h->coordinates[i]);
        double *column = self->jacobian + i * self->rows;
        if (j < base->count)
            take_column(base_fit, j, self->rows, column);
        else
            differentiate_by(self, data, h, i, column);
    }
    double x[hypothesis_coordinates_max], *trial = work + most * h->count + most;
    bool good = solve_step(self, h, 0.0, farthest_step, work, x, self->covariance);
    size_t rows;
    double cost = good ? residual_at(data, h, x, trial, &rows) : INFINITY;
    if (cost < self->cost) {
        self->cost = cost;
        memcpy(h->x, x, h->count * sizeof *x);
    }
    free(work);
    return good;
}
