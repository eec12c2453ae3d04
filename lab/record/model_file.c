/* SPDX-License-Identifier: MIT */
#include "lab/record/model_file.h"

#include "lab/record/json_in.h"
#include "lab/record/json_out.h"
#include "sim/effect.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* How the default of a number on a linear axis follows from the rotary one, seen through a pulley of radius r. */
enum through_pulley { pulley_none, pulley_times, pulley_divide };

/* A number of the model: where it is in the file and in the struct. */
struct field {
    const char *block;       /* NULL: the root object */
    const char *name;        /* rotary */
    const char *linear_name; /* its twin, or the same where units do not differ */
    size_t offset;
    enum through_pulley pulley; /* of optional numbers whose default is not 0 */
};

#define FIELD(block, name, linear_name, member, pulley)                                                                \
    {                                                                                                                  \
        block, name, linear_name, offsetof(struct sim_model, member), pulley                                           \
    }

static const struct field fields[] = {
    FIELD(NULL, "motor_inertia_kgm2", "motor_mass_kg", motor_inertia_kgm2, pulley_none),
    FIELD(NULL, "load_inertia_kgm2", "mass_kg", load_inertia_kgm2, pulley_none),
    FIELD(NULL, "belt_stiffness_Nm_per_rad", "belt_stiffness_N_per_m", belt_stiffness_Nm_per_rad, pulley_none),
    FIELD(NULL, "belt_damping_Nms_per_rad", "belt_damping_Ns_per_m", belt_damping_Nms_per_rad, pulley_none),
    FIELD(NULL, "viscous_friction_Nms_per_rad", "viscous_friction_Ns_per_m", viscous_friction_Nms_per_rad, pulley_none),
    FIELD(NULL, "coulomb_friction_Nm", "coulomb_friction_N", coulomb_friction_Nm, pulley_none),
    FIELD(NULL, "torque_lag_s", "torque_lag_s", torque_lag_s, pulley_none),
    FIELD(NULL, "dead_time_s", "dead_time_s", dead_time_s, pulley_none),
    FIELD(NULL, "pulley_radius_m", "pulley_radius_m", pulley_radius_m, pulley_none),
    FIELD(NULL, "sample_rate_hz", "sample_rate_hz", sample_rate_hz, pulley_none),
    FIELD(NULL, "process_noise_Nm", "process_noise_N", process_noise_Nm, pulley_divide),
    FIELD("controller", "position_gain_per_s", "position_gain_per_s", controller.position_gain_per_s, pulley_none),
    FIELD("controller", "velocity_gain_Nms_per_rad", "velocity_gain_Ns_per_m", controller.velocity_gain_Nms_per_rad,
          pulley_none),
    FIELD("controller", "velocity_integral_time_s", "velocity_integral_time_s", controller.velocity_integral_time_s,
          pulley_none),
    FIELD("controller", "velocity_feedforward", "velocity_feedforward", controller.velocity_feedforward, pulley_none),
    FIELD("controller", "torque_feedforward", "torque_feedforward", controller.torque_feedforward, pulley_none),
    FIELD("sensors", "counts_per_rev", "counts_per_m", sensors.counts_per_rev, pulley_divide),
    FIELD("sensors", "position_noise_rad", "position_noise_m", sensors.position_noise_rad, pulley_times),
    FIELD("sensors", "velocity_noise_rad_per_s", "velocity_noise_m_per_s", sensors.velocity_noise_rad_per_s,
          pulley_times),
    FIELD("sensors", "torque_noise_Nm", "force_noise_N", sensors.torque_noise_Nm, pulley_divide),
    FIELD("sensors", "velocity_filter_s", "velocity_filter_s", sensors.velocity_filter_s, pulley_none),
};

enum { field_count = sizeof fields / sizeof fields[0] };

static const char end_stops_name[] = "end_stops_rad", end_stops_linear_name[] = "end_stops_m";
static const double turn_rad = 6.283185307179586;
static const double seed_number_max = 9007199254740992.0; /* 2^53 */

static double *value_at(struct sim_model *model, size_t offset)
{
    return (double *)(void *)((char *)model + offset);
}

static double value_of(const struct sim_model *model, size_t offset)
{
    return *(const double *)(const void *)((const char *)model + offset);
}

static const char *field_name(const struct field *field, bool linear)
{
    return linear ? field->linear_name : field->name;
}

static const char *parameter_name(const struct sim_parameter *parameter, bool linear)
{
    return linear ? parameter->linear_name : parameter->name;
}

