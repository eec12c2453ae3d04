/* SPDX-License-Identifier: MIT */
#include "lab/tune/tune_json.h"

#include "lab/tune/say.h"

#include <math.h>
#include <stdio.h>

static void add_valued(cJSON *object, const char *name, double value, double std)
{
    cJSON *pair = cJSON_AddObjectToObject(object, name);
    cJSON_AddNumberToObject(pair, "value", value);
    cJSON_AddNumberToObject(pair, "std", std);
}

static void add_gains(cJSON *root, const struct tune_result *result)
{
    const struct tune_controller *controller = &result->solution.controller;
    cJSON *gains = cJSON_AddObjectToObject(root, "gains");
    for (size_t i = 0; i < controller->structure->gains; i++) {
        char suffix[tune_unit_size], readable[tune_unit_size], name[2 * tune_unit_size];
        const enum tune_term term = controller->structure->terms[i];
        tune_plant_gain_unit(&result->plant, tune_term_power(term), suffix, readable);
        snprintf(name, sizeof name, "%s_%s", tune_term_name(term), suffix);
        add_valued(gains, name, controller->gain[i], result->deviation.known ? result->deviation.gain[i] : NAN);
    }
    if (controller->corner_hz > 0.0) {
        cJSON_AddNumberToObject(root, "derivative_corner_hz", controller->corner_hz);
    }
}

static void add_filter(cJSON *root, const struct tune_filter *filter)
{
    if (!filter->on) {
        cJSON_AddNullToObject(root, "filter");
        return;
    }
    cJSON *object = cJSON_AddObjectToObject(root, "filter");
    cJSON_AddNumberToObject(object, "zero_hz", filter->zero_hz);
    cJSON_AddNumberToObject(object, "zero_damping", filter->zero_damping);
    cJSON_AddNumberToObject(object, "pole_hz", filter->pole_hz);
    cJSON_AddNumberToObject(object, "pole_damping", filter->pole_damping);
    cJSON_AddItemToObject(object, "b", cJSON_CreateDoubleArray(filter->b, 3));
    cJSON_AddItemToObject(object, "a", cJSON_CreateDoubleArray(filter->a, 3));
}

static void add_model_controller(cJSON *root, const struct tune_result *result)
{
    const struct say_model_controller model = say_model_controller(result);
    if (!model.exists) {
        cJSON_AddNullToObject(root, "model_controller");
        return;
    }
    cJSON *object = cJSON_AddObjectToObject(root, "model_controller");
    cJSON_AddNumberToObject(object, model.gain_name, model.gain);
    cJSON_AddNumberToObject(object, "velocity_integral_time_s", model.integral_time_s);
}

static void add_reference(cJSON *root, const struct tune_result *result)
{
    const struct tune_reference *reference = &result->solution.reference;
    cJSON *object = cJSON_AddObjectToObject(root, "reference");
    cJSON_AddNumberToObject(object, "bandwidth_hz", reference->bandwidth_hz);
    cJSON_AddNumberToObject(object, "damping", reference->damping);
    cJSON_AddNumberToObject(object, "delay_samples", reference->delay_samples);
    cJSON_AddNumberToObject(object, "cutoff_hz", tune_reference_cutoff_hz(reference));
    cJSON *fit = cJSON_AddObjectToObject(root, "fit");
    cJSON_AddStringToObject(fit, "method", result->solution.reweighted ? "reweighted" : "linear");
    cJSON_AddStringToObject(fit, "weighting", result->weighting == tune_weighting_log ? "log" : "flat");
    cJSON_AddNumberToObject(fit, "cost_db", 10.0 * log10(result->solution.cost));
    cJSON_AddNumberToObject(fit, "linear_cost_db", 10.0 * log10(result->solution.cost_linear));
}

