/* SPDX-License-Identifier: MIT */
#include "tests/truth/truth_case.h"

#include <math.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925286766559;
static const double clear_evidence_nats = 1000.0;
enum { DRAWS = 60, DRAWS_FREE = 20, COLUMNS_MAX = 4 };

static const char *const kind_names[truth_kind_count] = {
    "clean",     "viscous_friction", "coulomb_friction",  "stribeck_friction", "asymmetric_friction",
    "load_bias", "inertia",          "belt_elasticity",   "cogging",           "torque_lag",
    "dead_time", "quadratic_drag",   "position_friction", "torque_constant",
};

const char *truth_kind_name(enum truth_kind kind)
{
    return kind_names[kind];
}

enum truth_kind truth_kind_find(const char *name)
{
    int kind = 0;
    while (kind < truth_kind_count && strcmp(kind_names[kind], name) != 0) {
        kind++;
    }
    return (enum truth_kind)kind;
}

int truth_kind_is_catalogued(enum truth_kind kind)
{
    return kind >= truth_kind_viscous_friction && kind <= truth_kind_dead_time;
}

static void draw_plant(struct truth_plant_spec *out, int two_mass, struct truth_random *random)
{
    double inertia = truth_random_log_uniform(random, 0.002, 0.01);
    double share = truth_random_uniform(random, 0.3, 0.6);
    double antiresonance = two_pi * truth_random_log_uniform(random, 20.0, 70.0);
    double damping = truth_random_uniform(random, 0.02, 0.06);
    *out = (struct truth_plant_spec){
        .two_mass = two_mass,
        .motor_inertia_kgm2 = inertia * (1.0 - share),
        .load_inertia_kgm2 = inertia * share,
        .viscous_friction_Nms_per_rad = truth_random_log_uniform(random, 0.002, 0.02),
        .coulomb_friction_Nm = truth_random_uniform(random, 0.02, 0.08),
        .torque_lag_s = truth_random_uniform(random, 0.3e-3, 1.0e-3),
        .dead_time_s = truth_random_uniform(random, 0.0, 0.5e-3),
        .process_noise_Nm = truth_random_uniform(random, 0.0, 0.01),
        .sample_s = 1.0 / TRUTH_RATE_HZ,
        .step_s = 40e-6,
    };
    if (two_mass) {
        out->belt_stiffness_Nm_per_rad = out->load_inertia_kgm2 * antiresonance * antiresonance;
        out->belt_damping_Nms_per_rad = 2.0 * damping * out->load_inertia_kgm2 * antiresonance;
    }
}

static void draw_sensors(struct truth_sensors *out, struct truth_random *random)
{
    out->position_rad = truth_random_log_uniform(random, 2e-6, 2e-5);
    out->velocity_rad_per_s = truth_random_log_uniform(random, 5e-4, 5e-3);
    out->torque_Nm = truth_random_log_uniform(random, 1e-3, 1e-2);
    // The coarsest encoder whose count is below 1.5 of the noise, so that rounding errors stay white.
    out->counts_per_rev = 65536.0;
    while (two_pi / out->counts_per_rev > 1.5 * out->position_rad) {
        out->counts_per_rev *= 2.0;
    }
}

static void draw_excitations(struct truth_case *self, struct truth_random *random)
{
    struct truth_excitation_wish wish = {
        .inertia_kgm2 = self->truth.motor_inertia_kgm2 + self->truth.load_inertia_kgm2,
        .torque_rms_Nm = truth_random_uniform(random, 0.3, 0.7),
        .speed_max_rad_per_s = truth_random_uniform(random, 1.2, 3.0),
        .corner_hz = truth_random_log_uniform(random, 2.0, 15.0),
        .stroke_rad = self->protocol == truth_protocol_stroke ? truth_random_uniform(random, 1.5, 4.0) : 0.0,
        .centre_rad = truth_random_uniform(random, -1.5, 1.5),
    };
    truth_excitation_make(&self->fit, &wish, random);
    wish.torque_rms_Nm *= 0.8;
    wish.speed_max_rad_per_s *= 0.8;
    wish.stroke_rad *= 0.8;
    truth_excitation_make(&self->validation, &wish, random);
    self->truth.coulomb_origin_rad = wish.centre_rad;
}

