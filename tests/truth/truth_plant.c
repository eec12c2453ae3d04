/* SPDX-License-Identifier: MIT */
#include "tests/truth/truth_plant.h"

#include <math.h>

enum { STATES = 4, MOTOR_POSITION = 0, MOTOR_VELOCITY = 1, LOAD_POSITION = 2, LOAD_VELOCITY = 3 };
enum { NOISE_PER_SAMPLE = 4, EVENTS_PER_STEP = 8, LOCATE_STEPS = 24 };

struct state {
    double x[STATES];
};

static double friction_Nm(const struct truth_plant_spec *spec, double position, double velocity, int direction)
{
    double s = (double)direction;
    double dry =
        spec->coulomb_friction_Nm * (1.0 + spec->coulomb_slope_per_rad * (position - spec->coulomb_origin_rad));
    if (spec->stribeck_excess_Nm != 0.0) {
        double ratio = velocity / spec->stribeck_velocity_rad_per_s;
        dry += spec->stribeck_excess_Nm * exp(-ratio * ratio);
    }
    double wet = spec->viscous_friction_Nms_per_rad * velocity;
    wet += spec->quadratic_drag_Nms2_per_rad2 * velocity * fabs(velocity);
    return (1.0 + spec->asymmetry_ratio * s) * (wet + s * dry);
}

static double field_Nm(const struct truth_plant_spec *spec, double position)
{
    double torque = spec->bias_Nm;
    if (spec->cogging_amplitude_Nm != 0.0) {
        torque += spec->cogging_amplitude_Nm * cos(spec->cogging_periods_per_rev * position + spec->cogging_phase_rad);
    }
    return torque;
}

double truth_plant_resistance_Nm(const struct truth_plant_spec *spec, double position_rad, double velocity_rad_per_s,
                                 int direction)
{
    return friction_Nm(spec, position_rad, velocity_rad_per_s, direction) - field_Nm(spec, position_rad);
}

static double belt_Nm(const struct truth_plant_spec *spec, const double *x)
{
    if (!spec->two_mass) {
        return 0.0;
    }
    return spec->belt_stiffness_Nm_per_rad * (x[MOTOR_POSITION] - x[LOAD_POSITION]) +
           spec->belt_damping_Nms_per_rad * (x[MOTOR_VELOCITY] - x[LOAD_VELOCITY]);
}

// Everything on the motor but friction.
static double drive_Nm(const struct truth_plant *self, const double *x, double torque)
{
    const struct truth_plant_spec *spec = &self->spec;
    double real = torque * (1.0 - spec->torque_saturation_per_Nm2 * torque * torque);
    return real + self->noise_Nm + field_Nm(spec, x[MOTOR_POSITION]) - belt_Nm(spec, x);
}

static void derive(const struct truth_plant *self, const double *x, double torque, double *out)
{
    const struct truth_plant_spec *spec = &self->spec;
    out[MOTOR_POSITION] = self->direction ? x[MOTOR_VELOCITY] : 0.0;
    out[MOTOR_VELOCITY] = 0.0;
    if (self->direction) {
        double inertia = spec->motor_inertia_kgm2 + (spec->two_mass ? 0.0 : spec->load_inertia_kgm2);
        double net =
            drive_Nm(self, x, torque) - friction_Nm(spec, x[MOTOR_POSITION], x[MOTOR_VELOCITY], self->direction);
        out[MOTOR_VELOCITY] = net / inertia;
    }
    out[LOAD_POSITION] = spec->two_mass ? x[LOAD_VELOCITY] : 0.0;
    out[LOAD_VELOCITY] = spec->two_mass ? belt_Nm(spec, x) / spec->load_inertia_kgm2 : 0.0;
}

static double lagged_Nm(const struct truth_plant *self, double target, double after_s)
{
    if (!(self->spec.torque_lag_s > 0.0)) {
        return target;
    }
    return target + (self->torque_Nm - target) * exp(-after_s / self->spec.torque_lag_s);
}

