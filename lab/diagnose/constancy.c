/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/constancy.h"

#include "lab/diagnose/slow.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Sum over the slow courses of the squares of one run's contrasts along a column, which noise makes one each.
static double slow_along_column(const struct evidence *e, const double *column, const double *contrasts,
                                double *courses)
{
    size_t P = e->recording->periods, orders = slow_courses(P, courses), width = e->contrast.width;
    double along[slow_orders_most] = {0.0}, square = 0.0, sum = 0.0;
    for (size_t i = 0; i < width; i++) {
        // A period's values are bin 0, then real and imaginary parts; the block's have the actuator between them.
        size_t bin = (i + 1) / 2;
        double c = column[bin == 0 ? 0 : 1 + 2 * e->channels * (bin - 1) + (i + 1) % 2];
        square += c * c;
        for (size_t q = 0; q < orders; q++)
            for (size_t p = 0; p < P; p++)
                along[q] += courses[q * P + p] * c * contrasts[p * width + i];
    }
    for (size_t q = 0; q < orders; q++)
        sum += square > 0.0 ? along[q] * along[q] / square : 0.0;
    return sum;
}

/// One coordinate over all runs: the largest. contrasts: of all runs
static double coordinate_nats(const struct fit_data *data, const struct fit *fit, const double *contrasts,
                              size_t coordinate)
{
    const double *column = fit->jacobian + coordinate * fit->rows;
    double most = 0.0;
    for (size_t i = 0; i < data->runs; i++) {
        const struct evidence *e = &data->evidence[i];
        size_t P = e->recording->periods;
        double *courses =
            e->contrast.values > 0 && P >= slow_fewest_periods ? malloc(slow_orders_most * P * sizeof *courses) : NULL;
        if (courses)
            most = fmax(most, 0.5 * slow_along_column(e, column, contrasts, courses));
        free(courses);
        column += e->values;
        contrasts += e->contrast.values;
    }
    return most;
}

/// What stays of the contrasts of all runs under a model; NULL if memory is short.
static double *contrasts_under(const struct fit_data *data, const struct hypothesis *hypothesis)
{
    double *all = malloc((data->contrasts + 1) * sizeof *all), *at = all;
    bool good = all != NULL;
    for (size_t i = 0; good && i < data->runs; i++) {
        struct sim_model model;
        hypothesis_model(hypothesis, NULL, &model);
        good = contrast_align(&data->evidence[i], &model, &model) &&
               contrast_residual(&data->evidence[i], &model, at, NULL);
        at += data->evidence[i].contrast.values;
    }
    if (good)
        return all;
    free(all);
    return NULL;
}

/// What the fit leaves of the contrasts of all runs: without an effect in time they are as they were; NULL if memory is
/// short.
static double *contrasts_left(const struct fit_data *data, const struct fit *fit)
{
    double *all = malloc((data->contrasts + 1) * sizeof *all), *at = all;
    if (all && fit->rows > data->values)
        memcpy(all, fit->residual + data->values, data->contrasts * sizeof *all);
    for (size_t i = 0; all && fit->rows == data->values && i < data->runs; i++) {
        const struct contrast *c = &data->evidence[i].contrast;
        if (c->values > 0)
            memcpy(at, c->base, c->values * sizeof *at);
        at += c->values;
    }
    return all;
}

double constancy_nats(const struct fit_data *data, const struct hypothesis *hypothesis, const struct fit *fit,
                      int effect)
{
    double most = 0.0, *contrasts = sim_effects[effect]->in_time ? NULL : contrasts_left(data, fit);
    for (size_t i = 0; contrasts && i < hypothesis->count; i++)
        if (hypothesis->coordinates[i].effect == effect)
            most = fmax(most, coordinate_nats(data, fit, contrasts, i));
    free(contrasts);
    return most;
}

double constancy_nats_in_time(const struct fit_data *data, const struct hypothesis *hypothesis, const struct fit *fit,
                              int effect)
{
    struct hypothesis without = *hypothesis;
    hypothesis_unname(&without, effect);
    double *left = contrasts_under(data, hypothesis), *bare = contrasts_under(data, &without), nats = 0.0, rival = 0.0;
    for (size_t i = 0; left && bare && i < data->contrasts; i++)
        nats += 0.5 * (bare[i] * bare[i] - left[i] * left[i]);
    for (size_t i = 0; bare && contrast_is_line(effect) && i < hypothesis->count; i++)
        if (hypothesis->coordinates[i].effect < 0)
            rival = fmax(rival, coordinate_nats(data, fit, bare, i));
    free(left);
    free(bare);
    return nats - rival;
}

bool constancy_is_broken(double nats, double evidence)
{
    const double beyond_chance = 12.0, share = 0.01; // of the squares: a tenth of the size
    return nats > beyond_chance && nats > share * evidence;
}
