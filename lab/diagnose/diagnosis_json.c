/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/diagnosis.h"
#include "lab/diagnose/wording.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>

/// A number, or null where there is none: JSON has no NaN.
static bool add_number(cJSON *object, const char *name, double value)
{
    return isfinite(value) ? cJSON_AddNumberToObject(object, name, value) != NULL
                           : cJSON_AddNullToObject(object, name) != NULL;
}

static bool add_text(cJSON *object, const char *name, const char *text)
{
    return cJSON_AddStringToObject(object, name, text) != NULL;
}

/// A new object at the end of an array, NULL if memory is short.
static cJSON *append_object(cJSON *array)
{
    cJSON *object = cJSON_CreateObject();
    if (object && !cJSON_AddItemToArray(array, object)) {
        cJSON_Delete(object);
        return NULL;
    }
    return object;
}

static bool add_parameters(cJSON *cause, const struct diagnosis_cause *found, const struct diagnosis *self)
{
    const struct sim_effect *effect = sim_effects[found->effect];
    cJSON *parameters = cJSON_AddObjectToObject(cause, "parameters");
    bool ok = parameters != NULL;
    for (size_t i = 0; ok && i < effect->parameter_count; i++) {
        const struct sim_parameter *parameter = &effect->parameters[i];
        cJSON *object = cJSON_AddObjectToObject(parameters, self->linear ? parameter->linear_name : parameter->name);
        ok = object && add_number(object, "value", found->values[i]) &&
             add_number(object, "std", found->deviations[i]) && add_number(object, "given", found->nominal[i]);
    }
    return ok;
}

static bool add_causes(cJSON *root, const char *name, const struct diagnosis_cause *causes, size_t count,
                       const struct diagnosis *self)
{
    cJSON *array = cJSON_AddArrayToObject(root, name);
    bool ok = array != NULL;
    for (size_t i = 0; ok && i < count; i++) {
        cJSON *object = append_object(array);
        ok = object && add_text(object, "id", sim_effects[causes[i].effect]->id) &&
             add_number(object, "evidence", causes[i].evidence) &&
             add_number(object, "validation_nrmse_without", causes[i].gain.without.validation_nrmse) &&
             add_number(object, "whitened_rms_without", causes[i].gain.without.whitened_rms) &&
             add_number(object, "validation_evidence", causes[i].gain.unseen_nats) &&
             add_parameters(object, &causes[i], self) && add_text(object, "says", causes[i].says);
    }
    return ok;
}

static bool add_ties(cJSON *root, const struct diagnosis *self)
{
    cJSON *array = cJSON_AddArrayToObject(root, "ties");
    bool ok = array != NULL;
    for (size_t i = 0; ok && i < self->tie_count; i++) {
        const struct diagnosis_tie *tie = &self->ties[i];
        const char *ids[] = {sim_effects[tie->effects[0]]->id,
                             tie->effects[1] == diagnosis_gain ? "gain" : sim_effects[tie->effects[1]]->id};
        cJSON *object = append_object(array);
        cJSON *names = object ? cJSON_CreateStringArray(ids, 2) : NULL;
        ok = names && cJSON_AddItemToObject(object, "causes", names) && add_text(object, "next", tie->next);
    }
    return ok;
}

static bool add_untestable(cJSON *root, const struct diagnosis *self)
{
    cJSON *array = cJSON_AddArrayToObject(root, "untestable");
    bool ok = array != NULL;
    for (size_t i = 0; ok && i < self->untestable_count; i++) {
        cJSON *object = append_object(array);
        ok = object && add_text(object, "id", sim_effects[self->untestable[i].effect]->id) &&
             add_text(object, "why", self->untestable[i].why);
    }
    return ok;
}

static bool add_figures(cJSON *root, const char *name, const struct diagnosis_figures *figures)
{
    cJSON *object = cJSON_AddObjectToObject(root, name);
    return object && add_number(object, "validation_nrmse", figures->validation_nrmse) &&
           add_number(object, "whitened_rms", figures->whitened_rms) &&
           add_number(object, "mean_rms", figures->mean_rms);
}

static bool add_unexplained(cJSON *root, const struct diagnosis *self)
{
    if (self->verdict != diagnosis_unexplained) {
        return true;
    }
    cJSON *object = cJSON_AddObjectToObject(root, "unexplained");
    return object && add_text(object, "where", self->where) && add_number(object, "share", self->unexplained_share);
}

/// Numbers of one axis' parts as an array.
static bool add_row(cJSON *object, const char *name, size_t count, const double *values)
{
    cJSON *array = cJSON_AddArrayToObject(object, name);
    bool ok = array != NULL;
    for (size_t i = 0; ok && i < count; i++) {
        cJSON *number = isfinite(values[i]) ? cJSON_CreateNumber(values[i]) : cJSON_CreateNull();
        ok = number && cJSON_AddItemToArray(array, number);
    }
    return ok;
}

/// What of a model's misfit lies in each part, and the range where it sits, if there is one.
static bool add_left(cJSON *root, const char *name, const struct misfit_axis *axis, enum misfit_model model)
{
    double rms[misfit_parts_max], share[misfit_parts_max], excess = 0.0;
    const struct misfit_range *range = &axis->range[model];
    cJSON *object = cJSON_AddObjectToObject(root, name);
    for (size_t i = 0; i < axis->parts; i++)
        excess += axis->part[i].squares[model] - axis->part[i].values;
    for (size_t i = 0; i < axis->parts; i++) {
        rms[i] = misfit_rms(&axis->part[i], model);
        share[i] = excess > 0.0 ? (axis->part[i].squares[model] - axis->part[i].values) / excess : NAN;
    }
    if (!object || !add_row(object, "rms", axis->parts, rms) || !add_row(object, "share", axis->parts, share))
        return false;
    if (!range->found)
        return true;
    cJSON *most = cJSON_AddObjectToObject(object, "most");
    return most && add_number(most, "from", range->low) && add_number(most, "to", range->high) &&
           add_number(most, "share", range->share) && add_number(most, "of_values", range->values);
}