// One classical Runge-Kutta step of any length from the present state; the actuator's torque is known exactly in it.
static struct state try_step(const struct truth_plant *self, double target, double h)
{
    const double start[STATES] = {self->position_rad, self->velocity_rad_per_s, self->load_position_rad,
                                  self->load_velocity_rad_per_s};
    double torque[3] = {lagged_Nm(self, target, 0.0), lagged_Nm(self, target, 0.5 * h), lagged_Nm(self, target, h)};
    static const int when[4] = {0, 1, 1, 2};
    static const double reach[4] = {0.0, 0.5, 0.5, 1.0};
    static const double weight[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
    struct state end;
    double slope[STATES] = {0};
    for (int i = 0; i < STATES; i++) {
        end.x[i] = start[i];
    }
    for (int stage = 0; stage < 4; stage++) {
        double at[STATES];
        for (int i = 0; i < STATES; i++) {
            at[i] = start[i] + reach[stage] * h * slope[i];
        }
        derive(self, at, torque[when[stage]], slope);
        for (int i = 0; i < STATES; i++) {
            end.x[i] += weight[stage] * h * slope[i];
        }
    }
    return end;
}

static int push_direction(double torque)
{
    return torque > 0.0 ? 1 : -1;
}

// How far the present mode is from its end: positive inside, negative beyond. Slipping ends when the speed changes
// sign, sticking when the torque exceeds breakaway.
static double margin(const struct truth_plant *self, const double *x, double torque)
{
    if (self->direction) {
        return (double)self->direction * x[MOTOR_VELOCITY];
    }
    double push = drive_Nm(self, x, torque);
    return fabs(friction_Nm(&self->spec, x[MOTOR_POSITION], 0.0, push_direction(push))) - fabs(push);
}

// Length of the step to the mode's end, which lies within h: regula falsi with the Illinois rule.
static double locate_end(const struct truth_plant *self, double target, double h, double at_start, double at_end)
{
    double lo = 0.0, hi = h, g_lo = at_start, g_hi = at_end;
    for (int i = 0; i < LOCATE_STEPS && hi - lo > 1e-12 * h; i++) {
        double mid = g_lo > 0.0 ? lo + (hi - lo) * g_lo / (g_lo - g_hi) : 0.5 * (lo + hi);
        struct state end = try_step(self, target, mid);
        double g = margin(self, end.x, lagged_Nm(self, target, mid));
        if (g > 0.0) {
            lo = mid;
            g_lo = g;
            g_hi *= 0.5;
        } else {
            hi = mid;
            g_hi = g;
            g_lo *= 0.5;
        }
        if (g == 0.0) {
            break;
        }
    }
    return hi;
}

static void accept(struct truth_plant *self, const struct state *end, double torque)
{
    self->position_rad = end->x[MOTOR_POSITION];
    self->velocity_rad_per_s = end->x[MOTOR_VELOCITY];
    self->load_position_rad = self->spec.two_mass ? end->x[LOAD_POSITION] : self->position_rad;
    self->load_velocity_rad_per_s = self->spec.two_mass ? end->x[LOAD_VELOCITY] : self->velocity_rad_per_s;
    self->torque_Nm = torque;
}

// At zero speed: stick, or slip the way the torque pushes. A stuck motor's speed is zero to the last bit.
static void choose_mode(struct truth_plant *self)
{
    self->velocity_rad_per_s = 0.0;
    if (!self->spec.two_mass) {
        self->load_velocity_rad_per_s = 0.0;
    }
    const double x[STATES] = {self->position_rad, 0.0, self->load_position_rad, self->load_velocity_rad_per_s};
    self->direction = 0;
    if (margin(self, x, self->torque_Nm) < 0.0) {
        self->direction = push_direction(drive_Nm(self, x, self->torque_Nm));
    }
}

static void integrate(struct truth_plant *self, double target, double h)
{
    self->torque_Nm = lagged_Nm(self, target, 0.0);
    for (int event = 0; h > 0.0; event++) {
        if (self->velocity_rad_per_s == 0.0) {
            choose_mode(self);
        }
        const double x[STATES] = {self->position_rad, self->velocity_rad_per_s, self->load_position_rad,
                                  self->load_velocity_rad_per_s};
        double at_start = margin(self, x, self->torque_Nm);
        struct state end = try_step(self, target, h);
        double after = lagged_Nm(self, target, h);
        double at_end = margin(self, end.x, after);
        if (!(at_end < 0.0) || event >= EVENTS_PER_STEP) {
            accept(self, &end, after);
            return;
        }
        double part = locate_end(self, target, h, at_start, at_end);
        end = try_step(self, target, part);
        accept(self, &end, lagged_Nm(self, target, part));
        choose_mode(self);
        h -= part;
    }
}

static void integrate_span(struct truth_plant *self, double target, double span)
{
    int steps = (int)ceil(span / self->spec.step_s - 1e-9);
    for (int i = 0; i < steps; i++) {
        integrate(self, target, span / (double)steps);
    }
}

static int whole_delay(const struct truth_plant_spec *spec)
{
    return (int)floor(spec->dead_time_s / spec->sample_s + 1e-12);
}

void truth_plant_init(struct truth_plant *self, const struct truth_plant_spec *spec, double position_rad, uint64_t seed)
{
    *self = (struct truth_plant){.spec = *spec, .position_rad = position_rad, .load_position_rad = position_rad};
    truth_random_init(&self->random, seed, 77u);
}

void truth_plant_launch(struct truth_plant *self, double velocity_rad_per_s)
{
    self->velocity_rad_per_s = velocity_rad_per_s;
    self->load_velocity_rad_per_s = velocity_rad_per_s;
    self->direction = velocity_rad_per_s > 0.0 ? 1 : velocity_rad_per_s < 0.0 ? -1 : 0;
}

void truth_plant_hold(struct truth_plant *self, double torque_ref_Nm)
{
    for (int i = TRUTH_PLANT_HISTORY - 1; i > 0; i--) {
        self->history_Nm[i] = self->history_Nm[i - 1];
    }
    self->history_Nm[0] = torque_ref_Nm;
    if (!(self->spec.torque_lag_s > 0.0)) {
        int whole = whole_delay(&self->spec);
        double rest = self->spec.dead_time_s - (double)whole * self->spec.sample_s;
        self->torque_Nm = self->history_Nm[rest > 1e-12 ? whole + 1 : whole];
    }
}

void truth_plant_advance(struct truth_plant *self)
{
    const struct truth_plant_spec *spec = &self->spec;
    int whole = whole_delay(spec);
    double edge = spec->dead_time_s - (double)whole * spec->sample_s;
    double quarter = spec->sample_s / NOISE_PER_SAMPLE;
    for (int i = 0; i < NOISE_PER_SAMPLE; i++) {
        double begin = i * quarter, end = begin + quarter;
        double old_part = fmin(fmax(edge - begin, 0.0), quarter);
        // The mean of four values has half the standard deviation of one.
        self->noise_Nm = 2.0 * spec->process_noise_Nm * truth_random_normal(&self->random);
        if (old_part > 1e-12) {
            integrate_span(self, self->history_Nm[whole + 1], old_part);
        }
        if (end - begin - old_part > 1e-12) {
            integrate_span(self, self->history_Nm[whole], end - begin - old_part);
        }
    }
}
