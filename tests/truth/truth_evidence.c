/* SPDX-License-Identifier: MIT */
#include "tests/truth/truth_evidence.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925286766559;
enum { LINES = TRUTH_EVIDENCE_LINES, VALUES = TRUTH_EVIDENCE_VALUES, N = TRUTH_PERIOD_SAMPLES };
enum { MECHANICS, ACTUATOR, ANGLE, SPEED, SERIES };

// One period of what is off, per sample: torque on the motor, torque of the actuator, angle, speed.
struct off {
    double series[SERIES][N];
};

// Standard deviations by line that whiten the three channels, and the weights of the measured motion.
struct noise {
    double mechanics[LINES + 1], actuator, consistency[LINES + 1];
    double complex impedance[LINES + 1];
    double speed_weight[LINES + 1];
};

static double complex impedance(const struct truth_plant_spec *plant, double w)
{
    double complex s = I * w;
    if (!plant->two_mass) {
        return s * (plant->motor_inertia_kgm2 + plant->load_inertia_kgm2);
    }
    double complex load = s * plant->load_inertia_kgm2;
    double complex link = plant->belt_stiffness_Nm_per_rad / s + plant->belt_damping_Nms_per_rad;
    return s * plant->motor_inertia_kgm2 + link * load / (link + load);
}

static void find_noise(const struct truth_drive *truth, struct noise *out)
{
    const struct truth_sensors *sensors = &truth->sensors;
    double count = sensors->counts_per_rev > 0.0 ? two_pi / sensors->counts_per_rev : 0.0;
    double angle = pow(sensors->position_rad, 2.0) + count * count / 12.0,
           speed = pow(sensors->velocity_rad_per_s, 2.0);
    out->actuator = sensors->torque_Nm;
    for (int k = 0; k <= LINES; k++) {
        // Line 0 has a mean torque too; its noise is that of the lowest line.
        double w = two_pi * (double)(k ? k : 1) * TRUTH_RATE_HZ / N;
        double of_angle = w * w * angle;
        out->impedance[k] = impedance(&truth->plant, w);
        out->speed_weight[k] = of_angle / (of_angle + speed);
        double combined = out->speed_weight[k] * speed;
        out->mechanics[k] =
            sqrt(pow(truth->plant.process_noise_Nm, 2.0) + pow(cabs(out->impedance[k]), 2.0) * combined);
        out->consistency[k] = sqrt(speed + of_angle);
    }
}

static int is_zero(const double *series)
{
    int n = 0;
    while (n < N && series[n] == 0.0) {
        n++;
    }
    return n == N;
}

static double complex line(const double *series, int k)
{
    static const double step = 6.283185307179586476925286766559 / N;
    double complex turn = cexp(-I * step * k), at = 1.0, sum = 0.0;
    for (int n = 0; n < N; n++) {
        sum += series[n] * at;
        at *= turn;
    }
    return sum;
}

// Whitened lines, so that half the sum of squares is the log-likelihood ratio of one period.
static void whiten(const struct off *off, const struct noise *noise, double *out)
{
    int still = is_zero(off->series[SPEED]) && is_zero(off->series[ANGLE]), asked = !is_zero(off->series[ACTUATOR]);
    for (int k = 0; k <= LINES; k++) {
        double w = two_pi * (double)k * TRUTH_RATE_HZ / N;
        double scale = (k ? sqrt(2.0) : 1.0) / sqrt((double)N);
        double complex speed = still ? 0.0 : line(off->series[SPEED], k);
        double complex rate = still ? 0.0 : I * w * line(off->series[ANGLE], k);
        double complex motion = noise->speed_weight[k] * speed + (1.0 - noise->speed_weight[k]) * rate;
        const double complex channel[3] = {
            (line(off->series[MECHANICS], k) + noise->impedance[k] * motion) / noise->mechanics[k],
            asked ? line(off->series[ACTUATOR], k) / noise->actuator : 0.0, (speed - rate) / noise->consistency[k]};
        for (int i = 0; i < 3; i++) {
            out[6 * k + 2 * i] = scale * creal(channel[i]);
            out[6 * k + 2 * i + 1] = scale * cimag(channel[i]);
        }
    }
}