// Root mean square of f(v) = |v|^power over the reference of the fit run, in units of the column.
static double rms_of(const double *column, double power)
{
    double sum = 0.0;
    for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
        sum += pow(fabs(column[n]), 2.0 * power);
    }
    return sqrt(sum / TRUTH_PERIOD_SAMPLES);
}

static double changed_value(double value, double size, struct truth_random *random)
{
    int absent = truth_random_integer(random, 0, 2) == 0;
    double change = truth_random_uniform(random, 0.3, 0.8) * truth_random_sign(random);
    return absent ? value * fmax(0.0, 1.0 - size) : value / (1.0 + fmax(-0.8, change * size));
}

static void hide_friction(struct truth_case *self, struct truth_random *random)
{
    struct truth_plant_spec *truth = &self->truth;
    switch (self->kind) {
    case truth_kind_viscous_friction:
        self->without.viscous_friction_Nms_per_rad =
            changed_value(truth->viscous_friction_Nms_per_rad, self->size, random);
        break;
    case truth_kind_coulomb_friction:
        self->without.coulomb_friction_Nm = changed_value(truth->coulomb_friction_Nm, self->size, random);
        break;
    case truth_kind_stribeck_friction:
        truth->stribeck_excess_Nm = self->size * truth_random_uniform(random, 0.015, 0.05);
        truth->stribeck_velocity_rad_per_s = truth_random_uniform(random, 0.1, 0.5);
        break;
    case truth_kind_asymmetric_friction:
        truth->asymmetry_ratio =
            fmax(-0.9, fmin(0.9, self->size * truth_random_uniform(random, 0.1, 0.35) * truth_random_sign(random)));
        break;
    default:
        truth->bias_Nm = self->size * truth_random_uniform(random, 0.01, 0.08) * truth_random_sign(random);
        break;
    }
}

static void hide_mechanics(struct truth_case *self, struct truth_random *random)
{
    struct truth_plant_spec *truth = &self->truth;
    if (self->kind == truth_kind_inertia) {
        double change = self->size * truth_random_uniform(random, 0.15, 0.4) * truth_random_sign(random);
        self->without.load_inertia_kgm2 = truth->load_inertia_kgm2 / (1.0 + fmax(-0.8, change));
    } else if (self->kind == truth_kind_belt_elasticity) {
        truth->belt_stiffness_Nm_per_rad /= self->size;
        self->without.two_mass = 0;
        self->without.belt_stiffness_Nm_per_rad = self->without.belt_damping_Nms_per_rad = 0.0;
    } else {
        double range = fmin(truth_excitation_range_rad(&self->fit), truth_excitation_range_rad(&self->validation));
        int fewest = (int)ceil(2.0 * two_pi / range);
        truth->cogging_amplitude_Nm = self->size * truth_random_uniform(random, 0.01, 0.05);
        truth->cogging_periods_per_rev =
            truth_random_integer(random, fewest > 6 ? fewest : 6, fewest > 60 ? fewest : 60);
        truth->cogging_phase_rad = truth_random_uniform(random, 0.0, two_pi);
    }
}

static void hide_actuator(struct truth_case *self, struct truth_random *random)
{
    if (self->kind == truth_kind_torque_lag) {
        double factor = 1.0 + self->size * truth_random_uniform(random, 0.5, 2.0);
        self->without.torque_lag_s *= truth_random_sign(random) > 0.0 ? factor : 1.0 / factor;
    } else {
        self->truth.dead_time_s += self->size * truth_random_uniform(random, 0.3e-3, 1.5e-3);
    }
}

