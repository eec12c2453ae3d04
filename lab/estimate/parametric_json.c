/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_frf.h"

#include <math.h>

/// Powers of s count in rad/s, those of x = s / scale do not; the highest of the denominator stays 1.
static double unit_of(const struct parametric_model *model, size_t power)
{
    if (model->structure.domain == parametric_discrete) {
        return 1.0;
    }
    return pow(model->scale_rad_per_s, (double)model->structure.denominator_order - (double)power);
}

static bool add_coefficients(cJSON *object, const char *name, const struct parametric_model *model,
                             const double *values, size_t count)
{
    cJSON *array = cJSON_AddArrayToObject(object, name);
    for (size_t i = 0; i < count && array; i++) {
        cJSON *number = cJSON_CreateNumber(values[i] * unit_of(model, i));
        if (!number || !cJSON_AddItemToArray(array, number)) {
            cJSON_Delete(number);
            return false;
        }
    }
    return array != NULL;
}

static bool add_number(cJSON *object, const char *name, double value)
{
    return cJSON_AddNumberToObject(object, name, value) != NULL;
}

static bool add_roots(cJSON *object, const char *name, const struct parametric_root *roots, size_t count)
{
    cJSON *array = cJSON_AddArrayToObject(object, name);
    for (size_t i = 0; i < count; i++) {
        cJSON *root = cJSON_CreateObject();
        if (!root || !array || !cJSON_AddItemToArray(array, root)) {
            cJSON_Delete(root);
            return false;
        }
        if (!add_number(root, "frequency_hz", roots[i].frequency_hz) ||
            !add_number(root, "frequency_std_hz", roots[i].frequency_std_hz) ||
            !add_number(root, "damping", roots[i].damping) || !add_number(root, "damping_std", roots[i].damping_std) ||
            !add_number(root, "real_rad_per_s", creal(roots[i].s_rad_per_s)) ||
            !add_number(root, "imag_rad_per_s", cimag(roots[i].s_rad_per_s)) ||
            !cJSON_AddBoolToObject(root, "pair", roots[i].pair) ||
            !cJSON_AddBoolToObject(root, "cancels", roots[i].cancels)) {
            return false;
        }
    }
    return array != NULL;
}

static bool add_row(cJSON *array, const struct parametric_order_row *row)
{
    cJSON *object = cJSON_CreateObject();
    if (!object || !cJSON_AddItemToArray(array, object)) {
        cJSON_Delete(object);
        return false;
    }
    return add_number(object, "numerator_order", (double)row->numerator_order) &&
           add_number(object, "denominator_order", (double)row->denominator_order) &&
           add_number(object, "parameters", (double)row->parameters) && add_number(object, "cost", row->cost) &&
           add_number(object, "cost_expected", row->cost_expected) && add_number(object, "mdl", row->mdl) &&
           (!row->judged || add_number(object, "held_out_error", row->held_out)) &&
           cJSON_AddBoolToObject(object, "stable", row->stable) &&
           cJSON_AddBoolToObject(object, "doubtful", row->doubtful);
}

static bool add_orders(cJSON *object, const struct parametric_orders *orders)
{
    cJSON *array = cJSON_AddArrayToObject(object, "orders");
    bool good = array && cJSON_AddStringToObject(object, "why", orders->why);
    for (size_t i = 0; i < orders->count && good; i++) {
        good = !orders->rows[i].fitted || add_row(array, &orders->rows[i]);
    }
    return good;
}

static bool add_fit(cJSON *object, const struct parametric_model *model)
{
    bool good = add_number(object, "lines", (double)model->lines) &&
                add_number(object, "parameters", (double)model->parameters) && add_number(object, "cost", model->cost);
    if (good && model->cost_expected > 0.0) {
        good = add_number(object, "cost_expected", model->cost_expected) &&
               add_number(object, "cost_std", model->cost_std) &&
               add_number(object, "misfit", parametric_misfit(model));
    } else if (good) {
        good = add_number(object, "noise_std", model->noise_std);
    }
    return good && add_number(object, "residual_correlation", model->residual_correlation) &&
           add_number(object, "whiteness_chance", model->whiteness_chance) &&
           add_number(object, "condition", model->condition) &&
           cJSON_AddBoolToObject(object, "stable", model->stable) &&
           cJSON_AddBoolToObject(object, "converged", model->converged);
}

static bool add_polynomials(cJSON *object, const struct parametric_model *model)
{
    size_t above = model->structure.numerator_order + 1;
    size_t below = model->structure.denominator_order + 1;
    return add_coefficients(object, "numerator", model, model->numerator, above) &&
           add_coefficients(object, "numerator_std", model, model->numerator_std, above) &&
           add_coefficients(object, "denominator", model, model->denominator, below) &&
           add_coefficients(object, "denominator_std", model, model->denominator_std, below);
}

static bool fill(cJSON *object, const struct parametric_model *model)
{
    bool discrete = model->structure.domain == parametric_discrete;
    bool good = cJSON_AddStringToObject(object, "variable", discrete ? "z^-1" : "s") != NULL;
    if (good && discrete) {
        good = add_number(object, "sample_rate_hz", model->sample_rate_hz);
    }
    good = good && add_polynomials(object, model) && add_number(object, "delay_s", model->delay_s) &&
           add_number(object, "delay_std_s", model->delay_std_s);
    if (good && model->dc_gain_known) {
        good = add_number(object, "dc_gain", model->dc_gain) && add_number(object, "dc_gain_std", model->dc_gain_std);
    }
    return good && add_roots(object, "poles", model->poles, model->pole_count) &&
           add_roots(object, "zeros", model->zeros, model->zero_count) && add_fit(object, model);
}

cJSON *parametric_json(const struct parametric_model *model, const struct parametric_orders *orders)
{
    cJSON *object = cJSON_CreateObject();
    if (object && (!fill(object, model) || (orders && !add_orders(object, orders)))) {
        cJSON_Delete(object);
        object = NULL;
    }
    return object;
}

static bool fill_outcome(cJSON *object, const struct parametric_outcome *outcome)
{
    bool good = add_number(object, "pooled_lines", (double)outcome->pooled_lines);
    if (good && outcome->noise_cost_expected > 0.0) {
        good = add_number(object, "noise_cost", outcome->noise_cost) &&
               add_number(object, "noise_cost_expected", outcome->noise_cost_expected) &&
               add_number(object, "noise_cost_std", outcome->noise_cost_std) &&
               add_number(object, "noise_misfit", outcome->misfit);
    }
    if (good && outcome->hint[0]) {
        good = cJSON_AddStringToObject(object, "hint", outcome->hint);
    }
    if (good && outcome->has_plant) {
        cJSON *plant = cJSON_AddObjectToObject(object, "continuous");
        good = plant && fill(plant, &outcome->plant);
    }
    return good;
}

cJSON *parametric_outcome_json(const struct parametric_outcome *outcome, bool with_orders)
{
    cJSON *object = parametric_json(&outcome->model, with_orders ? &outcome->orders : NULL);
    if (object && !fill_outcome(object, outcome)) {
        cJSON_Delete(object);
        object = NULL;
    }
    return object;
}
