/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/hidden_mass.h"

#include "lab/diagnose/search.h"

#include <math.h>
#include <stdint.h>

enum { iterations = 10 };

bool hidden_mass_is(int effect)
{
    return sim_effects[effect]->engage || sim_effects[effect]->attach;
}

bool hidden_mass_concerns(const struct fit_data *data, const struct hypothesis *hypothesis)
{
    struct sim_model model;
    bool named = hypothesis->engaged.structure != hypothesis->given->structure, periodic = true;
    for (int e = 0; sim_effects[e]; e++)
        named = named || (hypothesis->named[e] && sim_effects[e]->attach);
    for (size_t i = 0; i < data->runs; i++)
        periodic = periodic && data->evidence[i].recording->periodic;
    hypothesis_model(hypothesis, NULL, &model);
    return named && periodic && !contrast_concerns(&model);
}

bool hidden_mass_fit(struct fit_data *data, struct evidence *evidence, struct fit *fit,
                     struct hypothesis *io_hypothesis)
{
    data->renewed = evidence;
    bool good = fit_run(fit, data, io_hypothesis, iterations);
    // The last derivative left its own noise behind.
    fit_cost(fit, data, io_hypothesis, io_hypothesis->x);
    data->renewed = NULL;
    return good;
}

double hidden_mass_credible_cost(const struct fit_data *data, double cost)
{
    const double twentieth = 1.645;
    double values = (double)data->values;
    return fmax(cost, values - twentieth * sqrt(2.0 * values));
}

/// The same without derivatives and covariance where it ends, given up where `goal` is out of reach: for the cost only.
static bool fit_for_cost(struct fit_data *data, struct evidence *evidence, struct fit *fit, double goal,
                         struct hypothesis *io_hypothesis)
{
    data->renewed = evidence;
    bool good = fit_roughly(fit, data, NULL, NULL, io_hypothesis, iterations, goal);
    data->renewed = NULL;
    return good;
}

/// What the noise depends on: the numbers of the structure, and the inertias between which it divides.
static bool is_of_structure(const struct coordinate *c)
{
    static const size_t fields[] = {
        offsetof(struct sim_model, motor_inertia_kgm2), offsetof(struct sim_model, load_inertia_kgm2),
        offsetof(struct sim_model, belt_stiffness_Nm_per_rad), offsetof(struct sim_model, belt_damping_Nms_per_rad)};
    if (c->effect >= 0 && hidden_mass_is(c->effect))
        return true;
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; i++)
        if (c->model_offset == fields[i])
            return true;
    return false;
}

void hidden_mass_hold(struct hypothesis *io_hypothesis, struct hypothesis *out_free)
{
    *out_free = *io_hypothesis;
    for (size_t i = 0; i < io_hypothesis->count; i++)
        if (is_of_structure(&io_hypothesis->coordinates[i]))
            io_hypothesis->coordinates[i].lower = io_hypothesis->coordinates[i].upper = io_hypothesis->x[i];
}

void hidden_mass_release(const struct hypothesis *free, struct hypothesis *io_hypothesis)
{
    for (size_t i = 0; i < io_hypothesis->count; i++)
        for (size_t j = 0; j < free->count; j++) {
            struct coordinate *c = &io_hypothesis->coordinates[i];
            const struct coordinate *was = &free->coordinates[j];
            if (c->effect == was->effect && c->parameter == was->parameter && c->model_offset == was->model_offset &&
                c->unit == was->unit)
                *c = *was;
        }
}

bool hidden_mass_holds(const struct hypothesis *hypothesis, int effect)
{
    for (size_t i = 0; i < hypothesis->count; i++) {
        const struct coordinate *c = &hypothesis->coordinates[i];
        if (c->effect == effect && hidden_mass_is(effect) && c->lower == c->upper)
            return true;
    }
    return false;
}

/// Fits a structure from three places of its scan: half way, three quarters, seven eighths. A belt much stiffer than
/// the excitation is fast is not found from below.
static void try_structure(struct fit_data *data, struct evidence *evidence, const struct sim_coverage *coverage,
                          const struct hypothesis *before, int effect, double *io_cost, struct fit *fit,
                          struct hypothesis *io_best)
{
    struct sim_model model;
    double values[sim_effect_parameters_max];
    size_t total = 0;
    hypothesis_model(before, NULL, &model);
    while (sim_effects[effect]->scan(&model, coverage, total, values))
        total++;
    static const size_t eighths[] = {4, 6, 7};
    for (size_t i = 0; i < sizeof eighths / sizeof eighths[0] && total > 0; i++) {
        struct hypothesis trial = *before;
        sim_effects[effect]->scan(&model, coverage, eighths[i] * total / 8, values);
        hypothesis_name(&trial, effect, values);
        if (hidden_mass_concerns(data, &trial) && fit_for_cost(data, evidence, fit, *io_cost, &trial) &&
            fit->cost < *io_cost) {
            *io_cost = fit->cost;
            *io_best = trial;
        }
    }
}

/// What an elastic axis may cost beside what a mass on a rigid one does: it has fewer parameters, and of a noise that
/// follows the parameters only so much is to be believed.
static double allowed_cost(const struct fit_data *data, const struct hypothesis *before, const struct hypothesis *with,
                           int structure, double cost)
{
    double granted = -search_threshold(data, structure);
    for (int e = 0; sim_effects[e]; e++)
        if (sim_effects[e]->attach && with->named[e] && !before->named[e])
            granted += search_threshold(data, e);
    return hidden_mass_credible_cost(data, cost) + 2.0 * fmax(granted, 0.0);
}

bool hidden_mass_instead(struct fit_data *data, struct evidence *evidence, const struct sim_coverage *coverage,
                         const struct hypothesis *before, double cost, struct fit *fit, struct hypothesis *io_h)
{
    const struct hypothesis with = *io_h;
    bool found = false;
    for (int e = 0; sim_effects[e] && !found; e++) {
        if (!sim_effects[e]->engage || !hypothesis_may_name(before, e) ||
            before->engaged.structure != before->given->structure)
            continue;
        double allowed = allowed_cost(data, before, &with, e, cost), best = allowed;
        try_structure(data, evidence, coverage, before, e, &best, fit, io_h);
        found = best < allowed;
    }
    return found && hidden_mass_fit(data, evidence, fit, io_h);
}