// Sized so that the unknown term is 3 to 8 % of the inertia's torque.
static void hide_unknown(struct truth_case *self, struct truth_random *random)
{
    struct truth_plant_spec *truth = &self->truth;
    double inertia = truth->motor_inertia_kgm2 + truth->load_inertia_kgm2;
    double torque_rms = inertia * rms_of(self->fit.acceleration_rad_per_s2, 1.0);
    double wanted = self->size * truth_random_uniform(random, 0.03, 0.08) * torque_rms;
    if (self->kind == truth_kind_quadratic_drag) {
        truth->quadratic_drag_Nms2_per_rad2 = wanted / rms_of(self->fit.velocity_rad_per_s, 2.0);
    } else if (self->kind == truth_kind_position_friction) {
        double away[TRUTH_PERIOD_SAMPLES];
        for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
            away[n] = self->fit.position_rad[n] - truth->coulomb_origin_rad;
        }
        double at_ends = self->size * truth_random_uniform(random, 0.4, 0.8);
        truth->coulomb_slope_per_rad =
            truth_random_sign(random) * fmin(0.9, at_ends) / (0.5 * truth_excitation_range_rad(&self->fit));
        // Friction at the middle that makes the slope's share as wanted, within what such a drive may have.
        double middle = wanted / (fabs(truth->coulomb_slope_per_rad) * rms_of(away, 1.0));
        truth->coulomb_friction_Nm = self->without.coulomb_friction_Nm = fmin(0.12, fmax(0.04, middle));
    } else {
        double cube = pow(inertia, 3.0) * rms_of(self->fit.acceleration_rad_per_s2, 3.0);
        double peak = 0.0;
        for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
            peak = fmax(peak, inertia * fabs(self->fit.acceleration_rad_per_s2[n]));
        }
        // T (1 - c T^2) must still grow at the peak, with room for what the loop adds.
        truth->torque_saturation_per_Nm2 = fmin(wanted / cube, 0.15 / (peak * peak));
    }
}

static void hide(struct truth_case *self, struct truth_random *random)
{
    self->without = self->truth;
    switch (self->kind) {
    case truth_kind_inertia:
    case truth_kind_belt_elasticity:
    case truth_kind_cogging:
        hide_mechanics(self, random);
        break;
    case truth_kind_torque_lag:
    case truth_kind_dead_time:
        hide_actuator(self, random);
        break;
    case truth_kind_quadratic_drag:
    case truth_kind_position_friction:
    case truth_kind_torque_constant:
        hide_unknown(self, random);
        break;
    case truth_kind_clean:
    case truth_kind_count:
        break;
    default:
        hide_friction(self, random);
        break;
    }
}

// The torque that the model lacks at sample n of the fit run's reference motion.
static double missing_Nm(const struct truth_case *self, int n)
{
    double x = self->fit.position_rad[n], v = self->fit.velocity_rad_per_s[n];
    double a = self->fit.acceleration_rad_per_s2[n];
    const struct truth_plant_spec *truth = &self->truth, *without = &self->without;
    double inertia = truth->motor_inertia_kgm2 + truth->load_inertia_kgm2;
    double more = inertia - without->motor_inertia_kgm2 - without->load_inertia_kgm2;
    double torque = inertia * a;
    int s = v < 0.0 ? -1 : 1;
    return more * a + truth->torque_saturation_per_Nm2 * torque * torque * torque +
           truth_plant_resistance_Nm(truth, x, v, s) - truth_plant_resistance_Nm(without, x, v, s);
}

// Root mean square of the missing torque that inertia, friction and bias of the refitted model cannot take up.
static double unexplained_rms_Nm(const struct truth_case *self)
{
    static const enum truth_kind owner[COLUMNS_MAX] = {truth_kind_inertia, truth_kind_viscous_friction,
                                                       truth_kind_coulomb_friction, truth_kind_load_bias};
    double basis[COLUMNS_MAX][TRUTH_PERIOD_SAMPLES], rest[TRUTH_PERIOD_SAMPLES], sum = 0.0;
    int used = 0;
    for (int column = 0; column <= COLUMNS_MAX; column++) {
        // The parameter that is wrong is not free in the model it is compared with.
        if (column < COLUMNS_MAX && owner[column] == self->kind) {
            continue;
        }
        double *target = column < COLUMNS_MAX ? basis[used] : rest;
        for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
            double v = self->fit.velocity_rad_per_s[n];
            const double value[COLUMNS_MAX + 1] = {self->fit.acceleration_rad_per_s2[n], v, v < 0.0 ? -1.0 : 1.0, 1.0,
                                                   missing_Nm(self, n)};
            target[n] = value[column];
        }
        for (int i = 0; i < used; i++) {
            double dot = 0.0;
            for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
                dot += basis[i][n] * target[n];
            }
            for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
                target[n] -= dot * basis[i][n];
            }
        }
        sum = 0.0;
        for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
            sum += target[n] * target[n];
        }
        for (int n = 0; column < COLUMNS_MAX && n < TRUTH_PERIOD_SAMPLES; n++) {
            target[n] /= sqrt(sum);
        }
        used += column < COLUMNS_MAX;
    }
    return sqrt(sum / TRUTH_PERIOD_SAMPLES);
}

