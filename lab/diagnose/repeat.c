/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/repeat.h"

#include "lab/diagnose/hidden_mass.h"

#include <math.h>
#include <string.h>

enum { repeat_iterations = 8 };

static const double turn = 6.283185307179586;

/// Factor on the variances of a fit whose residual carries more than noise.
static double misfit(const struct fit *fit, const struct fit_data *data)
{
    return fmax(fit->cost / (double)data->values, 1.0);
}

static double square(double x)
{
    return x * x;
}

static double surplus(const struct sim_parameter *p, double a, double b, double variance)
{
    double apart = a - b;
    if (p->kind == sim_parameter_phase)
        apart = remainder(apart, turn);
    return fmax(square(apart) - variance, 0.0);
}

static void compare_effect(const struct hypothesis *h, const struct fit *fit, double own_misfit,
                           const struct hypothesis *other, const struct fit *other_fit, double other_misfit, int effect,
                           double *out_variance)
{
    double values[2][sim_effect_parameters_max] = {{0}}, deviations[2][sim_effect_parameters_max] = {{0}};
    hypothesis_parameters(h, effect, fit->covariance, values[0], deviations[0]);
    hypothesis_parameters(other, effect, other_fit->covariance, values[1], deviations[1]);
    for (size_t i = 0; i < sim_effects[effect]->parameter_count; i++) {
        const struct sim_parameter *p = &sim_effects[effect]->parameters[i];
        bool own_phase = p->kind == sim_parameter_phase && sim_effects[effect]->in_time;
        // A deviation of zero is that of a number at its bound: it says nothing.
        bool comparable = deviations[0][i] > 0.0 && deviations[1][i] > 0.0 && !own_phase;
        double variance = own_misfit * square(deviations[0][i]) + other_misfit * square(deviations[1][i]);
        double more = comparable ? surplus(p, values[0][i], values[1][i], variance) : 0.0;
        out_variance[i] = isfinite(more) ? more : 0.0;
    }
}

/// What is at a wall of its box has no say in what the others come to; elsewhere it would move them along with it. So
/// like is compared with like: it stays there.
static void hold_walls(struct hypothesis *io)
{
    for (size_t i = 0; i < io->count; i++) {
        struct coordinate *c = &io->coordinates[i];
        if (!(io->x[i] > c->lower && io->x[i] < c->upper))
            c->lower = c->upper = io->x[i];
    }
}

bool repeat_compare(const struct fit_data *data, const struct hypothesis *hypothesis, const struct fit *fit,
                    struct fit_data *other, struct evidence *other_evidence, struct repeat *out_repeat)
{
    struct hypothesis moved = *hypothesis;
    struct fit again;
    bool any = false;
    memset(out_repeat, 0, sizeof *out_repeat);
    for (int e = 0; sim_effects[e]; e++)
        any = any || hypothesis->named[e];
    if (!any)
        return true;
    if (!fit_init(&again, other))
        return false;
    hold_walls(&moved);
    bool good = hidden_mass_concerns(other, &moved) ? hidden_mass_fit(other, other_evidence, &again, &moved)
                                                    : fit_run(&again, other, &moved, repeat_iterations);
    if (good)
        for (int e = 0; sim_effects[e]; e++)
            if (hypothesis->named[e])
                compare_effect(hypothesis, fit, misfit(fit, data), &moved, &again, misfit(&again, other), e,
                               out_repeat->variance[e]);
    fit_free(&again);
    return true;
}
