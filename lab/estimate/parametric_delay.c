/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_delay.h"

#include "lab/estimate/parametric_orders.h"
#include "lab/estimate/parametric_problem.h"

#include <math.h>

/// Held input acts one sample later at the earliest: that it acts at once has to shorten the description by as much.
static const double as_short = 3.0;

/// Samples without a gain before the search ends.
enum { patience = 3 };

double parametric_shortest(const struct parametric_data *data, const struct parametric_structure *structure,
                           size_t order_max, struct parametric_model *out_model)
{
    double best = INFINITY;
    for (size_t order = 1; order <= order_max; order++) {
        struct parametric_structure trial = *structure;
        struct parametric_model model;
        trial.numerator_order = order;
        trial.denominator_order = order;
        if (parametric_fit_quickly(data, &trial, &model, NULL) != 0) {
            continue;
        }
        double length = parametric_description_length(model.lines, model.parameters, model.cost);
        // Unstable poles can stand for a delay that is too long.
        if (model.stable && length < best) {
            best = length;
            if (out_model) {
                *out_model = model;
            }
        }
    }
    return best;
}

/// Lengths fall towards the right delay and rise behind it, where noise may let them fall again a little.
static void find_samples(const struct parametric_data *data, size_t order_max,
                         struct parametric_structure *io_structure)
{
    struct parametric_structure trial = *io_structure;
    double length[parametric_delay_samples_max + 1];
    int best = 0;
    int last = 0;
    for (; last <= parametric_delay_samples_max && last - best <= patience; last++) {
        trial.delay_s = last / data->sample_rate_hz;
        length[last] = parametric_shortest(data, &trial, order_max, NULL);
        best = length[last] < length[best] ? last : best;
    }
    best = best == 0 && length[1] <= length[0] + as_short ? 1 : best;
    io_structure->delay_s = best / data->sample_rate_hz;
}

/// With a delay no more poles are needed than without.
static void find_time(const struct parametric_data *data, size_t order_max, struct parametric_structure *io_structure)
{
    struct parametric_structure trial = *io_structure;
    struct parametric_model without;
    struct parametric_model with;
    double fastest_hz = 0.0;
    for (size_t k = 0; k < data->count; k++) {
        fastest_hz = fmax(fastest_hz, data->frequency_hz[k]);
    }
    double length = parametric_shortest(data, io_structure, order_max, &without);
    trial.delay_free = true;
    order_max = isfinite(length) ? without.structure.denominator_order : order_max;
    if (parametric_shortest(data, &trial, order_max, &with) < length && with.delay_s > 0.0) {
        double around_s = 0.25 / fastest_hz;
        io_structure->delay_free = true;
        io_structure->delay_s = fmax(with.delay_s - around_s, 0.0);
        io_structure->delay_limit_s = 2.0 * around_s;
    }
}

void parametric_delay_find(const struct parametric_data *data, size_t order_max,
                           struct parametric_structure *io_structure)
{
    if (io_structure->delay_free || io_structure->delay_s != 0.0) {
        return;
    }
    if (io_structure->domain == parametric_discrete && data->sample_rate_hz > 0.0) {
        find_samples(data, order_max, io_structure);
    } else if (io_structure->domain == parametric_continuous) {
        find_time(data, order_max, io_structure);
    }
}
