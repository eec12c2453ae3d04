/* SPDX-License-Identifier: MIT */
#include "tests/truth/truth_plant.h"

#include <math.h>

enum {
    STATES = TRUTH_PLANT_STATES,
    MOTOR_POSITION = 0,
    MOTOR_VELOCITY,
    LOAD_POSITION,
    LOAD_VELOCITY,
    THIRD_POSITION,
    THIRD_VELOCITY,
    BRISTLE,
    LOAD_BRISTLE
};
enum { NOISE_PER_SAMPLE = 4, EVENTS_PER_STEP = 8, LOCATE_STEPS = 24 };

static const double two_pi = 6.283185307179586476925286766559;

struct state {
    double x[STATES];
};

// What acts from outside the states at one instant: torque behind dead time and lag, and the time.
struct moment {
    double lagged_Nm, time_s;
};

static double clipped(double value, double limit)
{
    return fmin(limit, fmax(-limit, value));
}

static double risen(double ratio, double time_constant_s, double time_s)
{
    return ratio != 0.0 ? 1.0 + ratio * -expm1(-time_s / time_constant_s) : 1.0;
}

static double output_Nm(const struct truth_plant_spec *spec, double lagged)
{
    double torque = spec->torque_limit_Nm > 0.0 ? clipped(lagged, spec->torque_limit_Nm) : lagged;
    return torque - clipped(torque, spec->torque_dead_band_Nm);
}

static double dry_Nm(const struct truth_plant_spec *spec, double position, double velocity, double torque)
{
    double dry =
        spec->coulomb_friction_Nm * (1.0 + spec->coulomb_slope_per_rad * (position - spec->coulomb_origin_rad));
    if (spec->stribeck_excess_Nm != 0.0) {
        double ratio = velocity / spec->stribeck_velocity_rad_per_s;
        dry += spec->stribeck_excess_Nm * exp(-ratio * ratio);
    }
    return dry + spec->friction_per_torque * fabs(torque);
}

// Rate of a bristle's deflection, as a share of the greatest.
static double bristle_rate(const struct truth_plant_spec *spec, double z, double velocity)
{
    double free_rate = velocity / spec->presliding_distance_rad;
    if (spec->bristle != truth_bristle_elastoplastic) {
        return free_rate - fabs(free_rate) * z;
    }
    double elastic = spec->bristle_elastic_share, along = velocity < 0.0 ? -z : z, slipping = 0.0;
    if (along >= 1.0) {
        slipping = 1.0;
    } else if (along > elastic) {
        slipping = 0.5 + 0.5 * sin(0.5 * two_pi * (along - 0.5 * (1.0 + elastic)) / (1.0 - elastic));
    }
    return free_rate * (1.0 - slipping * along);
}

static double friction_Nm(const struct truth_plant_spec *spec, const double *x, int direction, const struct moment *now)
{
    double s = (double)direction, velocity = x[MOTOR_VELOCITY];
    double dry = dry_Nm(spec, x[MOTOR_POSITION], velocity, output_Nm(spec, now->lagged_Nm));
    double wet = spec->viscous_friction_Nms_per_rad * velocity;
    wet += spec->quadratic_drag_Nms2_per_rad2 * velocity * fabs(velocity);
    double warm = risen(spec->friction_drift_ratio, spec->friction_drift_s, now->time_s);
    if (spec->presliding_distance_rad > 0.0) {
        double z = x[BRISTLE];
        double force = z + spec->bristle_damping_s * bristle_rate(spec, z, velocity);
        return warm * (1.0 + spec->asymmetry_ratio * z) * (wet + dry * force);
    }
    return warm * (1.0 + spec->asymmetry_ratio * s) * (wet + s * dry);
}

static double field_Nm(const struct truth_plant_spec *spec, double position)
{
    double torque = spec->bias_Nm - spec->ground_stiffness_Nm_per_rad * (position - spec->coulomb_origin_rad);
    if (spec->cogging_amplitude_Nm != 0.0) {
        torque += spec->cogging_amplitude_Nm * cos(spec->cogging_periods_per_rev * position + spec->cogging_phase_rad);
    }
    return torque;
}

