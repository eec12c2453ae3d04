/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_identify.h"

#include "lab/estimate/parametric_delay.h"
#include "lab/estimate/parametric_plant.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { order_max = 6 };

/// Nats by which a model of the other domain has to be shorter before that is said; fewer if it has fewer poles too.
static const double surely_other = 10.0;
static const double simpler_other = 2.0;

/// Highest order that the lines can carry, `order_max` if they are many.
static size_t highest_order(const struct parametric_data *data)
{
    size_t lines = data->count;
    size_t order = lines > 4 ? (lines - 2) / 2 : 1;
    return order < order_max ? order : order_max;
}

static int choose(const struct parametric_data *data, const struct parametric_request *request,
                  struct parametric_outcome *io_outcome, struct error *out_error)
{
    struct parametric_orders_options options = {
        .structure = {.domain = request->domain, .delay_free = request->delay_free},
        .denominator_max = highest_order(data)};
    parametric_delay_find(data, options.denominator_max, &options.structure);
    return parametric_orders_choose(data, &options, &io_outcome->orders, &io_outcome->model, out_error);
}

/// A model rich enough that what it leaves is not dynamics that another order has: that of least description length.
static bool richest(const struct parametric_data *data, const struct parametric_outcome *outcome,
                    struct parametric_model *out_model)
{
    const struct parametric_order_row *row = &outcome->orders.rows[outcome->orders.by_mdl];
    struct parametric_structure structure = outcome->model.structure;
    structure.numerator_order = row->numerator_order;
    structure.denominator_order = row->denominator_order;
    return parametric_fit(data, &structure, NULL, out_model, NULL) == 0;
}

static void note_misfit(const struct parametric_model *model, struct parametric_outcome *io_outcome)
{
    io_outcome->noise_cost = model->cost;
    io_outcome->noise_cost_expected = model->cost_expected;
    io_outcome->noise_cost_std = model->cost_std;
    io_outcome->misfit = parametric_misfit(model);
}

/// The drive without the hold; where the coefficient for a part of a sample of delay speaks for none, that of the model
/// without it.
static bool find_plant(const struct parametric_data *data, const struct parametric_model *model,
                       struct parametric_model *out_plant)
{
    struct parametric_structure structure = model->structure;
    struct parametric_model whole;
    bool found = parametric_plant_of(model, out_plant);
    bool shorter = !found && structure.domain == parametric_discrete && structure.numerator_order > 0 &&
                   structure.numerator_order == structure.denominator_order;
    structure.numerator_order -= shorter ? 1 : 0;
    if (shorter && parametric_fit(data, &structure, NULL, &whole, NULL) == 0) {
        parametric_inflate(&whole, parametric_misfit(&whole));
        found = parametric_plant_of(&whole, out_plant);
    }
    if (found) {
        parametric_mark_cancelling(out_plant);
    }
    return found;
}

static bool can_be_sampled(const struct parametric_data *data)
{
    bool can = data->sample_rate_hz > 0.0;
    for (size_t k = 0; k < data->count; k++) {
        can = can && data->frequency_hz[k] < 0.5 * data->sample_rate_hz;
    }
    return can;
}

static void look_at_other_domain(const struct parametric_data *data, struct parametric_outcome *io_outcome)
{
    const struct parametric_model *model = &io_outcome->model;
    bool discrete = model->structure.domain == parametric_discrete;
    struct parametric_structure other = {.domain = discrete ? parametric_continuous : parametric_discrete};
    struct parametric_model best;
    if (!can_be_sampled(data)) {
        return;
    }
    // More poles than this model has would be no improvement.
    parametric_delay_find(data, model->structure.denominator_order, &other);
    double length = parametric_shortest(data, &other, model->structure.denominator_order, &best);
    double own = io_outcome->orders.rows[io_outcome->orders.by_mdl].mdl;
    bool simpler = length < own && best.structure.denominator_order < model->structure.denominator_order;
    if (length < own - (simpler ? simpler_other : surely_other)) {
        snprintf(io_outcome->hint, sizeof io_outcome->hint,
                 "a model in %s with %zu poles describes this recording in %.0f nats less than the one in %s: it looks "
                 "%s (%s)",
                 discrete ? "s" : "1/z", best.structure.denominator_order, own - length, discrete ? "1/z" : "s",
                 discrete ? "measured behind an anti-alias filter" : "as if the input is held between samples",
                 discrete ? "--hold band-limited --domain continuous" : "--hold zoh, and the default domain");
    }
}

/// Whether some line's variance is not noise alone.
static bool has_distortion(const struct parametric_weights *weights, size_t count)
{
    bool has = false;
    for (size_t k = 0; k < count && weights->noise_share; k++) {
        has = has || weights->noise_share[k] < 1.0;
    }
    return has;
}

static int complete(const struct parametric_data *data, const struct parametric_weights *weights,
                    struct parametric_outcome *io_outcome, struct error *out_error)
{
    struct parametric_model *model = &io_outcome->model;
    io_outcome->variance_dof = data->variance_dof;
    io_outcome->noise = *model;
    if (has_distortion(weights, data->count)) {
        int status = parametric_noise_bound(data, weights->noise_share, model, &io_outcome->noise, out_error);
        if (status) {
            return status;
        }
    }
    parametric_inflate(model, parametric_misfit(model));
    parametric_mark_cancelling(model);
    io_outcome->has_plant = find_plant(data, model, &io_outcome->plant);
    look_at_other_domain(data, io_outcome);
    io_outcome->made = true;
    return 0;
}

int parametric_identify(struct parametric_data *io_data, const struct parametric_weights *weights,
                        const struct parametric_request *request, struct parametric_outcome *out_outcome,
                        struct error *out_error)
{
    struct parametric_outcome *outcome = out_outcome; // large: built in place
    memset(outcome, 0, sizeof *outcome);
    outcome->pooled_lines = parametric_weights_pool(weights, io_data);
    int status = choose(io_data, request, outcome, out_error);
    if (!status) {
        struct parametric_model rich;
        note_misfit(&outcome->model, outcome);
        if (outcome->misfit > 1.0 && richest(io_data, outcome, &rich) && parametric_misfit(&rich) > 1.0) {
            status = parametric_weights_add_distortion(weights, &rich, io_data)
                         ? choose(io_data, request, outcome, out_error)
                         : error_set(out_error, error_refused, "%s: memory is short", io_data->name);
        }
    }
    status = status ? status : complete(io_data, weights, outcome, out_error);
    if (status) {
        memset(outcome, 0, sizeof *outcome);
    }
    return status;
}
