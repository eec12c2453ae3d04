/* SPDX-License-Identifier: MIT */
#include "lab/design/polish.h"

#include "lab/design/norm.h"
#include "lab/numeric/vector.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    pair_count = 20,
    line_search_steps = 25,
    vectors = 5 + 2 * pair_count, ///< of line_count doubles each, see struct polish
};

static const double armijo = 1e-4;
static const double curvature = 0.9;
static const double enough = 1e-9; ///< relative decrease of the norm that ends one p

struct polish {
    struct design_norm norm;
    size_t variables;
    bool stopped; ///< the search does not go on
    double *x;
    double *gradient;
    double *direction;
    double *trial_x;
    double *trial_gradient;
    double *step_of[pair_count];   ///< s: differences of the phases
    double *change_of[pair_count]; ///< y: differences of the gradients
    double inverse_of[pair_count]; ///< 1 / (s . y)
    size_t held;
    size_t newest;
    double *memory;
};

/// direction = -H gradient by the two-loop recursion (Nocedal 1980).
static void find_direction(struct polish *self)
{
    const size_t count = self->variables;
    double weight[pair_count] = {0};
    for (size_t k = 0; k < count; k++) {
        self->direction[k] = -self->gradient[k];
    }
    for (size_t i = 0; i < self->held; i++) {
        size_t at = (self->newest + pair_count - i) % pair_count;
        weight[at] = self->inverse_of[at] * vector_dot(count, self->step_of[at], self->direction);
        for (size_t k = 0; k < count; k++) {
            self->direction[k] -= weight[at] * self->change_of[at][k];
        }
    }
    // Without curvature yet: a first step of a tenth of a radian in all, which keeps the picture.
    double scale = 0.1 / (sqrt(vector_dot(count, self->gradient, self->gradient)) + 1e-300);
    if (self->held > 0) {
        const double *change = self->change_of[self->newest];
        scale = 1 / (self->inverse_of[self->newest] * vector_dot(count, change, change));
    }
    for (size_t k = 0; k < count; k++) {
        self->direction[k] *= scale;
    }
    for (size_t i = self->held; i-- > 0;) {
        size_t at = (self->newest + pair_count - i) % pair_count;
        double back = self->inverse_of[at] * vector_dot(count, self->change_of[at], self->direction);
        for (size_t k = 0; k < count; k++) {
            self->direction[k] += (weight[at] - back) * self->step_of[at][k];
        }
    }
}

/// Weak Wolfe conditions by bisection (Lewis and Overton 2013), which also copes with the near-kinks of a large p.
/// On success trial_x and trial_gradient hold the new point; *inout_value its value.
static bool search_line(struct polish *self, double *inout_value)
{
    const double slope = vector_dot(self->variables, self->gradient, self->direction);
    double low = 0;
    double high = INFINITY;
    double step = 1;
    if (!(slope < 0)) {
        return false;
    }
    for (int i = 0; i < line_search_steps; i++) {
        self->stopped = !design_search_goes_on(self->norm.search);
        if (self->stopped) {
            return false;
        }
        for (size_t k = 0; k < self->variables; k++) {
            self->trial_x[k] = self->x[k] + step * self->direction[k];
        }
        double value = design_norm_evaluate(&self->norm, self->trial_x, self->trial_gradient);
        if (!(value <= *inout_value + armijo * step * slope)) {
            high = step;
        } else if (vector_dot(self->variables, self->trial_gradient, self->direction) < curvature * slope) {
            low = step;
        } else {
            *inout_value = value;
            return true;
        }
        step = isfinite(high) ? (low + high) / 2 : 2 * step;
    }
    return false;
}

static void remember_step(struct polish *self)
{
    size_t at = self->held > 0 ? (self->newest + 1) % pair_count : 0;
    for (size_t k = 0; k < self->variables; k++) {
        self->step_of[at][k] = self->trial_x[k] - self->x[k];
        self->change_of[at][k] = self->trial_gradient[k] - self->gradient[k];
    }
    double product = vector_dot(self->variables, self->step_of[at], self->change_of[at]);
    if (product > 0) { // the line search's curvature condition gives this, but for rounding
        self->inverse_of[at] = 1 / product;
        self->newest = at;
        self->held += self->held < pair_count ? 1 : 0;
    }
    memcpy(self->x, self->trial_x, self->variables * sizeof(double));
    memcpy(self->gradient, self->trial_gradient, self->variables * sizeof(double));
}

static void minimise(struct polish *self, size_t iterations)
{
    self->held = 0;
    self->newest = 0;
    double value = design_norm_evaluate(&self->norm, self->x, self->gradient);
    for (size_t i = 0; i < iterations; i++) {
        double before = value;
        find_direction(self);
        if (!search_line(self, &value)) {
            return;
        }
        remember_step(self);
        if (before - value < enough) {
            return;
        }
    }
}

static bool create(struct design_search *search, struct polish *out_polish)
{
    struct polish self = {0};
    if (!design_norm_create(search, false, &self.norm)) {
        return false;
    }
    self.variables = self.norm.variables;
    self.memory = calloc(vectors * self.variables, sizeof(double));
    if (!self.memory) {
        design_norm_free(&self.norm);
        return false;
    }
    double *next = self.memory;
    double **fields[] = {&self.x, &self.gradient, &self.direction, &self.trial_x, &self.trial_gradient};
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; i++, next += self.variables) {
        *fields[i] = next;
    }
    for (size_t i = 0; i < pair_count; i++, next += 2 * self.variables) {
        self.step_of[i] = next;
        self.change_of[i] = next + self.variables;
    }
    *out_polish = self;
    return true;
}

bool design_polish_run(struct design_search *search, const struct design_polish_plan *plan, double *inout_c)
{
    struct polish self;
    if (!create(search, &self)) {
        return false;
    }
    design_norm_get_variables(&self.norm, inout_c, self.x);
    for (unsigned exponent = plan->first_exponent; exponent <= plan->last_exponent && !self.stopped; exponent++) {
        self.norm.exponent = exponent;
        minimise(&self, plan->iterations);
    }
    design_norm_get_directions(&self.norm, self.x, inout_c);
    design_norm_free(&self.norm);
    free(self.memory);
    return true;
}