bool model_deviations_add(struct model_deviations *self, const char *effect, const char *name, double std)
{
    if (self->count >= model_deviations_max)
        return false;
    self->entries[self->count++] = (struct model_deviation){effect, name, std};
    return true;
}

/* The object that a block names; the root for NULL. *out_object is NULL if the block is not there. */
static int find_block(const struct json_document *document, const char *block, const cJSON **out_object,
                      struct error *out_error)
{
    *out_object = block ? cJSON_GetObjectItemCaseSensitive(document->root, block) : document->root;
    if (*out_object && !cJSON_IsObject(*out_object))
        return json_document_error(document, block, *out_object, "an object { } was expected", out_error);
    return error_none;
}

/* Finds a name that only rotary models, or only linear ones, have; its path goes to out_path. */
static bool find_kind(const struct json_document *document, bool linear, char out_path[json_path_size])
{
    for (size_t i = 0; i < field_count; i++) {
        const struct field *f = &fields[i];
        const cJSON *object = f->block ? cJSON_GetObjectItemCaseSensitive(document->root, f->block) : document->root;
        if (strcmp(f->name, f->linear_name) != 0 && cJSON_GetObjectItemCaseSensitive(object, field_name(f, linear))) {
            json_path_join(out_path, f->block, field_name(f, linear));
            return true;
        }
    }
    const char *end_stops = linear ? end_stops_linear_name : end_stops_name;
    json_path_join(out_path, NULL, end_stops);
    return cJSON_GetObjectItemCaseSensitive(document->root, end_stops) != NULL;
}

static int read_kind(const struct json_document *document, struct sim_model *model, struct error *out_error)
{
    const cJSON *said = cJSON_GetObjectItemCaseSensitive(document->root, "linear");
    if (said && !cJSON_IsBool(said))
        return json_document_error(document, "linear", said, "true or false was expected", out_error);
    char rotary[json_path_size], linear[json_path_size];
    bool has_rotary = find_kind(document, false, rotary), has_linear = find_kind(document, true, linear);
    if (has_rotary && has_linear)
        return error_set(out_error, error_refused,
                         "%s:%zu: %s is of a linear axis, %s (line %zu) of a rotary one: one kind was expected",
                         document->path, json_document_line(document, linear), linear, rotary,
                         json_document_line(document, rotary));
    if (said && (cJSON_IsTrue(said) ? has_rotary : has_linear))
        return error_set(out_error, error_refused, "%s:%zu: linear: does not go with %s (line %zu)", document->path,
                         json_document_line(document, "linear"), has_rotary ? rotary : linear,
                         json_document_line(document, has_rotary ? rotary : linear));
    model->linear = has_linear || cJSON_IsTrue(said);
    return error_none;
}

static int read_structure(const struct json_document *document, struct sim_model *model, struct error *out_error)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(document->root, "structure");
    const char *text = cJSON_IsString(item) ? item->valuestring : "";
    if (strcmp(text, "rigid") == 0)
        model->structure = sim_structure_rigid;
    else if (strcmp(text, "two_mass") == 0)
        model->structure = sim_structure_two_mass;
    else
        return json_document_error(document, "structure", item, "\"rigid\" or \"two_mass\" was expected", out_error);
    return error_none;
}

/* Turns the rotary defaults of the numbers that a model of a linear axis may leave out into its own. */
static int convert_defaults(const struct json_document *document, struct sim_model *model, struct error *out_error)
{
    static const char name[] = "pulley_radius_m";
    int status = json_document_number(document, document->root, "", name, &model->pulley_radius_m, NULL, out_error);
    if (status)
        return status;
    double radius_m = model->pulley_radius_m;
    if (!(radius_m > 0))
        return json_document_error(document, name, cJSON_GetObjectItemCaseSensitive(document->root, name),
                                   "a radius above 0 was expected", out_error);
    for (size_t i = 0; i < field_count; i++) {
        double *value = value_at(model, fields[i].offset);
        if (fields[i].pulley == pulley_times)
            *value *= radius_m;
        else if (fields[i].pulley == pulley_divide)
            *value /= radius_m;
    }
    model->sensors.counts_per_rev /= turn_rad; // counts per turn over the travel per turn
    return error_none;
}