static void add_margins(cJSON *root, const struct tune_result *result)
{
    const struct margins *m = &result->margins;
    const struct margins none = {NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN};
    const struct margins *s = result->deviation.known ? &result->deviation.margins : &none;
    cJSON *object = cJSON_AddObjectToObject(root, "margins");
    add_valued(object, "gain_db", m->gain_db, s->gain_db);
    cJSON_AddNumberToObject(object, "gain_hz", m->gain_hz);
    add_valued(object, "gain_reduction_db", m->gain_reduction_db, s->gain_reduction_db);
    cJSON_AddNumberToObject(object, "gain_reduction_hz", m->gain_reduction_hz);
    add_valued(object, "phase_deg", m->phase_deg, s->phase_deg);
    cJSON_AddNumberToObject(object, "phase_hz", m->phase_hz);
    add_valued(object, "delay_s", m->delay_s, s->delay_s);
    add_valued(object, "max_sensitivity", m->modulus, s->modulus);
    cJSON_AddNumberToObject(object, "max_sensitivity_hz", m->modulus_hz);
    add_valued(root, "crossover_hz", m->crossover_hz, s->crossover_hz);
    add_valued(root, "cutoff_hz", m->cutoff_hz, s->cutoff_hz);
    add_valued(root, "last_cutoff_hz", m->last_cutoff_hz, s->last_cutoff_hz);
}

static void add_stability(cJSON *root, const struct tune_result *result)
{
    const struct nyquist *nyquist = &result->solution.nyquist;
    cJSON *object = cJSON_AddObjectToObject(root, "stability");
    cJSON_AddBoolToObject(object, "stable", nyquist->verdict == nyquist_stable);
    cJSON_AddNumberToObject(object, "lines", (double)result->plant.count);
    cJSON_AddNumberToObject(object, "lines_skipped", (double)result->plant.skipped);
    cJSON_AddNumberToObject(object, "lines_not_valid", (double)result->plant.left_out);
    cJSON_AddNumberToObject(object, "doubt_at_crossover", result->doubt_at_crossover);
    cJSON_AddNumberToObject(object, "first_hz", result->plant.frequency_hz[0]);
    cJSON_AddNumberToObject(object, "first_gain_db", nyquist->first_gain_db);
    cJSON_AddNumberToObject(object, "last_hz", result->plant.frequency_hz[result->plant.count - 1]);
    cJSON_AddNumberToObject(object, "last_gain_db", nyquist->last_gain_db);
    cJSON *assumes = cJSON_AddArrayToObject(object, "assumes");
    for (size_t i = 0; i < nyquist_assumptions; i++) {
        cJSON_AddItemToArray(assumes, cJSON_CreateString(nyquist->assumptions[i]));
    }
    if (result->deviation.known) {
        cJSON_AddNumberToObject(object, "draws", tune_draws);
        cJSON_AddNumberToObject(object, "draws_stable", (double)result->deviation.stable);
    }
}

static void add_resonance(cJSON *root, const struct resonance *resonance)
{
    if (!resonance->found) {
        cJSON_AddNullToObject(root, "resonance");
        return;
    }
    cJSON *object = cJSON_AddObjectToObject(root, "resonance");
    cJSON_AddNumberToObject(object, "frequency_hz", resonance->frequency_hz);
    cJSON_AddNumberToObject(object, "damping", resonance->damping);
    cJSON_AddNumberToObject(object, "prominence_db", resonance->prominence_db);
    cJSON_AddNumberToObject(object, "antiresonance_hz",
                            resonance->has_antiresonance ? resonance->antiresonance_hz : NAN);
    cJSON_AddNumberToObject(object, "antiresonance_damping",
                            resonance->has_antiresonance ? resonance->antiresonance_damping : NAN);
}

cJSON *tune_json(const char *path, const struct tune_result *result)
{
    const struct tune_controller *controller = &result->solution.controller;
    cJSON *root = cJSON_CreateObject();
    cJSON_AddStringToObject(root, "frf", path);
    cJSON_AddStringToObject(root, "controller", controller->structure->name);
    cJSON_AddStringToObject(root, "feedback", result->plant.output == tune_output_velocity ? "velocity" : "position");
    cJSON_AddStringToObject(root, "form", controller->structure->form);
    cJSON_AddNumberToObject(root, "sample_rate_hz", controller->rate_hz);
    cJSON_AddNumberToObject(root, "response_rate_hz",
                            result->plant.response_rate_hz > 0.0 ? result->plant.response_rate_hz : NAN);
    cJSON_AddNumberToObject(root, "loop_delay_s", result->plant.loop_delay_s);
    add_gains(root, result);
    add_filter(root, &controller->filter);
    add_model_controller(root, result);
    add_reference(root, result);
    add_stability(root, result);
    add_margins(root, result);
    add_resonance(root, &result->resonance);
    cJSON *warnings = cJSON_AddArrayToObject(root, "warnings");
    for (size_t i = 0; i < result->warning_count; i++) {
        cJSON_AddItemToArray(warnings, cJSON_CreateString(result->warnings[i]));
    }
    return root;
}
