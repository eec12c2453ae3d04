/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/hypothesis.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

/// How far the given model's numbers may be off without that being a cause: standard deviation and box, relative.
struct tolerance {
    size_t offset;
    double deviation, box;
};

static const struct tolerance tolerances[] = {
    {offsetof(struct sim_model, motor_inertia_kgm2), 0.01, 0.02},
    {offsetof(struct sim_model, load_inertia_kgm2), 0.02, 0.05},
    {offsetof(struct sim_model, belt_stiffness_Nm_per_rad), 0.03, 0.08},
    {offsetof(struct sim_model, belt_damping_Nms_per_rad), 0.3, 1.0},
    {offsetof(struct sim_model, viscous_friction_Nms_per_rad), 0.04, 0.10},
    {offsetof(struct sim_model, coulomb_friction_Nm), 0.04, 0.10},
    {offsetof(struct sim_model, torque_lag_s), 0.04, 0.10},
    {offsetof(struct sim_model, dead_time_s), 0.04, 0.10},
};

static double field(const struct sim_model *model, size_t offset)
{
    double value;
    memcpy(&value, (const char *)model + offset, sizeof value);
    return value;
}

static void set_field(struct sim_model *model, size_t offset, double value)
{
    memcpy((char *)model + offset, &value, sizeof value);
}

static size_t find_offset(const struct hypothesis *self, size_t offset)
{
    for (size_t i = 0; i < self->count; i++)
        if (self->coordinates[i].model_offset == offset)
            return i;
    return SIZE_MAX;
}

static void add_coordinate(struct hypothesis *self, struct coordinate c, double x)
{
    self->coordinates[self->count] = c;
    self->x[self->count] = x;
    self->count++;
}

static void remove_coordinate(struct hypothesis *self, size_t i)
{
    self->count--;
    memmove(&self->coordinates[i], &self->coordinates[i + 1], (self->count - i) * sizeof self->coordinates[0]);
    memmove(&self->x[i], &self->x[i + 1], (self->count - i) * sizeof self->x[0]);
}

static bool belongs_to_actuator(size_t offset)
{
    return offset == offsetof(struct sim_model, torque_lag_s) || offset == offsetof(struct sim_model, dead_time_s);
}

static bool belongs_to_belt(size_t offset)
{
    return offset == offsetof(struct sim_model, belt_stiffness_Nm_per_rad) ||
           offset == offsetof(struct sim_model, belt_damping_Nms_per_rad);
}

static bool belongs_to_inertia(size_t offset)
{
    return offset == offsetof(struct sim_model, motor_inertia_kgm2) ||
           offset == offsetof(struct sim_model, load_inertia_kgm2);
}

/// Whether the present structure has the number at all, the recordings can show it, and nothing moves it yet.
static bool may_be_off(const struct hypothesis *self, size_t offset)
{
    if (belongs_to_belt(offset) && self->engaged.structure != sim_structure_two_mass)
        return false;
    if (belongs_to_actuator(offset) && !self->actuator_seen)
        return false;
    return field(&self->engaged, offset) > 0.0 && find_offset(self, offset) == SIZE_MAX &&
           self->count < hypothesis_coordinates_max;
}

static void set_box(struct coordinate *c, double lower, double upper, double weight)
{
    c->lower = lower;
    c->upper = upper;
    c->weight = weight;
}

/// The few percent by which a number of the given model may be off.
static void add_nuisance(struct hypothesis *self, const struct tolerance *t)
{
    if (!may_be_off(self, t->offset))
        return;
    struct coordinate c = {.effect = -1,
                           .model_offset = t->offset,
                           .scale = coordinate_logarithmic,
                           .unit = field(&self->engaged, t->offset)};
    bool inertia = belongs_to_inertia(t->offset);
    set_box(&c, log1p(-fmin(t->box, 0.9)), log1p(t->box), 1.0 / t->deviation);
    if (inertia && self->inertia_free) {
        set_box(&c, -40.0, 40.0, 0.0);
    } else if (inertia && self->engaged.structure != self->given->structure) {
        // A rigid model shows the sum only: its split may be less exact, or not known at all.
        bool split = self->given->motor_inertia_kgm2 > 0.0 && self->given->load_inertia_kgm2 > 0.0;
        set_box(&c, split ? -0.4 : -3.0, split ? 0.4 : 3.0, split ? 10.0 : 1.0);
    }
    add_coordinate(self, c, 0.0);
}

