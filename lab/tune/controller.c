/* SPDX-License-Identifier: MIT */
#include "lab/tune/controller.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double two_pi = 6.283185307179586;

const struct tune_structure tune_structures[] = {
    {.name = "p", .summary = "proportional", .form = "Kp", .gains = 1, .terms = {tune_proportional}},
    {.name = "pi",
     .summary = "proportional and integral",
     .form = "Kp + Ki Ts/(1 - z^-1)",
     .gains = 2,
     .terms = {tune_proportional, tune_integral}},
    {.name = "pid",
     .summary = "with a filtered derivative, its corner at 10 times the bandwidth",
     .form = "Kp + Ki Ts/(1 - z^-1) + Kd (1 - z^-1)/Ts (1 - a)/(1 - a z^-1)",
     .gains = 3,
     .terms = {tune_proportional, tune_integral, tune_derivative},
     .corner_ratio = 10.0,
     .leads = true},
    {.name = "lead",
     .summary = "proportional with a zero below a pole at 3 times the bandwidth",
     .form = "Kp + Kd (1 - z^-1)/Ts (1 - a)/(1 - a z^-1)",
     .gains = 2,
     .terms = {tune_proportional, tune_derivative},
     .corner_ratio = 3.0,
     .leads = true},
    {.name = "pi+notch",
     .summary = "pi behind a notch at the resonance",
     .form = "C(z) (Kp + Ki Ts/(1 - z^-1))",
     .gains = 2,
     .terms = {tune_proportional, tune_integral},
     .filter = tune_filter_notch},
    {.name = "pi+biquad",
     .summary = "pi behind zeros at the resonance and damped poles at the antiresonance",
     .form = "C(z) (Kp + Ki Ts/(1 - z^-1))",
     .gains = 2,
     .terms = {tune_proportional, tune_integral},
     .filter = tune_filter_biquad},
    {.name = NULL},
};

const struct tune_structure *tune_structure_find(const char *name, struct error *out_error)
{
    char names[256] = "";
    for (const struct tune_structure *s = tune_structures; s->name; s++) {
        if (strcmp(s->name, name) == 0) {
            return s;
        }
        const size_t used = strlen(names);
        snprintf(names + used, sizeof names - used, "%s%s", used ? ", " : "", s->name);
    }
    error_set(out_error, error_usage, "--controller: '%s', expected one of %s", name, names);
    return NULL;
}

double complex tune_controller_term(const struct tune_controller *self, size_t i, double complex delay)
{
    const double complex filter = tune_filter_at(&self->filter, delay);
    switch (self->structure->terms[i]) {
    case tune_proportional:
        break;
    case tune_integral:
        return filter / (self->rate_hz * (1.0 - delay));
    case tune_derivative: {
        const double a = exp(-two_pi * self->corner_hz / self->rate_hz);
        return filter * self->rate_hz * (1.0 - delay) * (1.0 - a) / (1.0 - a * delay);
    }
    }
    return filter;
}

double complex tune_controller_at(const struct tune_controller *self, double complex delay)
{
    double complex sum = 0.0;
    for (size_t i = 0; i < self->structure->gains; i++) {
        sum += self->gain[i] * tune_controller_term(self, i, delay);
    }
    return sum;
}

const char *tune_term_name(enum tune_term term)
{
    static const char *const names[] = {"proportional", "integral", "derivative"};
    return names[term];
}

const char *tune_term_symbol(enum tune_term term)
{
    static const char *const symbols[] = {"Kp", "Ki", "Kd"};
    return symbols[term];
}

int tune_term_power(enum tune_term term)
{
    static const int powers[] = {0, -1, 1};
    return powers[term];
}
