/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/hiding.h"

#include "sim/plant.h"
#include "sim/random.h"
#include "tools/servoscope/quiet_run.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586;
static const double share_min = 0.01;
static const double share_max = 2.0;
/// Of what is added to a model, and at least this factor of what is changed in it.
static const double added_share_low = 0.015, added_share_high = 0.05;
static const double changed_factor_low = 1.4, changed_factor_high = 2.2;
/// An added torque is at most this share of the excitation's: more is damage, not an effect.
static const double added_torque_max = 0.13;

enum {
    draws_max = 60,
    scan_values_max = 16, ///< scans begin with what is common; cogging goes on to hundreds of periods per travel
};

static double uniform(uint64_t random[4], double low, double high)
{
    return low + (high - low) * sim_random_uniform(random);
}

static double log_uniform(uint64_t random[4], double low, double high)
{
    return low * pow(high / low, sim_random_uniform(random));
}

static double *model_field(struct sim_model *model, const struct sim_parameter *parameter)
{
    return parameter->model_offset == SIZE_MAX ? NULL : (double *)(void *)((char *)model + parameter->model_offset);
}

/// Belt drive of the first paper, halves of its inertia on an elastic belt, with usual friction: resonance in the upper
/// part of the excited band, where the motor keeps the limits that were designed for one inertia. Where the structure
/// is what will be hidden, the nominal model is without it.
static void make_nominal(const struct sim_effect *effect, uint64_t seed, struct sim_model *out)
{
    const double antiresonance_hz = 66.0, damping_ratio = 0.04;
    sim_model_default(out);
    out->seed = seed;
    out->load_inertia_kgm2 = 0.00266;
    out->motor_inertia_kgm2 = 0.0025;
    out->viscous_friction_Nms_per_rad = 0.008;
    out->coulomb_friction_Nm = 0.05;
    out->torque_lag_s = 0.0005;
    out->process_noise_Nm = 0.004;
    out->controller.velocity_gain_Nms_per_rad = 0.4;
    if (!effect->engage) {
        const double omega = two_pi * antiresonance_hz;
        out->structure = sim_structure_two_mass;
        out->belt_damping_Nms_per_rad = 0.001 * round(2.0 * damping_ratio * omega * out->load_inertia_kgm2 / 0.001);
        out->belt_stiffness_Nm_per_rad = round(omega * omega * out->load_inertia_kgm2);
    }
}

// ---- What a table lets show

static double peak_of(const double *values, size_t count)
{
    double peak = 0.0;
    for (size_t n = 0; n < count; n++) {
        peak = fmax(peak, fabs(values[n]));
    }
    return peak;
}

static bool cover(const struct sim_model *nominal, const struct msgen_table *table, struct sim_coverage *out)
{
    struct error ignored;
    struct run run;
    if (quiet_run(nominal, table, &run, &ignored)) {
        return false;
    }
    const double *torque = run_column(&run, "torque_Nm");
    const double *position = run_column(&run, "position_rad");
    const double *velocity = run_column(&run, "velocity_rad_per_s");
    double low = position[0], high = position[0], torque_sum = 0.0, velocity_sum = 0.0;
    for (size_t n = 0; n < run.rows; n++) {
        low = fmin(low, position[n]);
        high = fmax(high, position[n]);
        torque_sum += torque[n] * torque[n];
        velocity_sum += velocity[n] * velocity[n];
    }
    *out = (struct sim_coverage){
        .position_span = high - low,
        .velocity_rms = sqrt(velocity_sum / (double)run.rows),
        .velocity_peak = peak_of(velocity, run.rows),
        .torque_rms = sqrt(torque_sum / (double)run.rows),
        .duration_s = (double)run.rows / run.sample_rate_hz,
        .frequency_max_hz = run.bins[run.bin_count - 1] * run.sample_rate_hz / (double)run.period_samples,
    };
    run_free(&run);
    return true;
}

/// Sum of squares of the torque that a model misses or misplaces from row `first` on. At each row its motor is set to
/// where the drive's was and moved to the next row; its load, which nobody measures, is left to itself.
static double missed_squares(const struct sim_model *model, const struct run *run, size_t first)
{
    const double *torque_ref = run_column(run, "torque_ref_Nm");
    const double *torque = run_column(run, "torque_Nm");
    const double *position = run_column(run, "position_rad");
    const double *velocity = run_column(run, "velocity_rad_per_s");
    const bool rigid = model->structure == sim_structure_rigid;
    const double moved = model->motor_inertia_kgm2 + (rigid ? model->load_inertia_kgm2 : 0.0);
    struct sim_stepper stepper;
    struct sim_plant plant;
    struct sim_actuator actuator;
    double sum = 0.0;
    sim_stepper_init(&stepper, model, 1.0 / (run->sample_rate_hz * sim_substeps));
    sim_plant_init(&plant, position[0]);
    sim_actuator_init(&actuator);
    for (size_t n = 0; n + 1 < run->rows; n++) {
        plant.position = position[n];
        plant.velocity = velocity[n];
        sim_actuator_hold(&actuator, torque_ref[n]);
        const double misplaced = torque[n] - sim_actuator_now(&actuator, &stepper);
        for (size_t i = 0; i < sim_substeps; i++) {
            sim_plant_drive(&plant, &stepper, &actuator, i, 0.0);
        }
        const double missed = moved * run->sample_rate_hz * (velocity[n + 1] - plant.velocity);
        sum += n >= first ? missed * missed + misplaced * misplaced : 0.0;
    }
    return sum;
}

