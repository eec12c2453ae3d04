/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/cause_gain.h"

#include "lab/diagnose/validate.h"

#include <math.h>

enum { iterations = 4 };

/// Number of squares that whitened_rms is the mean of.
static double squares_of(const struct fit_data *data)
{
    double count = 0.0;
    for (size_t i = 0; i < data->runs; i++)
        count += (double)data->evidence[i].recording->periods * (double)data->evidence[i].values;
    return count;
}

bool cause_gain_measure(const struct fit_data *data, const struct hypothesis *hypothesis, const struct fit_data *unseen,
                        int effect, struct cause_gain *out_gain)
{
    struct hypothesis without = *hypothesis;
    struct sim_model with_model, without_model;
    struct fit trial;
    hypothesis_unname(&without, effect);
    hypothesis_model(hypothesis, NULL, &with_model);
    hypothesis_model(&without, NULL, &without_model);
    const struct diagnosis_figures with = validate_figures(unseen, &with_model),
                                   kept = validate_figures(unseen, &without_model);
    double squares = squares_of(unseen);
    out_gain->unseen_nats =
        0.5 * squares * (kept.whitened_rms * kept.whitened_rms - with.whitened_rms * with.whitened_rms);
    out_gain->without = (struct diagnosis_figures){NAN, NAN, NAN};
    if (!fit_init(&trial, data))
        return false;
    if (fit_roughly(&trial, data, NULL, NULL, &without, iterations, INFINITY)) {
        hypothesis_model(&without, NULL, &without_model);
        out_gain->without = validate_figures(unseen, &without_model);
    }
    fit_free(&trial);
    return true;
}

/// Less than this, in nats, is nothing beside what a cause earns where it was fitted.
static double little(const struct diagnosis_cause *cause, double share)
{
    const double floor_nats = 12.0; // as of a name
    return fmax(floor_nats, share * cause->evidence);
}

bool cause_gain_is_hidden(const struct diagnosis_cause *cause)
{
    const double share = 0.01;
    return fabs(cause->gain.unseen_nats) < little(cause, share);
}

bool cause_gain_is_harm(const struct diagnosis_cause *cause)
{
    const double share = 0.05;
    return cause->gain.unseen_nats < -little(cause, share);
}
