/* SPDX-License-Identifier: MIT */
#include "tests/truth/hidden_score.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { DIAGNOSIS_BYTES_MAX = 8 << 20 };

const char *score_outcome_name(enum score_outcome outcome)
{
    static const char *const names[score_outcome_count] = {"right", "tied", "missed", "WRONG", "FAILED"};
    return names[outcome];
}

void score_fail(struct score *self, const char *why)
{
    self->outcome = score_failed;
    snprintf(self->named, sizeof self->named, "%s", why);
}

static cJSON *read_json(const char *path)
{
    FILE *file = fopen(path, "rb");
    char *text = file ? malloc(DIAGNOSIS_BYTES_MAX) : NULL;
    cJSON *json = NULL;
    if (text) {
        size_t length = fread(text, 1, DIAGNOSIS_BYTES_MAX, file);
        json = cJSON_ParseWithLength(text, length);
    }
    free(text);
    if (file) {
        fclose(file);
    }
    return json;
}

static double number_at(const cJSON *object, const char *name)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    return cJSON_IsNumber(item) ? item->valuedouble : NAN;
}

static const char *text_at(const cJSON *object, const char *name)
{
    const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(object, name));
    return text ? text : "";
}

static void join_causes(struct score *self, const cJSON *causes)
{
    const cJSON *cause;
    size_t used = 0;
    cJSON_ArrayForEach(cause, causes)
    {
        int wrote =
            snprintf(self->named + used, sizeof self->named - used, "%s%s", used ? "+" : "", text_at(cause, "id"));
        used += wrote > 0 ? (size_t)wrote : 0;
        if (used >= sizeof self->named) {
            return;
        }
    }
}

static int tie_holds(const cJSON *tie, const char *id)
{
    const cJSON *member;
    cJSON_ArrayForEach(member, cJSON_GetObjectItemCaseSensitive(tie, "causes"))
    {
        if (cJSON_IsString(member) && strcmp(member->valuestring, id) == 0) {
            return 1;
        }
    }
    return 0;
}

static int tied(const cJSON *diagnosis, const char *named, const char *truth)
{
    const cJSON *tie;
    cJSON_ArrayForEach(tie, cJSON_GetObjectItemCaseSensitive(diagnosis, "ties"))
    {
        if (tie_holds(tie, named) && tie_holds(tie, truth)) {
            return 1;
        }
    }
    return 0;
}

static void compare_parameters(struct score *self, const struct truth_case *truth, const cJSON *cause)
{
    const cJSON *parameters = cJSON_GetObjectItemCaseSensitive(cause, "parameters");
    self->evidence_nats = number_at(cause, "evidence");
    for (int i = 0; i < truth->parameters; i++) {
        const struct truth_parameter *right = &truth->parameter[i];
        const cJSON *stated = cJSON_GetObjectItemCaseSensitive(parameters, right->name);
        double value = number_at(stated, "value"), std = number_at(stated, "std");
        double error = right->sign_free ? fabs(value) - fabs(right->value) : value - right->value;
        // An exact parameter (a whole number of periods) is stated without a deviation, and must then be exact.
        double z = fabs(error) < 1e-9 * fabs(right->value) ? 0.0 : std > 0.0 ? fabs(error) / std : INFINITY;
        if (isnan(value)) {
            z = INFINITY;
        }
        double relative = fabs(error / right->value);
        self->worst_z = isnan(self->worst_z) ? z : fmax(self->worst_z, z);
        self->worst_relative = isnan(self->worst_relative) ? relative : fmax(self->worst_relative, relative);
    }
}

static enum score_outcome judge(const struct truth_case *truth, const cJSON *diagnosis, const char *verdict)
{
    const cJSON *causes = cJSON_GetObjectItemCaseSensitive(diagnosis, "causes");
    int count = cJSON_GetArraySize(causes);
    if (!truth_kind_is_catalogued(truth->kind)) {
        const char *right = truth->kind == truth_kind_clean ? "no_discrepancy" : "unexplained";
        if (count) {
            return score_wrong;
        }
        if (strcmp(verdict, right) == 0) {
            return score_right;
        }
        return truth->kind == truth_kind_clean ? score_wrong : score_missed;
    }
    const char *hidden = truth_kind_name(truth->kind);
    const char *first = text_at(cJSON_GetArrayItem(causes, 0), "id");
    if (count == 0) {
        return score_missed;
    }
    if (count == 1 && strcmp(verdict, "explained") == 0) {
        if (strcmp(first, hidden) == 0) {
            return score_right;
        }
        return tied(diagnosis, first, hidden) ? score_tied : score_wrong;
    }
    return count == 1 && strcmp(first, hidden) == 0 ? score_missed : score_wrong;
}

static int verdict_in_contract(const char *verdict, int causes)
{
    return (strcmp(verdict, "explained") == 0 && causes > 0) || strcmp(verdict, "unexplained") == 0 ||
           (strcmp(verdict, "no_discrepancy") == 0 && causes == 0);
}

void score_read(struct score *self, const struct truth_case *truth, const char *path)
{
    cJSON *diagnosis = read_json(path);
    const char *verdict = text_at(diagnosis, "verdict");
    const cJSON *causes = cJSON_GetObjectItemCaseSensitive(diagnosis, "causes");
    *self = (struct score){.evidence_nats = NAN, .worst_z = NAN, .worst_relative = NAN, .seconds = self->seconds};
    if (!diagnosis || !cJSON_IsArray(causes) || !verdict_in_contract(verdict, cJSON_GetArraySize(causes))) {
        score_fail(self, diagnosis ? "verdict and causes do not fit" : "no JSON in the diagnosis file");
        cJSON_Delete(diagnosis);
        return;
    }
    self->names_cause = cJSON_GetArraySize(causes) > 0;
    snprintf(self->named, sizeof self->named, "%s", verdict);
    if (self->names_cause) {
        join_causes(self, causes);
    }
    self->outcome = judge(truth, diagnosis, verdict);
    const cJSON *cause;
    cJSON_ArrayForEach(cause, causes)
    {
        if (strcmp(text_at(cause, "id"), truth_kind_name(truth->kind)) == 0) {
            compare_parameters(self, truth, cause);
        }
    }
    const cJSON *extended = cJSON_GetObjectItemCaseSensitive(diagnosis, "extended");
    self->nominal_nrmse = number_at(cJSON_GetObjectItemCaseSensitive(diagnosis, "nominal"), "validation_nrmse");
    self->refitted_nrmse = number_at(cJSON_GetObjectItemCaseSensitive(diagnosis, "refitted"), "validation_nrmse");
    self->extended_nrmse = number_at(extended, "validation_nrmse");
    self->whitened_rms = number_at(extended, "whitened_rms");
    self->floor_nrmse = number_at(diagnosis, "noise_floor_nrmse");
    cJSON_Delete(diagnosis);
}
