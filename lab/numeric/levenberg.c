/* SPDX-License-Identifier: MIT */
#include "lab/numeric/levenberg.h"

#include "lab/numeric/scaled_svd.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Directions with a smaller singular value, of the largest, are rounding.
static const double least_share = 1e-14;
/// A step as large as this share of the predicted decrease is a good one.
static const double came_true = 0.25;

struct state {
    const struct levenberg_problem *problem;
    size_t n;
    struct tall_qr rows;
    struct scaled_svd svd;
    double *R;            ///< (n + 1) x (n + 1)
    double *step, *trial; ///< n
    double cost, damping;
};

static bool linearise(struct state *self, const double *x)
{
    tall_qr_reset(&self->rows);
    self->problem->evaluate(self->problem->context, x, &self->rows);
    return tall_qr_finish(&self->rows, self->R) && scaled_svd_factorise(&self->svd, self->R, self->n + 1);
}

static const double *right_side(const struct state *self)
{
    return self->R + self->n * (self->n + 1);
}

/// Decrease of the cost that the linear model expects of the step with this damping.
static double predicted(const struct state *self, size_t rank, double damping)
{
    double sum = 0.0;
    for (size_t k = 0; k < rank; k++) {
        double projection = 0.0;
        for (size_t i = 0; i < self->n; i++) {
            projection += self->svd.W[k * self->n + i] * right_side(self)[i];
        }
        double s2 = self->svd.singular[k] * self->svd.singular[k];
        double left = damping * damping / (s2 + damping * damping);
        sum += projection * projection * (1.0 - left * left);
    }
    return sum;
}

/// Whether the step changes x by more than rounding.
static bool moves(const struct state *self, const double *x)
{
    double step = 0.0;
    double whole = 0.0;
    for (size_t i = 0; i < self->n; i++) {
        step = hypot(step, self->svd.length[i] * self->step[i]);
        whole = hypot(whole, self->svd.length[i] * x[i]);
    }
    return step > DBL_EPSILON * whole;
}

/// Tries steps with growing damping until one lowers the cost. Returns false if none does.
static bool improve(struct state *self, size_t rank, double *inout_x)
{
    double first_damping = self->svd.singular[rank - 1];
    for (;;) {
        double expected = predicted(self, rank, self->damping);
        scaled_svd_solve(&self->svd, right_side(self), rank, self->damping, self->step);
        if (!moves(self, inout_x)) {
            return false;
        }
        for (size_t i = 0; i < self->n; i++) {
            self->trial[i] = inout_x[i] - self->step[i];
        }
        double cost = self->problem->evaluate(self->problem->context, self->trial, NULL);
        bool lower = isfinite(cost) && cost < self->cost;
        bool good = lower && self->cost - cost > came_true * expected;
        if (good) {
            self->damping = self->damping > first_damping ? 0.1 * self->damping : 0.0;
        } else {
            self->damping = fmax(10.0 * self->damping, first_damping);
        }
        if (lower) {
            memcpy(inout_x, self->trial, self->n * sizeof *inout_x);
            self->cost = cost;
            return true;
        }
    }
}

static void search(struct state *self, size_t iterations_max, double tolerance, double *inout_x,
                   struct levenberg_outcome *outcome)
{
    while (outcome->iterations < iterations_max) {
        if (!linearise(self, inout_x)) {
            return;
        }
        outcome->iterations++;
        size_t rank = scaled_svd_rank(&self->svd, self->n - self->problem->redundant, least_share);
        if (rank == 0 || predicted(self, rank, 0.0) <= tolerance * self->cost || !improve(self, rank, inout_x)) {
            outcome->converged = true;
            return;
        }
    }
}

bool levenberg_minimise(const struct levenberg_problem *problem, size_t iterations_max, double tolerance,
                        double *inout_x, struct levenberg_outcome *out_outcome)
{
    size_t n = problem->unknowns;
    struct state self = {.problem = problem, .n = n};
    *out_outcome = (struct levenberg_outcome){0};
    self.cost = problem->evaluate(problem->context, inout_x, NULL);
    double *work = malloc(((n + 1) * (n + 1) + 2 * n) * sizeof *work);
    bool ready = isfinite(self.cost) && work && tall_qr_init(&self.rows, n + 1) && scaled_svd_init(&self.svd, n);
    if (ready) {
        self.R = work;
        self.step = self.R + (n + 1) * (n + 1);
        self.trial = self.step + n;
        search(&self, iterations_max, tolerance, inout_x, out_outcome);
        out_outcome->cost = self.cost;
    }
    scaled_svd_free(&self.svd);
    tall_qr_free(&self.rows);
    free(work);
    return ready;
}