static double burst_Nm(const struct truth_plant *self, double time_s)
{
    const struct truth_plant_spec *spec = &self->spec;
    double torque = 0.0;
    for (int i = 0; i < TRUTH_PLANT_BURSTS; i++) {
        double since = time_s - self->burst_s[i];
        if (since > 0.0 && since < spec->burst_length_s) {
            double window = sin(0.5 * two_pi * since / spec->burst_length_s);
            torque += window * window * sin(two_pi * spec->burst_hz * since);
        }
    }
    return spec->burst_amplitude_Nm * torque;
}

static double disturbance_Nm(const struct truth_plant *self, double time_s)
{
    const struct truth_plant_spec *spec = &self->spec;
    double torque = time_s >= spec->step_bias_s ? spec->step_bias_Nm : 0.0;
    if (spec->disturbance_amplitude_Nm != 0.0) {
        torque +=
            spec->disturbance_amplitude_Nm * sin(two_pi * spec->disturbance_hz * time_s + spec->disturbance_phase_rad);
    }
    return spec->burst_amplitude_Nm != 0.0 ? torque + burst_Nm(self, time_s) : torque;
}

double truth_plant_resistance_Nm(const struct truth_plant_spec *spec, double position_rad, double velocity_rad_per_s,
                                 int direction)
{
    const double x[STATES] = {position_rad, velocity_rad_per_s};
    const struct moment still = {0.0, 0.0};
    return friction_Nm(spec, x, direction, &still) - field_Nm(spec, position_rad);
}

static double belt_Nm(const struct truth_plant_spec *spec, const double *x)
{
    if (!spec->two_mass) {
        return 0.0;
    }
    double twist = x[MOTOR_POSITION] - x[LOAD_POSITION], half = 0.5 * spec->gap_rad;
    if (half > 0.0 && fabs(twist) <= half) {
        return 0.0;
    }
    double beyond = twist - clipped(twist, half);
    double stiffness = spec->belt_stiffness_Nm_per_rad * (1.0 + spec->stiffness_slope_per_rad * x[MOTOR_POSITION]) *
                       (1.0 + spec->stiffness_cubic_per_rad2 * beyond * beyond);
    return stiffness * beyond + spec->belt_damping_Nms_per_rad * (x[MOTOR_VELOCITY] - x[LOAD_VELOCITY]);
}

// Everything on the motor but friction.
static double drive_Nm(const struct truth_plant *self, const double *x, const struct moment *now)
{
    const struct truth_plant_spec *spec = &self->spec;
    double torque = output_Nm(spec, now->lagged_Nm);
    double real = torque * (1.0 - spec->torque_saturation_per_Nm2 * torque * torque) *
                  risen(spec->torque_drift_ratio, spec->torque_drift_s, now->time_s);
    return real + self->noise_Nm + disturbance_Nm(self, now->time_s) + field_Nm(spec, x[MOTOR_POSITION]) -
           belt_Nm(spec, x);
}

static void derive_load(const struct truth_plant_spec *spec, const double *x, double *out)
{
    double third = 0.0, dry = 0.0;
    out[LOAD_POSITION] = x[LOAD_VELOCITY];
    if (spec->third_inertia_kgm2 > 0.0) {
        third = spec->third_stiffness_Nm_per_rad * (x[LOAD_POSITION] - x[THIRD_POSITION]) +
                spec->third_damping_Nms_per_rad * (x[LOAD_VELOCITY] - x[THIRD_VELOCITY]);
        out[THIRD_POSITION] = x[THIRD_VELOCITY];
        out[THIRD_VELOCITY] = third / spec->third_inertia_kgm2;
    }
    if (spec->load_coulomb_Nm != 0.0) {
        dry = spec->load_coulomb_Nm * x[LOAD_BRISTLE];
        out[LOAD_BRISTLE] = (x[LOAD_VELOCITY] - fabs(x[LOAD_VELOCITY]) * x[LOAD_BRISTLE]) / TRUTH_LOAD_BRISTLE_RAD;
    }
    out[LOAD_VELOCITY] = (belt_Nm(spec, x) - third - dry) / spec->load_inertia_kgm2;
}

