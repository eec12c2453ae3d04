/* SPDX-License-Identifier: MIT */
#include "lab/design/newton.h"

#include "lab/design/norm.h"
#include "lab/numeric/cholesky.h"
#include "lab/numeric/vector.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double first_damping = 1e-3; ///< of the mean diagonal
static const double least_damping = 1e-9;
static const double most_damping = 1e6;
static const double enough = 1e-3; ///< of the gap that p itself leaves, log(points) / p: a smaller step ends one p

struct newton {
    struct design_norm norm;
    size_t variables;
    bool stopped; ///< the search does not go on
    double damping;
    double *matrix;
    double *factor;
    double *x;
    double *gradient;
    double *step;
    double *trial_x;
    double *trial_gradient;
    double *memory;
};

static double mean_diagonal(const struct newton *self)
{
    double sum = 0;
    for (size_t i = 0; i < self->variables; i++) {
        sum += fabs(self->matrix[i * self->variables + i]);
    }
    return sum / (double)self->variables;
}

/// (H + damping) step = -gradient; false if that is not positive definite.
static bool solve(struct newton *self, double unit)
{
    const size_t n = self->variables;
    memcpy(self->factor, self->matrix, n * n * sizeof(double));
    for (size_t i = 0; i < n; i++) {
        self->factor[i * n + i] += self->damping * unit;
        self->step[i] = -self->gradient[i];
    }
    return cholesky_solve(n, self->factor, self->step);
}

/// What the quadratic model expects of the step: -g's - s'Hs / 2, with H s = -g - damping unit s.
static double expected_decrease(const struct newton *self, double unit)
{
    return -vector_dot(self->variables, self->gradient, self->step) / 2 +
           self->damping * unit * vector_dot(self->variables, self->step, self->step) / 2;
}

static void swap(double **a, double **b)
{
    double *was = *a;
    *a = *b;
    *b = was;
}

/// One step that lowers the value; returns the decrease, 0 if there is none to be had.
static double take_step(struct newton *self, double value)
{
    const double unit = mean_diagonal(self);
    for (; self->damping < most_damping; self->damping *= 4) {
        self->stopped = !design_search_goes_on(self->norm.search);
        if (self->stopped) {
            return 0;
        }
        if (!solve(self, unit)) {
            continue;
        }
        for (size_t i = 0; i < self->variables; i++) {
            self->trial_x[i] = self->x[i] + self->step[i];
        }
        double expected = expected_decrease(self, unit);
        double decrease = value - design_norm_evaluate(&self->norm, self->trial_x, self->trial_gradient);
        if (decrease > 0.05 * expected) {
            swap(&self->x, &self->trial_x);
            swap(&self->gradient, &self->trial_gradient);
            if (decrease > 0.5 * expected) {
                self->damping = fmax(self->damping / 8, least_damping);
            }
            return decrease;
        }
    }
    return 0;
}

static void minimise(struct newton *self, size_t steps)
{
    const double gap = ldexp(log((double)self->norm.search->waveform.packed_length), -(int)self->norm.exponent);
    double value = design_norm_evaluate(&self->norm, self->x, self->gradient);
    self->damping = first_damping;
    for (size_t i = 0; i < steps; i++) {
        design_norm_find_curvature(&self->norm, self->x, self->gradient, self->matrix);
        double decrease = take_step(self, value);
        value -= decrease;
        if (!(decrease > enough * gap)) {
            return;
        }
    }
}

static bool create(struct design_search *search, struct newton *out_newton)
{
    struct newton self = {0};
    if (!design_norm_create(search, true, &self.norm)) {
        return false;
    }
    const size_t n = self.norm.variables;
    self.variables = n;
    self.memory = calloc(2 * n * n + 5 * n, sizeof(double));
    if (!self.memory) {
        design_norm_free(&self.norm);
        return false;
    }
    self.matrix = self.memory;
    self.factor = self.matrix + n * n;
    self.x = self.factor + n * n;
    self.gradient = self.x + n;
    self.step = self.gradient + n;
    self.trial_x = self.step + n;
    self.trial_gradient = self.trial_x + n;
    *out_newton = self;
    return true;
}

bool design_newton_run(struct design_search *search, const struct design_newton_plan *plan, double *inout_c)
{
    struct newton self;
    if (!create(search, &self)) {
        return false;
    }
    design_norm_get_variables(&self.norm, inout_c, self.x);
    for (unsigned exponent = plan->first_exponent; exponent <= plan->last_exponent && !self.stopped; exponent++) {
        self.norm.exponent = exponent;
        minimise(&self, plan->steps);
    }
    design_norm_get_directions(&self.norm, self.x, inout_c);
    design_norm_free(&self.norm);
    free(self.memory);
    return true;
}