static double dot(const double *a, const double *b)
{
    double sum = 0.0;
    for (int i = 0; i < VALUES; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

static double *refit_value(struct truth_plant_spec *plant, enum truth_refit which)
{
    double *const values[truth_refit_count] = {&plant->motor_inertia_kgm2,
                                               &plant->load_inertia_kgm2,
                                               &plant->viscous_friction_Nms_per_rad,
                                               &plant->coulomb_friction_Nm,
                                               &plant->torque_lag_s,
                                               &plant->dead_time_s,
                                               &plant->belt_stiffness_Nm_per_rad,
                                               &plant->belt_damping_Nms_per_rad};
    return values[which];
}

// What `other` is off, on period `period` of the run; its hidden states have run through the periods before.
struct follower {
    struct truth_plant plant;
    double scale; ///< inertia that turns a speed into torque
    int n;
};

// Starts a follower and takes it through the first period. A load swings for most of a second; without one the
// actuator's few milliseconds are all there is to settle.
static void follow_into(struct follower *self, const struct truth_plant_spec *plant, const struct truth_run *run,
                        uint64_t seed)
{
    const int settling = 50;
    self->scale = (plant->motor_inertia_kgm2 + (plant->two_mass ? 0.0 : plant->load_inertia_kgm2)) * TRUTH_RATE_HZ;
    self->n = plant->two_mass ? 0 : N - settling;
    truth_plant_init(&self->plant, plant, run->true_position_rad[self->n], seed);
    self->plant.time_s = (double)self->n / TRUTH_RATE_HZ;
    for (; self->n < N; self->n++) {
        truth_plant_place(&self->plant, run->true_position_rad[self->n], run->true_velocity_rad_per_s[self->n]);
        truth_plant_hold(&self->plant, run->torque_ref_Nm[self->n]);
        truth_plant_advance(&self->plant);
    }
}

static void follow_period(struct follower *self, const struct truth_run *run, struct off *out)
{
    for (int i = 0; i < N; i++, self->n++) {
        int n = self->n, next = n + 1 < run->samples ? n + 1 : n;
        truth_plant_place(&self->plant, run->true_position_rad[n], run->true_velocity_rad_per_s[n]);
        truth_plant_hold(&self->plant, run->torque_ref_Nm[n]);
        out->series[ACTUATOR][i] = run->true_torque_Nm[n] - truth_plant_output_Nm(&self->plant);
        truth_plant_advance(&self->plant);
        double missed = run->true_velocity_rad_per_s[next] - self->plant.velocity_rad_per_s;
        out->series[MECHANICS][i] = next > n ? self->scale * missed : 0.0;
        out->series[ANGLE][i] = run->position_rad[n] - run->true_position_rad[n];
        out->series[SPEED][i] = run->velocity_rad_per_s[n] - run->true_velocity_rad_per_s[n];
    }
}

// Takes out of `io` what lies along the first `count` directions and gives it length one; returns the length it had
// then, 0 when nothing was left. parts: what it had of each direction, itself included.
static double make_direction(double basis[][VALUES], int count, double *io, double *parts)
{
    const double nothing = 1e-6;
    double before = sqrt(dot(io, io));
    for (int k = 0; k < count; k++) {
        parts[k] = dot(basis[k], io);
        for (int i = 0; i < VALUES; i++) {
            io[i] -= parts[k] * basis[k][i];
        }
    }
    double length = parts[count] = sqrt(dot(io, io));
    for (int i = 0; i < VALUES && length > 0.0; i++) {
        io[i] /= length;
    }
    return length > nothing * before ? length : 0.0;
}

static void follow_second(const struct truth_plant_spec *plant, const struct truth_run *run, uint64_t seed,
                          const struct noise *noise, struct off *off, double *out)
{
    struct follower follower;
    follow_into(&follower, plant, run, seed);
    follow_period(&follower, run, off);
    // Sensors are no matter of the plant.
    memset(off->series[ANGLE], 0, sizeof off->series[ANGLE]);
    memset(off->series[SPEED], 0, sizeof off->series[SPEED]);
    whiten(off, noise, out);
}

// How the residual changes with one value of the other model, per relative change by one; 0 where there is none.
static int change_by(const struct truth_plant_spec *other, enum truth_refit which, const struct truth_run *run,
                     uint64_t seed, const struct noise *noise, struct off *off, const double *base, double *out)
{
    const double step = 0.01;
    struct truth_plant_spec moved = *other;
    double *value = refit_value(&moved, which);
    if (*value == 0.0) {
        return 0;
    }
    *value *= 1.0 + step;
    follow_second(&moved, run, seed, noise, off, out);
    for (int i = 0; i < VALUES; i++) {
        out[i] = (out[i] - base[i]) / step;
    }
    return 1;
}

static void add_direction(int which, const double *parts, int count, struct truth_evidence *out)
{
    for (int k = 0; k <= count; k++) {
        out->made_of[k][which] = parts[k];
    }
    out->which[count] = which;
}

// The relative changes of the numbers that take `along` out of the residual.
static void find_moves(const double *along, struct truth_evidence *io)
{
    memset(io->move, 0, sizeof io->move);
    for (int k = io->refits; k-- > 0;) {
        double rest = -along[k];
        for (int later = k + 1; later < io->refits; later++) {
            rest -= io->made_of[k][io->which[later]] * io->move[io->which[later]];
        }
        io->move[io->which[k]] = rest / io->made_of[k][io->which[k]];
    }
}

// Orthonormal basis of what the refit can do, on the second period. The direction of what stands in for the effect is
// taken anew each time: it makes nearly the same residual, and what is left of that goes by the angle between the two.
static void find_basis(const struct truth_plant_spec *other, const struct truth_run *run,
                       const struct truth_evidence_setting *setting, const struct noise *noise, struct off *off,
                       struct truth_evidence *out)
{
    double base[VALUES], parts[truth_refit_count + 1];
    int count = 0, keep = setting->keep_basis, stands_in = setting->reach > 0.0;
    if (!keep || stands_in) {
        follow_second(other, run, setting->seed, noise, off, base);
    }
    for (int which = 0; !keep && which < truth_refit_count; which++) {
        if (!(setting->not_free >> which & 1u) &&
            change_by(other, (enum truth_refit)which, run, setting->seed, noise, off, base, out->refit[count])) {
            if (make_direction(out->refit, count, out->refit[count], parts) > 0.0) {
                add_direction(which, parts, count++, out);
            }
        }
    }
    out->refits = keep ? out->refits : count;
    out->stand_in_size = 0.0;
    if (stands_in && change_by(other, setting->stand_in, run, setting->seed, noise, off, base, out->stand_in)) {
        out->stand_in_size = make_direction(out->refit, out->refits, out->stand_in, parts);
    }
}

// Take from the residual what the refit can explain of it.
static void take_refit(const struct truth_evidence_setting *setting, int looked_at, struct truth_evidence *io)
{
    double all[truth_refit_count + 1];
    for (int k = 0; k <= io->refits; k++) {
        const double *direction = k < io->refits ? io->refit[k] : io->stand_in;
        double along = k < io->refits || io->stand_in_size > 0.0 ? dot(direction, io->residual) : 0.0, taken = along;
        all[k] = along;
        if (k == io->refits) {
            double most = setting->reach * io->stand_in_size;
            taken = fmax(-most, fmin(most, along));
        }
        io->nats -= 0.5 * looked_at * taken * (2.0 * along - taken);
        for (int i = 0; i < VALUES && taken != 0.0; i++) {
            io->residual[i] -= taken * direction[i];
        }
    }
    find_moves(all, io);
}

static double torque_share(const struct off *off, const struct truth_run *run, int first)
{
    double wrong = 0.0, torque = 0.0;
    for (int n = 0; n < N; n++) {
        wrong += pow(off->series[MECHANICS][n], 2.0) + pow(off->series[ACTUATOR][n], 2.0);
        torque += pow(run->true_torque_Nm[first + n], 2.0);
    }
    return sqrt(wrong / torque);
}

// Sum over the periods; the refit sees their mean.
static void sum_up(const struct truth_plant_spec *other, const struct truth_run *run,
                   const struct truth_evidence_setting *setting, const struct noise *noise, struct off *off,
                   struct truth_evidence *out)
{
    int looked_at = run->periods - 1;
    double one[VALUES];
    struct follower follower;
    follow_into(&follower, other, run, setting->seed);
    out->nats = out->share = 0.0;
    memset(out->residual, 0, sizeof out->residual);
    for (int p = 0; p < looked_at; p++) {
        follow_period(&follower, run, off);
        whiten(off, noise, one);
        out->nats += 0.5 * dot(one, one);
        out->share += torque_share(off, run, (p + 1) * N) / looked_at;
        for (int i = 0; i < VALUES; i++) {
            out->residual[i] += one[i] / looked_at;
        }
    }
}

int truth_evidence_find(const struct truth_drive *truth, const struct truth_drive *other,
                        const struct truth_evidence_setting *setting, struct truth_evidence *out)
{
    struct truth_drive quiet = *truth;
    struct truth_plant_spec plant = other->plant;
    quiet.plant.process_noise_Nm = plant.process_noise_Nm = 0.0;
    quiet.sensors.position_rad = quiet.sensors.velocity_rad_per_s = quiet.sensors.torque_Nm = 0.0;
    quiet.sensors.counts_per_rev = quiet.sensors.lost_share = 0.0;
    // What matters is the difference of two plants with the same steps: three times the case's own are short enough.
    quiet.plant.step_s = plant.step_s = 3.0 * fmin(truth->plant.step_s, other->plant.step_s);
    struct truth_run run;
    struct noise *noise = malloc(sizeof *noise);
    struct off *off = malloc(sizeof *off);
    int status = !noise || !off ? -1 : 0;
    status |= truth_run_make(&run, &quiet.plant, setting->controller, &quiet.sensors, setting->excitation,
                             setting->aperiodic ? setting->periods : 2, setting->seed);
    if (!status) {
        find_noise(truth, noise);
        sum_up(&plant, &run, setting, noise, off, out);
        find_basis(&plant, &run, setting, noise, off, out);
        int looked_at = run.periods - 1;
        take_refit(setting, looked_at, out);
        out->nats *= (double)(setting->periods - 1) / looked_at;
    }
    truth_run_free(&run);
    free(noise);
    free(off);
    return status;
}

// Takes part of the moves, each number within what `believed` may be off by.
static void move_refit(const struct truth_plant_spec *from, const double *move, double part,
                       const struct truth_plant_spec *believed, struct truth_plant_spec *out)
{
    const double most[truth_refit_count] = {0.02, 0.05, 0.10, 0.10, 0.10, 0.10, 0.08, 0.90};
    struct truth_plant_spec first = *believed;
    *out = *from;
    for (int which = 0; which < truth_refit_count; which++) {
        double *value = refit_value(out, (enum truth_refit)which);
        double middle = *refit_value(&first, (enum truth_refit)which);
        *value *= 1.0 + part * move[which];
        *value = fmin(fmax(*value, (1.0 - most[which]) * middle), (1.0 + most[which]) * middle);
    }
}

int truth_evidence_refit(const struct truth_drive *truth, const struct truth_plant_spec *believed,
                         struct truth_drive *io_other, const struct truth_evidence_setting *setting,
                         struct truth_evidence *out)
{
    const int steps = 12;
    const double settled = 0.01, shortest = 0.1;
    struct truth_evidence *next = malloc(sizeof *next);
    int status = !next || truth_evidence_find(truth, io_other, setting, out) ? -1 : 0;
    double part = 1.0;
    for (int i = 0; i < steps && !status && part > shortest; i++) {
        struct truth_drive moved = *io_other;
        move_refit(&io_other->plant, out->move, part, believed, &moved.plant);
        status = truth_evidence_find(truth, &moved, setting, next);
        if (status || !(next->nats < out->nats)) {
            part *= 0.5;
            continue;
        }
        int enough = out->nats - next->nats < settled * out->nats;
        *io_other = moved;
        *out = *next;
        part = enough ? 0.0 : fmin(1.0, 2.0 * part);
    }
    free(next);
    return status;
}

double truth_evidence_of_loss_nats(const struct truth_sensors *sensors, double rows)
{
    // Resolutions of the columns in the file; an angle repeats itself to the count.
    const double speed = 1e-6, torque = 1e-6;
    double nats = log(fmax(1.0, sensors->velocity_rad_per_s / speed)) + log(fmax(1.0, sensors->torque_Nm / torque));
    return rows * (nats + 1.0);
}

double truth_evidence_likeness(const struct truth_evidence *a, const struct truth_evidence *b)
{
    double lengths = sqrt(dot(a->residual, a->residual) * dot(b->residual, b->residual));
    return lengths > 0.0 ? dot(a->residual, b->residual) / lengths : 0.0;
}