static void derive(const struct truth_plant *self, const double *x, const struct moment *now, double *out)
{
    const struct truth_plant_spec *spec = &self->spec;
    for (int i = 0; i < STATES; i++) {
        out[i] = 0.0;
    }
    if (self->direction) {
        double inertia = spec->motor_inertia_kgm2 + (spec->two_mass ? 0.0 : spec->load_inertia_kgm2);
        double net = drive_Nm(self, x, now) - friction_Nm(spec, x, self->direction, now);
        out[MOTOR_POSITION] = x[MOTOR_VELOCITY];
        out[MOTOR_VELOCITY] = net / inertia;
        if (spec->presliding_distance_rad > 0.0) {
            out[BRISTLE] = bristle_rate(spec, x[BRISTLE], x[MOTOR_VELOCITY]);
        }
    }
    if (spec->two_mass) {
        derive_load(spec, x, out);
    }
}

static void get_state(const struct truth_plant *self, double *out)
{
    const double x[STATES] = {self->position_rad,
                              self->velocity_rad_per_s,
                              self->load_position_rad,
                              self->load_velocity_rad_per_s,
                              self->third_position_rad,
                              self->third_velocity_rad_per_s,
                              self->bristle,
                              self->load_bristle};
    for (int i = 0; i < STATES; i++) {
        out[i] = x[i];
    }
}

static double lagged_Nm(const struct truth_plant *self, double target, double after_s)
{
    if (!(self->spec.torque_lag_s > 0.0)) {
        return target;
    }
    return target + (self->torque_Nm - target) * exp(-after_s / self->spec.torque_lag_s);
}

static struct moment moment_after(const struct truth_plant *self, double target, double after_s)
{
    return (struct moment){lagged_Nm(self, target, after_s), self->time_s + after_s};
}