// Evidence = samples (rms / noise)^2 / 2, with the noise that a torque from a measured motion has at 30 Hz. A rough
// figure, on the low side for what happens below 30 Hz. The actuator's effects are seen directly between two columns.
static double expected_evidence(const struct truth_case *self)
{
    const struct truth_plant_spec *truth = &self->truth, *without = &self->without;
    double inertia = truth->motor_inertia_kgm2 + truth->load_inertia_kgm2;
    double samples = (double)(self->periods - 1) * TRUTH_PERIOD_SAMPLES;
    double from_velocity = inertia * self->sensors.velocity_rad_per_s * two_pi * 30.0;
    double noise = hypot(hypot(self->sensors.torque_Nm, truth->process_noise_Nm), from_velocity);
    double rms = unexplained_rms_Nm(self);
    if (self->kind == truth_kind_torque_lag || self->kind == truth_kind_dead_time) {
        double late = fabs(truth->torque_lag_s - without->torque_lag_s) + truth->dead_time_s - without->dead_time_s;
        // Torque lines are flat to 100 Hz: the mean square of a torque's slope is (2 pi 100)^2 / 3 of its own.
        rms = late * inertia * rms_of(self->fit.acceleration_rad_per_s2, 1.0) * two_pi * 100.0 / sqrt(3.0);
        noise = self->sensors.torque_Nm;
    } else if (self->kind == truth_kind_belt_elasticity) {
        // Around the antiresonance a rigid model is wrong by the whole torque, over about a fifth of the band.
        rms = 0.4 * inertia * rms_of(self->fit.acceleration_rad_per_s2, 1.0);
    }
    return 0.5 * samples * (rms / noise) * (rms / noise);
}

static double off_by(double value, double ratio, struct truth_random *random)
{
    return value * (1.0 + truth_random_uniform(random, -ratio, ratio));
}

static void draw_nominal(struct truth_case *self, struct truth_random *random)
{
    struct truth_plant_spec *nominal = &self->nominal;
    *nominal = self->without;
    nominal->motor_inertia_kgm2 = off_by(nominal->motor_inertia_kgm2, 0.015, random);
    nominal->load_inertia_kgm2 = off_by(nominal->load_inertia_kgm2, 0.015, random);
    nominal->viscous_friction_Nms_per_rad = off_by(nominal->viscous_friction_Nms_per_rad, 0.03, random);
    nominal->coulomb_friction_Nm = off_by(nominal->coulomb_friction_Nm, 0.03, random);
    nominal->torque_lag_s = off_by(nominal->torque_lag_s, 0.02, random);
    nominal->dead_time_s = off_by(nominal->dead_time_s, 0.02, random);
    nominal->belt_stiffness_Nm_per_rad = off_by(nominal->belt_stiffness_Nm_per_rad, 0.02, random);
    nominal->belt_damping_Nms_per_rad = off_by(nominal->belt_damping_Nms_per_rad, 0.02, random);
}