static int read_fields(const struct json_document *document, struct sim_model *model, bool found[field_count],
                       struct error *out_error)
{
    for (size_t i = 0; i < field_count; i++) {
        const struct field *f = &fields[i];
        const cJSON *object;
        found[i] = false;
        int status = find_block(document, f->block, &object, out_error);
        if (!status && object)
            status = json_document_number(document, object, f->block ? f->block : "", field_name(f, model->linear),
                                          value_at(model, f->offset), &found[i], out_error);
        if (status)
            return status;
    }
    return error_none;
}

static bool was_found(const bool found[field_count], size_t offset)
{
    for (size_t i = 0; i < field_count; i++)
        if (fields[i].offset == offset)
            return found[i];
    return false;
}

static int read_end_stops(const struct json_document *document, struct sim_model *model, struct error *out_error)
{
    const char *name = model->linear ? end_stops_linear_name : end_stops_name;
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(document->root, name);
    if (!item || cJSON_IsNull(item))
        return error_none;
    bool numbers = cJSON_IsArray(item) && cJSON_GetArraySize(item) == 2;
    for (int i = 0; i < 2 && numbers; i++) {
        const cJSON *stop = cJSON_GetArrayItem(item, i);
        numbers = cJSON_IsNumber(stop) && isfinite(stop->valuedouble);
        model->end_stops_rad[i] = numbers ? stop->valuedouble : 0;
    }
    if (!numbers)
        return json_document_error(document, name, item, "two finite numbers [low, high] were expected", out_error);
    model->has_end_stops = true;
    return error_none;
}

static int read_seed(const struct json_document *document, struct sim_model *model, struct error *out_error)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(document->root, "seed");
    if (!item)
        return error_none;
    if (cJSON_IsNumber(item) && item->valuedouble >= 0 && item->valuedouble <= seed_number_max &&
        item->valuedouble == floor(item->valuedouble)) {
        model->seed = (uint64_t)item->valuedouble;
        return error_none;
    }
    const char *text = cJSON_IsString(item) ? item->valuestring : "";
    errno = 0;
    unsigned long long value = strtoull(text, NULL, 10);
    if (*text && strspn(text, "0123456789") == strlen(text) && errno == 0 && value <= UINT64_MAX) {
        model->seed = (uint64_t)value;
        return error_none;
    }
    return json_document_error(document, "seed", item,
                               "a whole number from 0 to 2^53, or a string of digits up to 2^64 - 1, was expected",
                               out_error);
}

/* One parameter of an effect: into the model's field if it is one, else into the effect's own. */
static int read_parameter(const struct json_document *document, const cJSON *object, const char *place,
                          const struct sim_parameter *parameter, double *own, struct sim_model *model, bool *out_found,
                          struct error *out_error)
{
    const char *name = parameter_name(parameter, model->linear);
    bool is_field = parameter->model_offset != SIZE_MAX;
    double *value = is_field ? value_at(model, parameter->model_offset) : own;
    int status = json_document_number(document, object, place, name, value, out_found, out_error);
    if (!status && !*out_found && !is_field && parameter->optional)
        *own = parameter->usual;
    if (status || *out_found || is_field || parameter->optional || parameter->kind == sim_parameter_phase)
        return status;
    char path[json_path_size];
    json_path_join(path, place, name);
    return json_document_error(document, path, NULL, "running the effect needs it", out_error);
}

static int unknown_effect(const struct json_document *document, const char *place, const cJSON *item,
                          struct error *out_error)
{
    char text[600] = "one of these was expected:";
    size_t used = strlen(text);
    for (size_t e = 0; sim_effects[e] && used < sizeof text - 1; e++)
        used += (size_t)snprintf(text + used, sizeof text - used, " %s", sim_effects[e]->id);
    return json_document_error(document, place, item, text, out_error);
}

static int read_effect(const struct json_document *document, const cJSON *item, struct sim_model *model,
                       struct error *out_error)
{
    char place[json_path_size];
    json_path_join(place, "effects", item->string);
    int e = sim_effect_find(item->string);
    if (e < 0)
        return unknown_effect(document, place, item, out_error);
    if (!cJSON_IsObject(item))
        return json_document_error(document, place, item, "an object { } of parameters was expected", out_error);
    const struct sim_effect *effect = sim_effects[e];
    size_t given = 0;
    bool has_own = false;
    for (size_t i = 0; i < effect->parameter_count; i++) {
        bool found = false;
        int status = read_parameter(document, item, place, &effect->parameters[i], &model->effect_parameters[e][i],
                                    model, &found, out_error);
        if (status)
            return status;
        given += found;
        has_own = has_own || effect->parameters[i].model_offset == SIZE_MAX;
    }
    if (given == 0)
        return json_document_error(document, place, item, "at least one parameter was expected", out_error);
    if (effect->engage)
        effect->engage(model);
    // An effect that is nothing but fields of the base model acts through them; switching it on would count it twice.
    model->effect_on[e] = has_own;
    return error_none;
}

