/* SPDX-License-Identifier: MIT */
#include "lab/numeric/trust_region.h"

#include "lab/numeric/cholesky.h"
#include "lab/numeric/vector.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Of the radius: how exactly a step that ends on its edge has to be there.
static const double radius_tolerance = 0.01;

struct state {
    const struct trust_region_problem *problem;
    size_t n;
    double *H, *factor;       ///< n x n
    double *g, *step, *trial; ///< n
    double *solved;           ///< n, scratch of the secular equation
    double radius, lambda, step_length;
};

static double largest(size_t n, const double *x)
{
    double most = 0.0;
    for (size_t i = 0; i < n; i++)
        most = fmax(most, fabs(x[i]));
    return most;
}

/// Factorises H + lambda I and solves for the step; false if it is not positive definite.
static bool solve(struct state *self, double lambda)
{
    const size_t n = self->n;
    memcpy(self->factor, self->H, n * n * sizeof(double));
    for (size_t i = 0; i < n; i++) {
        self->factor[i * n + i] += lambda;
        self->step[i] = -self->g[i];
    }
    if (!cholesky_solve(n, self->factor, self->step))
        return false;
    self->step_length = vector_length(n, self->step);
    return isfinite(self->step_length);
}

/// Newton's correction of lambda for |step(lambda)| = radius, from the factor at hand.
static double corrected(struct state *self, double lambda)
{
    lapack_int order = (lapack_int)self->n;
    memcpy(self->solved, self->step, self->n * sizeof(double));
    LAPACKE_dtrtrs(LAPACK_COL_MAJOR, 'L', 'N', 'N', order, 1, self->factor, order, self->solved, order);
    double ratio = self->step_length / vector_length(self->n, self->solved);
    return lambda + ratio * ratio * (self->step_length - self->radius) / self->radius;
}

/// The step for the present radius. H is singular wherever a combination of unknowns does not matter, so the least
/// lambda is not 0 but what rounding makes of it.
static void find_step(struct state *self)
{
    enum { corrections_max = 30 };
    double most = 0.0;
    for (size_t i = 0; i < self->n; i++)
        most = fmax(most, self->H[i * self->n + i]);
    const double least = 1e-12 * most * (double)self->n;
    double low = least;
    double high = fmax(vector_length(self->n, self->g) / self->radius, 2.0 * least);
    double lambda = self->lambda > low && self->lambda < high ? self->lambda : low;
    for (int i = 0; i < corrections_max; i++) {
        if (!solve(self, lambda)) {
            low = lambda;
            lambda = fmax(2.0 * lambda, 1e-3 * high);
            continue;
        }
        bool inside = self->step_length <= self->radius;
        if (fabs(self->step_length - self->radius) <= radius_tolerance * self->radius || (inside && lambda <= least))
            break;
        if (inside)
            high = lambda;
        else
            low = lambda;
        lambda = corrected(self, lambda);
        if (!(lambda > low && lambda < high))
            lambda = fmax(low, inside ? fmax(least, 1e-3 * high) : sqrt(low * high));
    }
    self->lambda = lambda;
}

/// Decrease of the cost that the linear model expects: -2 g's - s'Hs, with H s = -g - lambda s.
static double predicted(const struct state *self)
{
    return -vector_dot(self->n, self->g, self->step) + self->lambda * self->step_length * self->step_length;
}

/// Tries the step; takes it if it lowers the cost, and adapts the radius. Returns whether it was good enough to judge
/// the cost's tolerance by.
static bool try_step(struct state *self, double *inout_x, double *inout_cost, double *out_decrease)
{
    for (size_t i = 0; i < self->n; i++)
        self->trial[i] = inout_x[i] + self->step[i];
    double cost = self->problem->cost(self->problem->context, self->trial);
    double decrease = isfinite(cost) ? *inout_cost - cost : -INFINITY;
    double expected = predicted(self);
    double ratio = expected > 0.0 ? decrease / expected : decrease > 0.0 ? 1.0 : 0.0;
    *out_decrease = decrease;
    if (ratio < 0.25)
        self->radius = 0.25 * self->step_length;
    else if (ratio > 0.75 && self->step_length > (1.0 - 2.0 * radius_tolerance) * self->radius)
        self->radius *= 2.0;
    if (decrease > 0.0) {
        memcpy(inout_x, self->trial, self->n * sizeof(double));
        *inout_cost = cost;
    }
    return ratio > 0.25;
}

static void search(struct state *self, const struct trust_region_limits *limits, double *inout_x,
                   struct trust_region_outcome *outcome)
{
    const struct trust_region_problem *problem = self->problem;
    bool moved = true;
    outcome->cost = problem->cost(problem->context, inout_x);
    while (outcome->steps < limits->steps) {
        outcome->stopped = problem->stop && problem->stop(problem->context, outcome->steps);
        if (outcome->stopped)
            return;
        if (moved) {
            memset(self->H, 0, self->n * self->n * sizeof(double));
            problem->normal_equations(problem->context, inout_x, self->H, self->g);
            if (!(largest(self->n, self->g) > limits->gradient_tolerance))
                return;
        }
        find_step(self);
        double decrease = 0.0;
        double before = outcome->cost;
        bool as_predicted = try_step(self, inout_x, &outcome->cost, &decrease);
        outcome->steps++;
        moved = decrease > 0.0;
        if ((as_predicted && decrease < limits->cost_tolerance * before) ||
            self->step_length < limits->step_tolerance * (limits->step_tolerance + vector_length(self->n, inout_x)))
            return;
    }
}

bool trust_region_minimise(const struct trust_region_problem *problem, const struct trust_region_limits *limits,
                           double *inout_x, struct trust_region_outcome *out_outcome)
{
    const size_t n = problem->unknowns;
    struct state self = {.problem = problem, .n = n};
    double *work = calloc(2 * n * n + 4 * n, sizeof *work);
    if (!work)
        return false;
    self.H = work;
    self.factor = self.H + n * n;
    self.g = self.factor + n * n;
    self.step = self.g + n;
    self.trial = self.step + n;
    self.solved = self.trial + n;
    double length = vector_length(n, inout_x);
    self.radius = length > 0.0 ? length : 1.0;
    *out_outcome = (struct trust_region_outcome){0};
    search(&self, limits, inout_x, out_outcome);
    free(work);
    return true;
}
