/* SPDX-License-Identifier: MIT */
#include "lab/design/polish.h"

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
static const double negligible_power = 1e-30; ///< |r|^p below this adds nothing to a sum of at least 1 in double
static const double enough = 1e-9;            ///< relative decrease of the norm that ends one p

struct polish {
    struct design_search *search;
    size_t lines;
    unsigned exponent;
    double *phase;
    double *gradient;
    double *direction;
    double *trial_phase;
    double *trial_gradient;
    double *step_of[pair_count];   ///< s: differences of the phases
    double *change_of[pair_count]; ///< y: differences of the gradients
    double inverse_of[pair_count]; ///< 1 / (s . y)
    size_t held;
    size_t newest;
    double *c; ///< 2 lines
    double *y; ///< 2 lines
    double *memory;
};

static double dot(size_t count, const double *a, const double *b)
{
    double sum = 0;
    for (size_t i = 0; i < count; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

/// Replaces u by r^(p-1), sign kept, and returns the sum of r^p. r^(p-1) = r r^2 r^4 ... as p is a power of two.
static double raise_signals(const struct polish *self, double peak)
{
    double *values = self->search->packed;
    const double least = pow(negligible_power, ldexp(1, -(int)self->exponent));
    double sum = 0;
    for (size_t i = 0; i < self->search->waveform.packed_length; i++) {
        double r = values[i] / peak;
        if (!(fabs(r) > least)) {
            values[i] = 0; // also keeps denormals out, which are slow
            continue;
        }
        double power = r;
        double square = r;
        for (unsigned e = 1; e < self->exponent; e++) {
            square *= square;
            power *= square;
        }
        sum += power * r;
        values[i] = power;
    }
    return sum;
}

/// log ||u||_p at the given phases, with its gradient.
static double evaluate(struct polish *self, const double *phase, double *out_gradient)
{
    const struct design_waveform *waveform = &self->search->waveform;
    for (size_t k = 0; k < self->lines; k++) {
        self->c[2 * k] = cos(phase[k]);
        self->c[2 * k + 1] = sin(phase[k]);
    }
    design_waveform_synthesise(waveform, self->c, self->search->packed);
    double peak = design_waveform_peak_all(waveform, self->search->packed);
    design_search_offer(self->search, self->c, peak);
    double sum = raise_signals(self, peak);
    design_waveform_gather(waveform, self->search->packed, self->y);
    for (size_t k = 0; k < self->lines; k++) {
        double imaginary = self->c[2 * k + 1] * self->y[2 * k] - self->c[2 * k] * self->y[2 * k + 1];
        out_gradient[k] = -imaginary / (sum * peak);
    }
    return log(peak) + log(sum) * ldexp(1, -(int)self->exponent);
}

/// direction = -H gradient by the two-loop recursion (Nocedal 1980).
static void find_direction(struct polish *self)
{
    const size_t lines = self->lines;
    double weight[pair_count] = {0};
    for (size_t k = 0; k < lines; k++) {
        self->direction[k] = -self->gradient[k];
    }
    for (size_t i = 0; i < self->held; i++) {
        size_t at = (self->newest + pair_count - i) % pair_count;
        weight[at] = self->inverse_of[at] * dot(lines, self->step_of[at], self->direction);
        for (size_t k = 0; k < lines; k++) {
            self->direction[k] -= weight[at] * self->change_of[at][k];
        }
    }
    // Without curvature yet: a first step of a tenth of a radian in all, which keeps the picture.
    double scale = 0.1 / (sqrt(dot(lines, self->gradient, self->gradient)) + 1e-300);
    if (self->held > 0) {
        const double *change = self->change_of[self->newest];
        scale = 1 / (self->inverse_of[self->newest] * dot(lines, change, change));
    }
    for (size_t k = 0; k < lines; k++) {
        self->direction[k] *= scale;
    }
    for (size_t i = self->held; i-- > 0;) {
        size_t at = (self->newest + pair_count - i) % pair_count;
        double back = self->inverse_of[at] * dot(lines, self->change_of[at], self->direction);
        for (size_t k = 0; k < lines; k++) {
            self->direction[k] += (weight[at] - back) * self->step_of[at][k];
        }
    }
}

/// Weak Wolfe conditions by bisection (Lewis and Overton 2013), which also copes with the near-kinks of a large p.
/// On success trial_phase and trial_gradient hold the new point; *inout_value its value.
static bool search_line(struct polish *self, double *inout_value)
{
    const double slope = dot(self->lines, self->gradient, self->direction);
    double low = 0;
    double high = INFINITY;
    double step = 1;
    if (!(slope < 0)) {
        return false;
    }
    for (int i = 0; i < line_search_steps; i++) {
        for (size_t k = 0; k < self->lines; k++) {
            self->trial_phase[k] = self->phase[k] + step * self->direction[k];
        }
        double value = evaluate(self, self->trial_phase, self->trial_gradient);
        if (!(value <= *inout_value + armijo * step * slope)) {
            high = step;
        } else if (dot(self->lines, self->trial_gradient, self->direction) < curvature * slope) {
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
    for (size_t k = 0; k < self->lines; k++) {
        self->step_of[at][k] = self->trial_phase[k] - self->phase[k];
        self->change_of[at][k] = self->trial_gradient[k] - self->gradient[k];
    }
    double product = dot(self->lines, self->step_of[at], self->change_of[at]);
    if (product > 0) { // the line search's curvature condition gives this, but for rounding
        self->inverse_of[at] = 1 / product;
        self->newest = at;
        self->held += self->held < pair_count ? 1 : 0;
    }
    memcpy(self->phase, self->trial_phase, self->lines * sizeof(double));
    memcpy(self->gradient, self->trial_gradient, self->lines * sizeof(double));
}

static void minimise(struct polish *self, size_t iterations)
{
    self->held = 0;
    self->newest = 0;
    double value = evaluate(self, self->phase, self->gradient);
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
    const size_t lines = search->spectrum->line_count;
    struct polish self = {.search = search, .lines = lines};
    self.memory = calloc((vectors + 4) * lines, sizeof(double));
    if (!self.memory) {
        return false;
    }
    double *next = self.memory;
    double **fields[] = {&self.phase, &self.gradient, &self.direction, &self.trial_phase, &self.trial_gradient};
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; i++, next += lines) {
        *fields[i] = next;
    }
    for (size_t i = 0; i < pair_count; i++, next += 2 * lines) {
        self.step_of[i] = next;
        self.change_of[i] = next + lines;
    }
    self.c = next;
    self.y = next + 2 * lines;
    *out_polish = self;
    return true;
}

bool design_polish_run(struct design_search *search, const struct design_polish_plan *plan, double *inout_c)
{
    struct polish self;
    if (!create(search, &self)) {
        return false;
    }
    for (size_t k = 0; k < self.lines; k++) {
        self.phase[k] = atan2(inout_c[2 * k + 1], inout_c[2 * k]);
    }
    for (unsigned exponent = plan->first_exponent; exponent <= plan->last_exponent; exponent += plan->step) {
        self.exponent = exponent;
        minimise(&self, plan->iterations);
    }
    for (size_t k = 0; k < self.lines; k++) {
        inout_c[2 * k] = cos(self.phase[k]);
        inout_c[2 * k + 1] = sin(self.phase[k]);
    }
    free(self.memory);
    return true;
}