static int read_effects(const struct json_document *document, struct sim_model *model, struct error *out_error)
{
    const cJSON *effects, *item;
    int status = find_block(document, "effects", &effects, out_error);
    cJSON_ArrayForEach(item, effects)
    {
        if (status)
            break;
        status = read_effect(document, item, model, out_error);
    }
    return status;
}

/* What sim_model_check objects to, with the file's own name and line. */
static int check_model(const struct json_document *document, const struct sim_model *model, struct error *out_error)
{
    char buffer[256];
    const char *wrong = sim_model_check(model, buffer, sizeof buffer);
    if (!wrong)
        return error_none;
    char member[json_path_size];
    size_t length = strcspn(wrong, ": ");
    snprintf(member, sizeof member, "%.*s", (int)length, wrong);
    for (size_t i = 0; i < field_count; i++) {
        char rotary[json_path_size];
        json_path_join(rotary, fields[i].block, fields[i].name);
        if (strcmp(rotary, member) == 0)
            json_path_join(member, fields[i].block, field_name(&fields[i], model->linear));
    }
    size_t line = json_document_line(document, member);
    char place[24] = "";
    if (line > 0)
        snprintf(place, sizeof place, "%zu:", line);
    return error_set(out_error, error_refused, "%s:%s %s%s", document->path, place, member, wrong + length);
}

/* The inertias are what nothing can stand in for. */
static int check_inertia(const struct json_document *document, const struct sim_model *model,
                         const bool found[field_count], struct error *out_error)
{
    bool motor = was_found(found, offsetof(struct sim_model, motor_inertia_kgm2));
    bool load = was_found(found, offsetof(struct sim_model, load_inertia_kgm2)) || model->load_inertia_kgm2 > 0;
    bool two = model->structure == sim_structure_two_mass;
    if (!motor && !load)
        return json_document_error(document, model->linear ? "mass_kg" : "motor_inertia_kgm2", NULL,
                                   "a number was expected", out_error);
    if (two && !load && !(model->load_inertia_kgm2 > 0))
        return json_document_error(document, model->linear ? "mass_kg" : "load_inertia_kgm2", NULL,
                                   "a two-mass drive needs both", out_error);
    return error_none;
}

static int read_model(const struct json_document *document, struct sim_model *model, struct error *out_error)
{
    bool found[field_count];
    sim_model_default(model);
    double default_inertia_kgm2 = model->motor_inertia_kgm2 + model->load_inertia_kgm2;
    model->motor_inertia_kgm2 = model->load_inertia_kgm2 = 0;
    model->belt_stiffness_Nm_per_rad = model->belt_damping_Nms_per_rad = 0;
    model->viscous_friction_Nms_per_rad = model->coulomb_friction_Nm = 0;
    model->torque_lag_s = model->dead_time_s = 0;
    int status = read_structure(document, model, out_error);
    if (!status)
        status = read_kind(document, model, out_error);
    if (!status && model->linear)
        status = convert_defaults(document, model, out_error);
    if (!status)
        status = read_fields(document, model, found, out_error);
    if (!status)
        status = read_end_stops(document, model, out_error);
    if (!status)
        status = read_seed(document, model, out_error);
    if (!status)
        status = read_effects(document, model, out_error);
    if (!status)
        status = check_inertia(document, model, found, out_error);
    if (!status && !was_found(found, offsetof(struct sim_model, controller.velocity_gain_Nms_per_rad)))
        model->controller.velocity_gain_Nms_per_rad *=
            (model->motor_inertia_kgm2 + model->load_inertia_kgm2) / default_inertia_kgm2;
    if (!status)
        status = check_model(document, model, out_error);
    return status;
}

int model_file_read(const char *path, struct sim_model *out_model, struct error *out_error)
{
    struct json_document document;
    int status = json_document_read(path, &document, out_error);
    if (status)
        return status;
    status = read_model(&document, out_model, out_error);
    json_document_free(&document);
    return status;
}

/* The object of a block, made when first needed; NULL if memory is short. */
static cJSON *write_block(cJSON *parent, const char *block)
{
    if (!parent || !block)
        return parent;
    cJSON *object = cJSON_GetObjectItemCaseSensitive(parent, block);
    return object ? object : cJSON_AddObjectToObject(parent, block);
}