/// Share of the torque that the nominal model misses on the drive's own noise-free motion; negative if the drive cannot
/// follow, or only at speeds far beyond what the excitation was designed for.
static double missed_share(const struct sim_model *nominal, const struct sim_model *drive,
                           const struct msgen_table *table, const struct sim_coverage *coverage)
{
    const double speed_excess_max = 1.25;
    struct error ignored;
    struct run run;
    if (quiet_run(drive, table, &run, &ignored)) {
        return -1.0;
    }
    const size_t first = run.rows - run.period_samples;
    const double *torque = run_column(&run, "torque_Nm");
    double all = 0.0;
    for (size_t n = first; n < run.rows; n++) {
        all += torque[n] * torque[n];
    }
    const double fastest = peak_of(run_column(&run, "velocity_rad_per_s"), run.rows);
    const bool follows = fastest < speed_excess_max * coverage->velocity_peak;
    const double share = follows ? sqrt(missed_squares(nominal, &run, first) / all) : -1.0;
    run_free(&run);
    return share;
}

// ---- Drawing

/// Three digits are enough for a truth, and read better.
static double rounded(double value, const struct sim_parameter *parameter)
{
    if (strstr(parameter->name, "_per_rev")) {
        return round(value); // a motor has a whole number of whatever repeats in a turn
    }
    char text[32];
    snprintf(text, sizeof text, "%.3g", value);
    return strtod(text, NULL);
}

static double draw_value(const struct sim_parameter *parameter, double given, double scanned, uint64_t random[4])
{
    if (parameter->kind == sim_parameter_phase) {
        return uniform(random, 0.0, two_pi);
    }
    if (parameter->kind == sim_parameter_positive || parameter->model_offset == SIZE_MAX) {
        return scanned * log_uniform(random, 0.8, 1.25);
    }
    if (given > 0.0) {
        const double factor = log_uniform(random, changed_factor_low, changed_factor_high);
        return sim_random_uniform(random) < 0.5 ? given * factor : given / factor;
    }
    return scanned;
}

static void set_value(struct hiding *self, size_t i, double value)
{
    const struct sim_parameter *parameter = &sim_effects[self->effect]->parameters[i];
    double *field = model_field(&self->drive_model, parameter);
    self->values[i] = rounded(value, parameter);
    *(field ? field : &self->drive_model.effect_parameters[self->effect][i]) = self->values[i];
    self->drive_model.effect_on[self->effect] = self->drive_model.effect_on[self->effect] || !field;
}

/// Whether an added torque is larger than one would find in a drive that runs.
static bool is_damage(const struct hiding *self, const struct sim_coverage *coverage)
{
    const struct sim_parameter *parameter = &sim_effects[self->effect]->parameters[0];
    const size_t length = strlen(parameter->name);
    return length > 3 && strcmp(parameter->name + length - 3, "_Nm") == 0 && self->nominal[0] == 0.0 &&
           fabs(self->values[0]) > added_torque_max * coverage->torque_rms;
}

/// Whether something that the model has is hardly changed.
static bool hardly_differs(const struct hiding *self)
{
    for (size_t i = 0; i < sim_effects[self->effect]->parameter_count; i++) {
        const double ratio = self->values[i] / self->nominal[i];
        if (self->nominal[i] > 0.0 && ratio > 1.0 / changed_factor_low && ratio < changed_factor_low) {
            return true;
        }
    }
    return false;
}

static bool draw(const struct sim_coverage *coverage, uint64_t random[4], struct hiding *out)
{
    const struct sim_effect *effect = sim_effects[out->effect];
    double scanned[sim_effect_parameters_max] = {0.0};
    char text[200];
    size_t count = 0;
    while (count < scan_values_max && effect->scan(&out->nominal_model, coverage, count, scanned)) {
        count++;
    }
    if (count == 0) {
        return false;
    }
    // A scan's ends are what a recording can just show; the middle third of it is what one meets.
    const size_t first = count / 3;
    const size_t chosen = first + (size_t)(sim_random_uniform(random) * (double)(count - 2 * first));
    effect->scan(&out->nominal_model, coverage, chosen, scanned);
    out->drive_model = out->nominal_model;
    if (effect->engage) {
        effect->engage(&out->drive_model);
    }
    for (size_t i = 0; i < effect->parameter_count; i++) {
        const double *given = model_field(&out->nominal_model, &effect->parameters[i]);
        out->nominal[i] = given ? *given : 0.0;
        set_value(out, i, draw_value(&effect->parameters[i], out->nominal[i], scanned[i], random));
    }
    return (!effect->testable || effect->testable(out->values, coverage, text, sizeof text)) && !hardly_differs(out);
}

