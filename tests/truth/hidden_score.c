/* SPDX-License-Identifier: MIT */
#include "tests/truth/hidden_score.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { DIAGNOSIS_BYTES_MAX = 8 << 20 };

// A motion that two models make alike within this many nats no selection could tell apart; the stated parameters are
// estimates besides, which costs half a nat each.
static const double equal_nats = 6.0 + 4.0;

const char *score_outcome_name(enum score_outcome outcome)
{
    static const char *const names[score_outcome_count] = {"right", "tied", "equal", "missed", "WRONG", "FAILED"};
    return names[outcome];
}

void score_fail(struct score *self, const char *why)
{
    *self = (struct score){.outcome = score_failed, .seconds = self->seconds};
    self->worst_z = self->left_nats = self->nominal_nrmse = self->refitted_nrmse = NAN;
    self->extended_nrmse = self->floor_nrmse = self->whitened_rms = self->mean_rms = self->mean_rms_chance = NAN;
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

static int is_hidden(const struct truth_case *truth, const char *id)
{
    for (int i = 0; i < truth->wish.causes; i++) {
        if (strcmp(truth_kind_name(truth->wish.kind[i]), id) == 0) {
            return 1;
        }
    }
    return 0;
}

static void count_causes(struct score *self, const struct truth_case *truth, const cJSON *causes)
{
    const cJSON *cause;
    size_t used = 0;
    cJSON_ArrayForEach(cause, causes)
    {
        const char *id = text_at(cause, "id");
        self->causes++;
        self->causes_there += is_hidden(truth, id);
        int wrote = snprintf(self->named + used, sizeof self->named - used, "%s%s", used ? "+" : "", id);
        used += wrote > 0 ? (size_t)wrote : 0;
        used = used < sizeof self->named ? used : sizeof self->named - 1;
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

// Whether each hidden cause that is not named ties with a named one that is not hidden, and no other is too much.
static int tied(const cJSON *diagnosis, const struct truth_case *truth, const struct score *score)
{
    const cJSON *causes = cJSON_GetObjectItemCaseSensitive(diagnosis, "causes"), *cause, *tie;
    if (score->causes != truth->wish.causes || score->causes_there != truth->wish.causes - 1) {
        return 0;
    }
    const char *strange = "", *gone = "";
    cJSON_ArrayForEach(cause, causes)
    {
        strange = is_hidden(truth, text_at(cause, "id")) ? strange : text_at(cause, "id");
    }
    for (int i = 0; i < truth->wish.causes; i++) {
        const char *id = truth_kind_name(truth->wish.kind[i]);
        int named = 0;
        cJSON_ArrayForEach(cause, causes)
        {
            named |= strcmp(text_at(cause, "id"), id) == 0;
        }
        gone = named ? gone : id;
    }
    cJSON_ArrayForEach(tie, cJSON_GetObjectItemCaseSensitive(diagnosis, "ties"))
    {
        if (tie_holds(tie, strange) && tie_holds(tie, gone)) {
            return 1;
        }
    }
    return 0;
}

static void compare_parameter(struct score *self, const struct truth_parameter *right, const cJSON *stated,
                              const char *id)
{
    double value = number_at(stated, "value"), std = number_at(stated, "std");
    double error = fabs(right->sign_free ? fabs(value) - fabs(right->value) : value - right->value);
    // An exact parameter (a whole number of periods) is stated without a deviation, and must then be exact.
    double z = error < 1e-9 * fabs(right->value) ? 0.0 : std > 0.0 ? error / std : INFINITY;
    if (isnan(value)) {
        z = INFINITY;
    } else if (error < right->slack * fabs(right->value)) {
        z = fmin(z, 3.0);
    }
    self->parameters++;
    self->parameters_within_1_std += z <= 1.0;
    self->parameters_within_2_std += z <= 2.0;
    self->parameters_within_3_std += z <= 3.0;
    if (isnan(self->worst_z) || z > self->worst_z) {
        self->worst_z = z;
        snprintf(self->worst_parameter, sizeof self->worst_parameter, "%s.%s %.4g for %.4g", id, right->name, value,
                 right->value);
    }
}

static void compare_parameters(struct score *self, const struct truth_case *truth, const cJSON *causes)
{
    const cJSON *cause;
    cJSON_ArrayForEach(cause, causes)
    {
        const char *id = text_at(cause, "id");
        struct truth_parameter right[TRUTH_PARAMETERS_MAX];
        if (!is_hidden(truth, id)) {
            continue;
        }
        int count = truth_kind_parameters(truth_kind_find(id), &truth->truth, right);
        const cJSON *stated = cJSON_GetObjectItemCaseSensitive(cause, "parameters");
        for (int i = 0; i < count; i++) {
            compare_parameter(self, &right[i], cJSON_GetObjectItemCaseSensitive(stated, right[i].name), id);
        }
    }
}

// Expected evidence of the truth over a drive with the causes as they were stated: small if that is the same drive.
static double left_nats(const struct truth_case *truth, const cJSON *causes)
{
    struct truth_drive other = truth_case_drive(truth, 0u);
    const cJSON *cause, *parameter;
    cJSON_ArrayForEach(cause, causes)
    {
        enum truth_kind kind = truth_kind_find(text_at(cause, "id"));
        cJSON_ArrayForEach(parameter, cJSON_GetObjectItemCaseSensitive(cause, "parameters"))
        {
            if (truth_kind_set(kind, parameter->string, number_at(parameter, "value"), &other)) {
                return NAN;
            }
        }
    }
    return truth_case_left_nats(truth, &other);
}

static enum score_outcome judge_unknown(const struct truth_case *truth, const struct score *score)
{
    int clean = truth->wish.causes == 0;
    if (score->causes) {
        return score_wrong;
    }
    if (strcmp(score->verdict, clean ? "no_discrepancy" : "unexplained") == 0) {
        return score_right;
    }
    return clean ? score_wrong : score_missed;
}

static enum score_outcome judge(struct score *score, const struct truth_case *truth, const cJSON *diagnosis)
{
    if (truth->wish.causes == 0 || !truth_kind_is_catalogued(truth->wish.kind[0])) {
        return judge_unknown(truth, score);
    }
    if (score->causes == score->causes_there) {
        int all = score->causes == truth->wish.causes && strcmp(score->verdict, "explained") == 0;
        return all ? score_right : score_missed;
    }
    if (tied(diagnosis, truth, score)) {
        return score_tied;
    }
    score->left_nats = left_nats(truth, cJSON_GetObjectItemCaseSensitive(diagnosis, "causes"));
    int equal = score->causes <= truth->wish.causes && score->left_nats <= equal_nats;
    return equal ? score_equal : score_wrong;
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
    score_fail(self, diagnosis ? "verdict and causes do not fit" : "no JSON in the diagnosis file");
    if (!diagnosis || !cJSON_IsArray(causes) || !verdict_in_contract(verdict, cJSON_GetArraySize(causes))) {
        cJSON_Delete(diagnosis);
        return;
    }
    snprintf(self->verdict, sizeof self->verdict, "%s", verdict);
    snprintf(self->named, sizeof self->named, "%s", verdict);
    count_causes(self, truth, causes);
    compare_parameters(self, truth, causes);
    const cJSON *extended = cJSON_GetObjectItemCaseSensitive(diagnosis, "extended");
    self->nominal_nrmse = number_at(cJSON_GetObjectItemCaseSensitive(diagnosis, "nominal"), "validation_nrmse");
    self->refitted_nrmse = number_at(cJSON_GetObjectItemCaseSensitive(diagnosis, "refitted"), "validation_nrmse");
    self->extended_nrmse = number_at(extended, "validation_nrmse");
    self->whitened_rms = number_at(extended, "whitened_rms");
    self->mean_rms = number_at(extended, "mean_rms");
    self->mean_rms_chance = number_at(diagnosis, "mean_rms_chance");
    self->floor_nrmse = number_at(diagnosis, "noise_floor_nrmse");
    self->outcome = judge(self, truth, diagnosis);
    cJSON_Delete(diagnosis);
}