static void state_answer(struct truth_case *self)
{
    const struct truth_plant_spec *truth = &self->truth;
    const struct truth_parameter answers[truth_kind_count][TRUTH_PARAMETERS_MAX] = {
        [truth_kind_viscous_friction] = {{"viscous_friction_Nms_per_rad", truth->viscous_friction_Nms_per_rad, 0}},
        [truth_kind_coulomb_friction] = {{"coulomb_friction_Nm", truth->coulomb_friction_Nm, 0}},
        [truth_kind_stribeck_friction] = {{"stribeck_excess_Nm", truth->stribeck_excess_Nm, 0},
                                          {"stribeck_velocity_rad_per_s", truth->stribeck_velocity_rad_per_s, 0}},
        [truth_kind_asymmetric_friction] = {{"asymmetry_ratio", truth->asymmetry_ratio, 0}},
        [truth_kind_load_bias] = {{"bias_Nm", truth->bias_Nm, 1}},
        [truth_kind_inertia] = {{"load_inertia_kgm2", truth->load_inertia_kgm2, 0}},
        [truth_kind_belt_elasticity] = {{"belt_stiffness_Nm_per_rad", truth->belt_stiffness_Nm_per_rad, 0}},
        [truth_kind_cogging] = {{"amplitude_Nm", truth->cogging_amplitude_Nm, 1},
                                {"periods_per_rev", truth->cogging_periods_per_rev, 0}},
        [truth_kind_torque_lag] = {{"torque_lag_s", truth->torque_lag_s, 0}},
        [truth_kind_dead_time] = {{"dead_time_s", truth->dead_time_s, 0}},
        [truth_kind_quadratic_drag] = {{"quadratic_drag_Nms2_per_rad2", truth->quadratic_drag_Nms2_per_rad2, 0}},
        [truth_kind_position_friction] = {{"coulomb_slope_per_rad", truth->coulomb_slope_per_rad, 0},
                                          {"coulomb_origin_rad", truth->coulomb_origin_rad, 0}},
        [truth_kind_torque_constant] = {{"torque_saturation_per_Nm2", truth->torque_saturation_per_Nm2, 0}},
    };
    self->parameters = 0;
    while (self->parameters < TRUTH_PARAMETERS_MAX && answers[self->kind][self->parameters].name) {
        self->parameter[self->parameters] = answers[self->kind][self->parameters];
        self->parameters++;
    }
}

// Whether a drawn case shows its effect. Cogging needs two of its periods under the motion.
static int shows(const struct truth_case *self)
{
    if (self->kind == truth_kind_clean) {
        return 1;
    }
    if (self->kind == truth_kind_cogging && self->truth.cogging_periods_per_rev > 60.0) {
        return 0;
    }
    return self->expected_evidence_nats >= clear_evidence_nats * self->size * self->size;
}

void truth_case_make(struct truth_case *self, uint64_t seed, enum truth_kind kind, double size,
                     enum truth_protocol protocol)
{
    *self = (struct truth_case){.kind = kind, .seed = seed, .size = size};
    struct truth_random random;
    truth_random_init(&random, seed, 1000u + (uint64_t)kind);
    for (int draw = 0; draw < DRAWS; draw++) {
        int coin = truth_random_integer(&random, 0, 1);
        self->protocol = protocol != truth_protocol_any    ? protocol
                         : draw >= DRAWS_FREE || coin != 0 ? truth_protocol_stroke
                                                           : truth_protocol_multisine;
        self->periods = truth_random_integer(&random, 0, 1) ? 11 : 7;
        int two_mass = truth_random_integer(&random, 0, 1) || kind == truth_kind_belt_elasticity;
        draw_plant(&self->truth, two_mass, &random);
        draw_sensors(&self->sensors, &random);
        draw_excitations(self, &random);
        hide(self, &random);
        self->expected_evidence_nats = kind == truth_kind_clean ? 0.0 : expected_evidence(self);
        if (shows(self)) {
            break;
        }
    }
    draw_nominal(self, &random);
    self->controller = (struct truth_controller){
        .inertia_kgm2 = self->nominal.motor_inertia_kgm2 + self->nominal.load_inertia_kgm2,
        .late_samples = truth_random_integer(&random, 0, 1),
    };
    truth_controller_tune(&self->controller, &self->truth, truth_random_uniform(&random, 40.0, 80.0));
    state_answer(self);
}