/// What the nominal model has nothing of begins at what can just be seen: brought to a share of the torque, to which it
/// is nearly proportional, and given a sign.
static void size_addition(const struct msgen_table *table, const struct sim_coverage *coverage, uint64_t random[4],
                          struct hiding *io)
{
    const struct sim_parameter *parameter = &sim_effects[io->effect]->parameters[0];
    const double wanted = log_uniform(random, added_share_low, added_share_high);
    const double sign = parameter->minimum < 0.0 && sim_random_uniform(random) < 0.5 ? -1.0 : 1.0;
    if (parameter->model_offset != SIZE_MAX) {
        return;
    }
    for (int step = 0; step < 3; step++) {
        const double share = missed_share(&io->nominal_model, &io->drive_model, table, coverage);
        if (!(share > 0.0)) {
            return;
        }
        const double size = fmin(fabs(io->values[0]) * wanted / share, 0.9 * parameter->maximum);
        set_value(io, 0, sign * size);
    }
}

static bool hide(int index, uint64_t seed, uint64_t random[4], const struct msgen_table *table, struct hiding *out)
{
    const struct sim_effect *effect = sim_effects[index];
    struct sim_coverage coverage;
    char text[200];
    memset(out, 0, sizeof *out);
    out->effect = index;
    make_nominal(effect, seed, &out->nominal_model);
    if (!effect->scan || (effect->applies && !effect->applies(&out->nominal_model)) ||
        !cover(&out->nominal_model, table, &coverage)) {
        return false;
    }
    for (int attempt = 0; attempt < draws_max; attempt++) {
        if (!draw(&coverage, random, out) || sim_model_check(&out->drive_model, text, sizeof text)) {
            continue;
        }
        size_addition(table, &coverage, random, out);
        out->torque_share = missed_share(&out->nominal_model, &out->drive_model, table, &coverage);
        if (out->torque_share >= share_min && out->torque_share <= share_max && !is_damage(out, &coverage)) {
            return true;
        }
    }
    return false;
}

/// Row number seed / count has an order of its own; the seed's place in it is its turn.
static void make_order(uint64_t seed, size_t count, size_t *out_order, size_t *out_turn)
{
    uint64_t random[4];
    sim_random_seed(random, seed / count);
    for (size_t i = 0; i < count; i++) {
        const size_t other = (size_t)(sim_random_uniform(random) * (double)(i + 1));
        out_order[i] = out_order[other];
        out_order[other] = i;
    }
    *out_turn = (size_t)(seed % count);
}

int hiding_choose(uint64_t seed, const struct msgen_table *table, struct hiding *out_hiding, struct error *out_error)
{
    size_t count = 0;
    size_t order[sim_effects_max] = {0};
    size_t turn = 0;
    uint64_t random[4];
    while (sim_effects[count]) {
        count++;
    }
    if (count > 0) {
        make_order(seed, count, order, &turn);
    }
    sim_random_seed(random, seed);
    for (size_t i = 0; i < count; i++) {
        if (hide((int)order[(turn + i) % count], seed, random, table, out_hiding)) {
            return 0;
        }
    }
    return error_set(out_error, error_refused, "no effect of the catalogue can show under this excitation");
}

// ---- Telling

cJSON *hiding_json(const struct hiding *self)
{
    const struct sim_effect *effect = sim_effects[self->effect];
    cJSON *root = cJSON_CreateObject();
    cJSON_AddStringToObject(root, "id", effect->id);
    cJSON *parameters = cJSON_AddObjectToObject(root, "parameters");
    for (size_t i = 0; i < effect->parameter_count; i++) {
        cJSON *parameter = cJSON_AddObjectToObject(parameters, effect->parameters[i].name);
        cJSON_AddNumberToObject(parameter, "value", self->values[i]);
        cJSON_AddNumberToObject(parameter, "nominal", self->nominal[i]);
    }
    cJSON_AddNumberToObject(root, "torque_share", self->torque_share);
    return root;
}

void hiding_describe(const struct hiding *self, size_t size, char *out_text)
{
    const struct sim_effect *effect = sim_effects[self->effect];
    size_t used = (size_t)snprintf(out_text, size, "%s:", effect->id);
    for (size_t i = 0; i < effect->parameter_count && used < size; i++) {
        used += (size_t)snprintf(out_text + used, size - used, "%s %s %.4g", i > 0 ? "," : "",
                                 effect->parameters[i].name, self->values[i]);
        if (self->nominal[i] != 0.0 && used < size) {
            used += (size_t)snprintf(out_text + used, size - used, " (the model has %.4g)", self->nominal[i]);
        }
    }
}