// One classical Runge-Kutta step of any length from the present state; the actuator's lag is known exactly in it.
static struct state try_step(const struct truth_plant *self, double target, double h)
{
    const struct moment at_time[3] = {moment_after(self, target, 0.0), moment_after(self, target, 0.5 * h),
                                      moment_after(self, target, h)};
    static const int when[4] = {0, 1, 1, 2};
    static const double reach[4] = {0.0, 0.5, 0.5, 1.0};
    static const double weight[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
    double start[STATES], slope[STATES] = {0};
    struct state end;
    get_state(self, start);
    get_state(self, end.x);
    for (int stage = 0; stage < 4; stage++) {
        double at[STATES];
        for (int i = 0; i < STATES; i++) {
            at[i] = start[i] + reach[stage] * h * slope[i];
        }
        derive(self, at, &at_time[when[stage]], slope);
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
static double margin(const struct truth_plant *self, const double *x, const struct moment *now)
{
    if (self->direction) {
        return (double)self->direction * x[MOTOR_VELOCITY];
    }
    double push = drive_Nm(self, x, now), still[STATES];
    for (int i = 0; i < STATES; i++) {
        still[i] = i == MOTOR_VELOCITY ? 0.0 : x[i];
    }
    return fabs(friction_Nm(&self->spec, still, push_direction(push), now)) - fabs(push);
}

// Length of the step to the mode's end, which lies within h: regula falsi with the Illinois rule.
static double locate_end(const struct truth_plant *self, double target, double h, double at_start, double at_end)
{
    double lo = 0.0, hi = h, g_lo = at_start, g_hi = at_end;
    for (int i = 0; i < LOCATE_STEPS && hi - lo > 1e-12 * h; i++) {
        double mid = g_lo > 0.0 ? lo + (hi - lo) * g_lo / (g_lo - g_hi) : 0.5 * (lo + hi);
        struct state end = try_step(self, target, mid);
        const struct moment now = moment_after(self, target, mid);
        double g = margin(self, end.x, &now);
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

static void accept(struct truth_plant *self, const struct state *end, const struct moment *now)
{
    self->position_rad = end->x[MOTOR_POSITION];
    self->velocity_rad_per_s = end->x[MOTOR_VELOCITY];
    self->load_position_rad = self->spec.two_mass ? end->x[LOAD_POSITION] : self->position_rad;
    self->load_velocity_rad_per_s = self->spec.two_mass ? end->x[LOAD_VELOCITY] : self->velocity_rad_per_s;
    self->third_position_rad = end->x[THIRD_POSITION];
    self->third_velocity_rad_per_s = end->x[THIRD_VELOCITY];
    self->bristle = end->x[BRISTLE];
    self->load_bristle = end->x[LOAD_BRISTLE];
    self->torque_Nm = now->lagged_Nm;
    self->time_s = now->time_s;
}

// At zero speed: stick, or slip the way the torque pushes. A stuck motor's speed is zero to the last bit.
static void choose_mode(struct truth_plant *self)
{
    double x[STATES];
    self->velocity_rad_per_s = 0.0;
    if (!self->spec.two_mass) {
        self->load_velocity_rad_per_s = 0.0;
    }
    get_state(self, x);
    const struct moment now = {self->torque_Nm, self->time_s};
    self->direction = 0;
    if (margin(self, x, &now) < 0.0) {
        self->direction = push_direction(drive_Nm(self, x, &now));
    }
}

static void integrate(struct truth_plant *self, double target, double h)
{
    self->torque_Nm = lagged_Nm(self, target, 0.0);
    for (int event = 0; h > 0.0; event++) {
        struct moment now = {self->torque_Nm, self->time_s}, after = moment_after(self, target, h);
        if (self->spec.presliding_distance_rad > 0.0) { // a bristle never sticks
            self->direction = 1;
            struct state end = try_step(self, target, h);
            accept(self, &end, &after);
            return;
        }
        if (self->velocity_rad_per_s == 0.0) {
            choose_mode(self);
        }
        double x[STATES];
        get_state(self, x);
        double at_start = margin(self, x, &now);
        struct state end = try_step(self, target, h);
        double at_end = margin(self, end.x, &after);
        if (!(at_end < 0.0) || event >= EVENTS_PER_STEP) {
            accept(self, &end, &after);
            return;
        }
        double part = locate_end(self, target, h, at_start, at_end);
        end = try_step(self, target, part);
        after = moment_after(self, target, part);
        accept(self, &end, &after);
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
    *self = (struct truth_plant){.spec = *spec,
                                 .position_rad = position_rad,
                                 .load_position_rad = position_rad,
                                 .third_position_rad = position_rad};
    truth_random_init(&self->random, seed, 77u);
    struct truth_random when;
    truth_random_init(&when, seed, 78u);
    for (int i = 0; i < TRUTH_PLANT_BURSTS; i++) {
        double free_s = fmax(0.0, spec->burst_every_s - spec->burst_length_s);
        self->burst_s[i] = (double)i * spec->burst_every_s + truth_random_uniform(&when, 0.0, 1.0) * free_s;
    }
}

void truth_plant_launch(struct truth_plant *self, double velocity_rad_per_s)
{
    truth_plant_place(self, self->position_rad, velocity_rad_per_s);
    self->load_velocity_rad_per_s = self->third_velocity_rad_per_s = velocity_rad_per_s;
}

void truth_plant_place(struct truth_plant *self, double position_rad, double velocity_rad_per_s)
{
    self->position_rad = position_rad;
    self->velocity_rad_per_s = velocity_rad_per_s;
    self->direction = velocity_rad_per_s > 0.0 ? 1 : velocity_rad_per_s < 0.0 ? -1 : 0;
    if (!self->spec.two_mass) {
        self->load_position_rad = position_rad;
        self->load_velocity_rad_per_s = velocity_rad_per_s;
    }
}

double truth_plant_output_Nm(const struct truth_plant *self)
{
    return output_Nm(&self->spec, self->torque_Nm);
}

void truth_plant_hold(struct truth_plant *self, double torque_ref_Nm)
{
    const struct truth_plant_spec *spec = &self->spec;
    double asked = spec->command_limit_Nm > 0.0 ? clipped(torque_ref_Nm, spec->command_limit_Nm) : torque_ref_Nm;
    if (spec->torque_rate_Nm_per_s > 0.0) {
        asked = self->asked_Nm + clipped(asked - self->asked_Nm, spec->torque_rate_Nm_per_s * spec->sample_s);
    }
    self->asked_Nm = asked;
    for (int i = TRUTH_PLANT_HISTORY - 1; i > 0; i--) {
        self->history_Nm[i] = self->history_Nm[i - 1];
    }
    self->history_Nm[0] = asked;
    if (!(spec->torque_lag_s > 0.0)) {
        int whole = whole_delay(spec);
        double rest = spec->dead_time_s - (double)whole * spec->sample_s;
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