static void add_nuisances(struct hypothesis *self)
{
    for (size_t i = 0; i < sizeof tolerances / sizeof tolerances[0]; i++)
        add_nuisance(self, &tolerances[i]);
}

void hypothesis_init(struct hypothesis *self, const struct sim_model *given, bool inertia_free, bool actuator_seen)
{
    memset(self, 0, sizeof *self);
    self->given = given;
    self->engaged = *given;
    self->inertia_free = inertia_free;
    self->actuator_seen = actuator_seen;
    add_nuisances(self);
}

/// Whether the model as it is now, other names included, has what the effect acts on.
static bool has_place_for(const struct hypothesis *self, int effect)
{
    struct sim_model model;
    if (!sim_effects[effect]->applies)
        return true;
    hypothesis_model(self, NULL, &model);
    return sim_effects[effect]->applies(&model);
}

bool hypothesis_may_name(const struct hypothesis *self, int effect)
{
    const struct sim_effect *e = sim_effects[effect];
    // What is noticed in the rows themselves needs no fit.
    if (self->named[effect] || self->given->effect_on[effect] || e->notice ||
        self->count + e->parameter_count + 2 > hypothesis_coordinates_max)
        return false;
    if (e->place == sim_place_actuator && !self->actuator_seen)
        return false;
    bool gain_is_inertia = self->gain_free && self->engaged.structure == sim_structure_rigid;
    bool free_inertia = e->parameters[0].model_offset == offsetof(struct sim_model, load_inertia_kgm2) &&
                        (self->inertia_free || gain_is_inertia);
    return !free_inertia && has_place_for(self, effect);
}

/// Whether only the comparison of position and speed columns shows a parameter, and there is none: it is as usual.
static bool is_usual(const struct hypothesis *self, int effect, size_t i)
{
    return sim_effects[effect]->sense && sim_effects[effect]->parameters[i].optional && !self->sensors_seen;
}

static void name_parameter(struct hypothesis *self, int effect, size_t i, const double *values)
{
    const struct sim_parameter *p = &sim_effects[effect]->parameters[i];
    if (is_usual(self, effect, i))
        return;
    bool linear = self->given->linear;
    double low = linear ? p->linear_minimum : p->minimum, high = linear ? p->linear_maximum : p->maximum;
    struct coordinate c = {.effect = effect, .parameter = i, .model_offset = p->model_offset, .unit = 1.0};
    const double widest =
        3.4; // thirtyfold either way of where the search starts: far enough, and the plant stays solvable
    double x = 1.0;
    switch (p->kind) {
    case sim_parameter_linear:
        c.scale = coordinate_linear;
        c.unit = values[i] != 0.0 ? fabs(values[i]) : 1.0;
        x = values[i] / c.unit;
        c.lower = low / c.unit;
        c.upper = high / c.unit;
        if (p->near_whole > 0.0) {
            c.centre = floor(values[i] + 0.5) / c.unit;
            c.weight = c.unit / p->near_whole;
        }
        break;
    case sim_parameter_positive:
        c.scale = coordinate_logarithmic;
        c.unit = values[i];
        x = 0.0;
        c.lower = fmax(log(low / c.unit), -widest);
        c.upper = fmin(log(high / c.unit), widest);
        break;
    case sim_parameter_amplitude:
        c.scale = coordinate_cosine;
        c.unit = values[i];
        x = cos(values[i + 1]);
        c.lower = -high / c.unit;
        c.upper = high / c.unit;
        break;
    case sim_parameter_phase:
        c.scale = coordinate_sine;
        c.unit = values[i - 1];
        x = sin(values[i]);
        high = linear ? (p - 1)->linear_maximum : (p - 1)->maximum;
        c.lower = -high / c.unit;
        c.upper = high / c.unit;
        break;
    }
    size_t nuisance = p->model_offset != SIZE_MAX ? find_offset(self, p->model_offset) : SIZE_MAX;
    if (nuisance != SIZE_MAX)
        remove_coordinate(self, nuisance);
    add_coordinate(self, c, x);
}

