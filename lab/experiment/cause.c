/* SPDX-License-Identifier: MIT */
#include "lab/experiment/cause.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/// A cause seen with this much would be named in any run, and does not drown everything else.
static const double clear_nats = 100.0, clear_factor = 2.0;

/// Less than this is rounding.
static const double least_nats = 1e-2;

static double field(const struct sim_model *model, size_t offset)
{
    double value;
    memcpy(&value, (const char *)model + offset, sizeof value);
    return value;
}

/// Whether a cause would change what the model is made of, and the model is made that way already.
static bool has_structure(int effect, const struct sim_model *model)
{
    struct sim_model rigid = *model;
    rigid.structure = sim_structure_rigid;
    if (!sim_effects[effect]->engage || model->structure == sim_structure_rigid)
        return false;
    sim_effects[effect]->engage(&rigid);
    return rigid.structure == model->structure;
}

void cause_take_out(int effect, struct sim_model *io_model, struct separation_cause *out_cause)
{
    const struct sim_effect *e = sim_effects[effect];
    *out_cause = (struct separation_cause){.effect = effect, .source = separation_of_scan};
    if (io_model->effect_on[effect]) {
        out_cause->source = separation_of_model;
        out_cause->has_values = true;
        memcpy(out_cause->values, io_model->effect_parameters[effect], sizeof out_cause->values);
        io_model->effect_on[effect] = false;
    } else if (has_structure(effect, io_model)) {
        out_cause->source = separation_of_model;
        out_cause->has_values = true;
        for (size_t i = 0; i < e->parameter_count; i++)
            out_cause->values[i] = field(io_model, e->parameters[i].model_offset);
        io_model->structure = sim_structure_rigid;
    }
}

int cause_check(int effect, const struct sim_model *given, struct error *out_error)
{
    const struct sim_effect *e = sim_effects[effect];
    struct hypothesis h;
    hypothesis_init(&h, given, false, true);
    if (hypothesis_may_name(&h, effect))
        return 0;
    if (e->notice)
        return error_set(out_error, error_refused,
                         "%s is found in the rows of any recording, whatever is played: expected a cause that needs an "
                         "excitation",
                         e->id);
    const char *lacks =
        e->place == sim_place_belt ? "a belt (structure two_mass)" : "what it acts on (friction, a belt)";
    return error_set(out_error, error_refused, "%s cannot act in this model: expected one with %s", e->id, lacks);
}

void cause_make_drive(const struct sim_model *given, struct separation_cause *io_cause)
{
    struct hypothesis h;
    hypothesis_init(&h, given, false, true);
    h.sensors_seen = true; // all of its numbers are meant
    hypothesis_name(&h, io_cause->effect, io_cause->values);
    hypothesis_model(&h, NULL, &io_cause->drive);
}

/// The first parameter's value at which the cause is not there: the model's own number, or nothing. False where the
/// effect does not grow from it.
static bool nothing_at(const struct sim_effect *e, const struct sim_model *given, double *out_value)
{
    const struct sim_parameter *p = &e->parameters[0];
    *out_value = p->model_offset == SIZE_MAX ? 0.0 : field(given, p->model_offset);
    return p->model_offset != SIZE_MAX ? !e->engage : p->kind != sim_parameter_positive;
}

static double within(const struct sim_parameter *p, bool linear, double value)
{
    return linear ? fmin(fmax(value, p->linear_minimum), p->linear_maximum) : fmin(fmax(value, p->minimum), p->maximum);
}

/// Nats by which a drive with the cause at `size` away from nothing shows it, the rest refitted; -1: cannot be played.
static double evidence_at(const struct cause_trial *trial, double nothing, double size, struct separation_cause *cause,
                          struct error *out_error)
{
    const struct sim_model *given = trial->without->given;
    cause->values[0] = within(&sim_effects[cause->effect]->parameters[0], given->linear, nothing + size);
    cause_make_drive(given, cause);
    double nats = -1.0;
    return trial->evidence(trial->user, cause, &nats, out_error) ? -1.0 : nats;
}

/// Brings the first parameter to where the cause is seen clearly: doubled or halved until it is passed, then between.
static int resize(const struct cause_trial *trial, struct separation_cause *cause, struct error *out_error)
{
    enum { most_trials = 16 };
    double nothing, too_small = 0.0, too_large = INFINITY;
    if (!nothing_at(sim_effects[cause->effect], trial->without->given, &nothing))
        return 0;
    double size = cause->values[0] - nothing, before = cause->values[0];
    for (size_t i = 0; i < most_trials; i++) {
        double nats = evidence_at(trial, nothing, size, cause, out_error);
        if (nats < 0.0)
            return error_refused;
        if (nats >= clear_nats / clear_factor && nats <= clear_nats * clear_factor)
            return 0;
        if (nats < clear_nats)
            too_small = size;
        else
            too_large = size;
        if (fabs(too_small) > 0.0 && isfinite(too_large))
            size = copysign(sqrt(fabs(too_small) * fabs(too_large)), size);
        else
            size *= nats < clear_nats ? 2.0 : 0.5;
        bool at_bound = i > 0 && nats < clear_nats && !(fabs(cause->values[0] - before) > 0.0);
        before = cause->values[0];
        if (at_bound)
            break;
    }
    return 0;
}

/// The scan value that is seen most nearly as clearly as it should be; the first that is seen at all where the size can
/// be chosen afterwards. A long scan is looked at in a few places.
static double choose_scan(const struct contest *without, const struct sim_coverage *coverage, int effect,
                          double *out_values)
{
    const struct sim_effect *e = sim_effects[effect];
    const double least_change = 1e-3;
    double values[sim_effect_parameters_max] = {0}, best_nats = 0.0, nothing;
    size_t total = 0;
    const bool sizeable = nothing_at(e, without->given, &nothing);
    while (e->scan(without->given, coverage, total, values))
        total++;
    size_t stride = (total + sim_effect_scan_max - 1) / sim_effect_scan_max;
    for (size_t i = 0; i < total && !(sizeable && best_nats > least_nats); i += stride) {
        e->scan(without->given, coverage, i, values);
        if (sizeable && !(fabs(values[0] - nothing) > least_change * fabs(nothing)))
            continue;
        double nats = contest_visibility(without, effect, values);
        bool better = best_nats > least_nats ? fabs(log(nats / clear_nats)) < fabs(log(best_nats / clear_nats)) : true;
        if (nats > least_nats && better) {
            best_nats = nats;
            memcpy(out_values, values, sizeof values);
        }
    }
    return best_nats;
}

int cause_choose_size(const struct cause_trial *trial, struct separation_cause *io_cause, struct error *out_error)
{
    const struct contest *without = trial->without;
    const struct sim_coverage *coverage = &without->recordings[0].coverage;
    const struct sim_effect *e = sim_effects[io_cause->effect];
    const double larger = 1.5;
    double nats = choose_scan(without, coverage, io_cause->effect, io_cause->values);
    if (!(nats > least_nats) && e->parameters[0].model_offset != SIZE_MAX) {
        // The only scan value is the model's own number: a change of it is what is meant.
        e->scan(without->given, coverage, 0, io_cause->values);
        io_cause->values[0] = larger * field(without->given, e->parameters[0].model_offset);
        nats = contest_visibility(without, io_cause->effect, io_cause->values);
    }
    if (!(nats > least_nats))
        return error_set(
            out_error, error_refused,
            "%s does not show at any of its usual sizes with the excitation as given: give its size in the "
            "model's effects",
            e->id);
    io_cause->has_values = true;
    return resize(trial, io_cause, out_error);
}