static bool add_axis(cJSON *root, const struct misfit_axis *axis, enum misfit_axis_kind kind, bool linear)
{
    double from[misfit_parts_max], to[misfit_parts_max];
    cJSON *object = cJSON_AddObjectToObject(root, misfit_axis_name(kind, linear));
    for (size_t i = 0; i < axis->parts; i++) {
        from[i] = axis->part[i].low;
        to[i] = axis->part[i].high;
    }
    return object && add_row(object, "from", axis->parts, from) && add_row(object, "to", axis->parts, to) &&
           add_left(object, "nominal", axis, misfit_given) && add_left(object, "extended", axis, misfit_extended);
}

static bool add_misfit(cJSON *root, const struct diagnosis *self)
{
    const struct misfit *m = &self->misfit;
    char given[wording_size], left[wording_size];
    cJSON *object = cJSON_AddObjectToObject(root, "misfit");
    wording_where(self, m, misfit_given, given);
    wording_where(self, m, misfit_extended, left);
    bool ok = object && add_text(object, "nominal_where", given) && add_text(object, "extended_where", left) &&
              add_number(object, "nominal_noise_share", misfit_noise_share(m, misfit_given)) &&
              add_number(object, "extended_noise_share", misfit_noise_share(m, misfit_extended));
    for (int a = 0; ok && a < misfit_axes; a++)
        ok = add_axis(object, &m->axes[a], (enum misfit_axis_kind)a, self->linear);
    return ok;
}

static bool add_notes(cJSON *root, const struct diagnosis *self)
{
    cJSON *array = cJSON_AddArrayToObject(root, "notes");
    bool ok = array != NULL;
    for (size_t i = 0; ok && i < self->oddities.count; i++) {
        cJSON *text = cJSON_CreateString(self->oddities.texts[i]);
        ok = text && cJSON_AddItemToArray(array, text);
    }
    return ok;
}

static bool add_gain(cJSON *root, const struct diagnosis *self)
{
    if (!self->input_unit) {
        return true;
    }
    cJSON *object = cJSON_AddObjectToObject(root, "input_gain");
    return object && add_text(object, "input_unit", self->input_unit) &&
           add_number(object, "value", self->input_gain) && add_number(object, "std", self->input_gain_deviation);
}

static bool add_next(cJSON *root, const struct diagnosis *self)
{
    enum { sentences_max = 24 };
    cJSON *array = cJSON_AddArrayToObject(root, "next");
    char(*sentences)[wording_size] = malloc(sentences_max * sizeof *sentences);
    bool ok = array && sentences;
    size_t count = ok ? wording_next(self, sentences_max, sentences) : 0;
    for (size_t i = 0; ok && i < count; i++) {
        cJSON *text = cJSON_CreateString(sentences[i]);
        ok = text && cJSON_AddItemToArray(array, text);
    }
    free(sentences);
    return ok;
}

/// What a reader of the file alone would miss: the verdict as a sentence, and what it rests on.
static bool add_context(cJSON *root, const struct diagnosis *self)
{
    char headline[wording_size], gain[wording_size];
    wording_headline(self, headline);
    wording_gain(self, gain);
    return add_text(root, "headline", headline) && add_text(root, "gain", gain) && add_text(root, "runs", self->runs) &&
           add_text(root, "judged_on", self->judged) && add_text(root, "motion_from", self->motion_from) &&
           add_notes(root, self) && add_next(root, self) && cJSON_AddBoolToObject(root, "linear", self->linear) &&
           cJSON_AddBoolToObject(root, "model_given", self->model_given) &&
           cJSON_AddBoolToObject(root, "held_back", self->held_back) &&
           add_number(root, "fit_misfit", self->fit_misfit) && add_gain(root, self);
}

const char *diagnosis_verdict_str(enum diagnosis_verdict verdict)
{
    switch (verdict) {
    case diagnosis_explained:
        return "explained";
    case diagnosis_unexplained:
        return "unexplained";
    case diagnosis_no_discrepancy:
        return "no_discrepancy";
    }
    return "unknown";
}

static bool add_models(cJSON *root, const struct diagnosis *self)
{
    return add_figures(root, "nominal", &self->nominal) && add_figures(root, "refitted", &self->refitted) &&
           add_figures(root, "extended", &self->extended) &&
           add_number(root, "noise_floor_nrmse", self->noise_floor_nrmse) &&
           add_number(root, "mean_rms_chance", self->mean_rms_chance) &&
           add_number(root, "black_box_rms", self->black_box_rms);
}

cJSON *diagnosis_json(const struct diagnosis *self)
{
    cJSON *root = cJSON_CreateObject();
    bool ok = root && add_text(root, "verdict", diagnosis_verdict_str(self->verdict)) &&
              add_causes(root, "causes", self->causes, self->cause_count, self) &&
              add_causes(root, "candidates", self->candidates, self->candidate_count, self) && add_ties(root, self) &&
              add_untestable(root, self) && add_models(root, self) && add_unexplained(root, self) &&
              add_misfit(root, self) && add_context(root, self);
    if (!ok) {
        cJSON_Delete(root);
        return NULL;
    }
    return root;
}