/// The given model with what the named effects change of its structure; values of fields come from the coordinates.
static void rebuild_engaged(struct hypothesis *self)
{
    self->engaged = *self->given;
    for (size_t e = 0; sim_effects[e]; e++) {
        if (!self->named[e])
            continue;
        if (sim_effects[e]->engage)
            sim_effects[e]->engage(&self->engaged);
        self->engaged.effect_on[e] = sim_effects[e]->parameters[0].model_offset == SIZE_MAX;
        for (size_t i = 0; i < sim_effects[e]->parameter_count; i++)
            if (is_usual(self, (int)e, i))
                self->engaged.effect_parameters[e][i] = sim_effects[e]->parameters[i].usual;
    }
}

size_t hypothesis_along(const struct hypothesis *self, size_t i)
{
    const struct coordinate *c = &self->coordinates[i];
    if (c->effect < 0 || !sim_effects[c->effect]->along)
        return self->count;
    size_t j = find_offset(self, sim_effects[c->effect]->along_offset);
    return j < self->count && self->coordinates[j].scale == coordinate_logarithmic ? j : self->count;
}

/// Logarithm of the factor by which an effect changes a number of the model in the middle of the travel.
static double log_factor(const struct hypothesis *self, const double *x, int effect)
{
    struct sim_model model;
    hypothesis_model(self, x, &model);
    return log(sim_effects[effect]->along(model.effect_parameters[effect], self->middle));
}

double hypothesis_along_shift(const struct hypothesis *self, const double *x, size_t i, double to)
{
    double moved[hypothesis_coordinates_max];
    int effect = self->coordinates[i].effect;
    memcpy(moved, x, self->count * sizeof *moved);
    moved[i] = to;
    return log_factor(self, x, effect) - log_factor(self, moved, effect);
}

/// Moves the number that a named effect changes along the travel, as far as its box allows, so that in the middle it is
/// what it was before the effect was named (or what it is with it, when the name is taken back: sign -1).
static void level(struct hypothesis *self, int effect, double sign)
{
    for (size_t i = 0; i < self->count; i++) {
        size_t j = self->coordinates[i].effect == effect ? hypothesis_along(self, i) : self->count;
        if (j == self->count)
            continue;
        const struct coordinate *c = &self->coordinates[j];
        self->x[j] = fmin(fmax(self->x[j] - sign * log_factor(self, NULL, effect), c->lower), c->upper);
        return;
    }
}

void hypothesis_name(struct hypothesis *self, int effect, const double *values)
{
    self->named[effect] = true;
    for (size_t i = 0; i < sim_effects[effect]->parameter_count; i++)
        name_parameter(self, effect, i, values);
    enum sim_structure before = self->engaged.structure;
    rebuild_engaged(self);
    if (self->engaged.structure != before) { // the inertias' boxes were the rigid model's
        for (size_t i = self->count; i-- > 0;)
            if (self->coordinates[i].effect < 0)
                remove_coordinate(self, i);
    }
    add_nuisances(self);
    level(self, effect, 1.0);
}

static void take_back(struct hypothesis *self, int effect)
{
    level(self, effect, -1.0);
    self->named[effect] = false;
    for (size_t i = self->count; i-- > 0;)
        if (self->coordinates[i].effect == effect)
            remove_coordinate(self, i);
    rebuild_engaged(self);
    if (sim_effects[effect]->engage)
        for (size_t i = self->count; i-- > 0;)
            if (self->coordinates[i].effect < 0)
                remove_coordinate(self, i);
    add_nuisances(self);
}

void hypothesis_unname(struct hypothesis *self, int effect)
{
    take_back(self, effect);
    for (int e = 0; sim_effects[e]; e++) {
        struct hypothesis without = *self;
        if (!self->named[e] || !sim_effects[e]->applies)
            continue;
        take_back(&without, e);
        if (!has_place_for(&without, e))
            *self = without;
    }
}