static bool write_fields(cJSON *root, const struct sim_model *model, bool blocks)
{
    for (size_t i = 0; i < field_count; i++) {
        const struct field *f = &fields[i];
        if ((f->block != NULL) != blocks)
            continue;
        if (!cJSON_AddNumberToObject(write_block(root, f->block), field_name(f, model->linear),
                                     value_of(model, f->offset)))
            return false;
    }
    return true;
}

static bool write_effects(cJSON *root, const struct sim_model *model)
{
    for (size_t e = 0; sim_effects[e]; e++) {
        const struct sim_effect *effect = sim_effects[e];
        if (!model->effect_on[e])
            continue;
        for (size_t i = 0; i < effect->parameter_count; i++) {
            const struct sim_parameter *p = &effect->parameters[i];
            double value =
                p->model_offset != SIZE_MAX ? value_of(model, p->model_offset) : model->effect_parameters[e][i];
            cJSON *object = write_block(write_block(root, "effects"), effect->id);
            if (!cJSON_AddNumberToObject(object, parameter_name(p, model->linear), value))
                return false;
        }
    }
    return true;
}

/* Beside the numbers they belong to: an effect's in the effect's object, if that is in the file, everything else at the
 * root, because an effect that is a field of the base model is written as that field. */
static bool write_deviations(cJSON *root, const struct model_deviations *deviations)
{
    for (size_t i = 0; deviations && i < deviations->count; i++) {
        const struct model_deviation *d = &deviations->entries[i];
        cJSON *effects = cJSON_GetObjectItemCaseSensitive(root, "effects");
        cJSON *effect = d->effect && effects ? cJSON_GetObjectItemCaseSensitive(effects, d->effect) : NULL;
        cJSON *block = write_block(effect ? effect : root, "std");
        cJSON_DeleteItemFromObjectCaseSensitive(block,
                                                d->name); // a field and the effect that is this field: the last one
        if (!cJSON_AddNumberToObject(block, d->name, d->std))
            return false;
    }
    return true;
}

static bool write_rest(cJSON *root, const struct sim_model *model)
{
    bool ok = true;
    if (model->has_end_stops) {
        cJSON *stops = cJSON_AddArrayToObject(root, model->linear ? end_stops_linear_name : end_stops_name);
        for (int i = 0; i < 2; i++)
            ok = ok && cJSON_AddItemToArray(stops, cJSON_CreateNumber(model->end_stops_rad[i]));
    }
    char digits[24];
    snprintf(digits, sizeof digits, "%llu", (unsigned long long)model->seed);
    if (model->seed <= (uint64_t)seed_number_max)
        return ok && cJSON_AddNumberToObject(root, "seed", (double)model->seed);
    return ok && cJSON_AddStringToObject(root, "seed", digits);
}

static int check_writable(const char *path, const struct sim_model *model, const struct model_deviations *deviations,
                          struct error *out_error)
{
    char buffer[256];
    const char *wrong = sim_model_check(model, buffer, sizeof buffer);
    for (size_t i = 0; i < field_count && !wrong; i++)
        if (!isfinite(value_of(model, fields[i].offset)))
            wrong = fields[i].name;
    for (size_t i = 0; deviations && i < deviations->count && !wrong; i++)
        if (!(deviations->entries[i].std >= 0 && isfinite(deviations->entries[i].std)))
            wrong = deviations->entries[i].name;
    if (!wrong)
        return error_none;
    return error_set(out_error, error_refused, "%s: not written: %s%s", path, wrong,
                     strchr(wrong, ':') ? "" : ": is not a finite number");
}

int model_file_write(const char *path, const struct sim_model *model, const struct model_deviations *deviations,
                     struct error *out_error)
{
    int status = check_writable(path, model, deviations, out_error);
    if (status)
        return status;
    cJSON *root = cJSON_CreateObject();
    bool ok = root && cJSON_AddStringToObject(root, "structure",
                                              model->structure == sim_structure_two_mass ? "two_mass" : "rigid");
    ok = ok && (!model->linear || cJSON_AddTrueToObject(root, "linear"));
    ok = ok && write_fields(root, model, false) && write_effects(root, model) && write_deviations(root, deviations) &&
         write_fields(root, model, true) && write_rest(root, model);
    status = ok ? json_write(path, root, out_error) : error_set(out_error, error_refused, "%s: memory is short", path);
    cJSON_Delete(root);
    return status;
}