static double *parameter_place(const struct coordinate *c, struct sim_model *model)
{
    return &model->effect_parameters[c->effect][c->parameter];
}

/// A logarithm and back may end a few digits beyond the wall that a coordinate stands at; a model file would refuse it.
static double off_the_wall(const struct hypothesis *self, const struct coordinate *c, double value)
{
    const double rounding = 1e-9;
    if (c->effect < 0)
        return value;
    const struct sim_parameter *p = &sim_effects[c->effect]->parameters[c->parameter];
    double low = self->given->linear ? p->linear_minimum : p->minimum,
           high = self->given->linear ? p->linear_maximum : p->maximum;
    if (value > high && value <= high + rounding * fabs(high))
        return high;
    return value < low && value >= low - rounding * fabs(low) ? low : value;
}

void hypothesis_model(const struct hypothesis *self, const double *x, struct sim_model *out_model)
{
    if (!x)
        x = self->x;
    *out_model = self->engaged;
    for (size_t i = 0; i < self->count; i++) {
        const struct coordinate *c = &self->coordinates[i];
        double value = off_the_wall(self, c, c->unit * (c->scale == coordinate_logarithmic ? exp(x[i]) : x[i]));
        if (c->scale == coordinate_sine)
            continue; // set together with its cosine part
        if (c->scale == coordinate_cosine) {
            *parameter_place(c, out_model) = hypot(value, c->unit * x[i + 1]);
            *(parameter_place(c, out_model) + 1) = atan2(x[i + 1], x[i]);
        } else if (c->model_offset != SIZE_MAX) {
            set_field(out_model, c->model_offset, value);
        } else {
            *parameter_place(c, out_model) = value;
        }
    }
}

void hypothesis_parameters(const struct hypothesis *self, int effect, const double *covariance, double *out_values,
                           double *out_deviations)
{
    struct sim_model model;
    hypothesis_model(self, NULL, &model);
    size_t n = self->count;
    for (size_t i = 0; i < sim_effects[effect]->parameter_count; i++)
        if (is_usual(self, effect, i))
            out_values[i] = model.effect_parameters[effect][i];
    for (size_t i = 0; i < n; i++) {
        const struct coordinate *c = &self->coordinates[i];
        if (c->effect != effect)
            continue;
        double value = c->model_offset != SIZE_MAX ? field(&model, c->model_offset) : *parameter_place(c, &model);
        out_values[c->parameter] = value;
        if (!covariance)
            continue;
        double variance = covariance[i * n + i];
        if (c->scale == coordinate_cosine || c->scale == coordinate_sine) {
            size_t j = c->scale == coordinate_cosine ? i : i - 1;
            double xc = self->x[j], xs = self->x[j + 1], size = hypot(xc, xs);
            double cc = covariance[j * n + j], ss = covariance[(j + 1) * n + j + 1], cs = covariance[j * n + j + 1];
            double along = (xc * xc * cc + xs * xs * ss + 2 * xc * xs * cs) / (size * size);
            double across = (xs * xs * cc + xc * xc * ss - 2 * xc * xs * cs) / (size * size);
            out_deviations[c->parameter] = c->scale == coordinate_cosine ? c->unit * sqrt(along) : sqrt(across) / size;
        } else {
            out_deviations[c->parameter] = sqrt(variance) * (c->scale == coordinate_logarithmic ? value : c->unit);
        }
    }
}

bool hypothesis_is_detail(const struct hypothesis *self, int effect)
{
    double values[sim_effect_parameters_max] = {0}, unused[sim_effect_parameters_max];
    if (!self->named[effect] || !sim_effects[effect]->detail)
        return false;
    hypothesis_parameters(self, effect, NULL, values, unused);
    return sim_effects[effect]->detail(values, self->given->linear);
}

size_t hypothesis_claims(const struct hypothesis *self)
{
    size_t count = 0;
    for (int e = 0; sim_effects[e]; e++)
        count += self->named[e] && !hypothesis_is_detail(self, e);
    return count;
}
