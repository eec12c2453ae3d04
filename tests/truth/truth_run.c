/* SPDX-License-Identifier: MIT */
#include "tests/truth/truth_run.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>

static const double two_pi = 6.283185307179586476925286766559;
static const double sensitivity_max = 1.9;

// Speed over torque of the frictionless body or bodies.
static double complex mobility(const struct truth_plant_spec *plant, double complex s)
{
    if (!plant->two_mass) {
        return 1.0 / (s * (plant->motor_inertia_kgm2 + plant->load_inertia_kgm2));
    }
    double complex link = plant->belt_stiffness_Nm_per_rad / s + plant->belt_damping_Nms_per_rad;
    double complex load = s * plant->load_inertia_kgm2;
    return 1.0 / (s * plant->motor_inertia_kgm2 + link * load / (link + load));
}

static double peak_sensitivity(const struct truth_controller *self, const struct truth_plant_spec *plant)
{
    double delay = plant->dead_time_s + plant->sample_s * (0.5 + self->late_samples);
    double peak = 0.0;
    for (double w = 2.0; w < two_pi * 500.0; w *= 1.004) {
        double complex s = I * w;
        double complex loop = self->velocity_gain_Nms_per_rad * (1.0 + self->integral_rate_per_s / s) *
                              (1.0 + self->position_gain_per_s / s) * mobility(plant, s) * cexp(-s * delay) /
                              (1.0 + s * plant->torque_lag_s);
        peak = fmax(peak, 1.0 / cabs(1.0 + loop));
    }
    return peak;
}

static struct truth_controller scaled_controller(const struct truth_controller *self, double bandwidth,
                                                 double position_gain, double inertia)
{
    struct truth_controller made = *self;
    made.velocity_gain_Nms_per_rad = bandwidth * inertia;
    made.position_gain_per_s = fmin(position_gain, 0.4 * bandwidth);
    made.integral_rate_per_s = 0.1 * bandwidth;
    return made;
}

void truth_controller_tune(struct truth_controller *self, const struct truth_plant_spec *plant,
                           double position_gain_per_s)
{
    double inertia = plant->motor_inertia_kgm2 + plant->load_inertia_kgm2;
    struct truth_controller best = scaled_controller(self, 10.0, position_gain_per_s, inertia);
    // The loop is stable at the lowest gain, and the peak would go through infinity on the way to an unstable one.
    for (double bandwidth = 10.0; bandwidth <= 200.0; bandwidth *= 1.03) {
        struct truth_controller next = scaled_controller(self, bandwidth, position_gain_per_s, inertia);
        if (!(peak_sensitivity(&next, plant) < sensitivity_max)) {
            break;
        }
        best = next;
    }
    *self = best;
}

static int allocate(struct truth_run *self, int samples)
{
    double **columns[] = {&self->torque_ref_Nm,      &self->torque_Nm,         &self->position_rad,
                          &self->velocity_rad_per_s, &self->true_position_rad, &self->true_velocity_rad_per_s};
    int missing = 0;
    for (size_t i = 0; i < sizeof columns / sizeof columns[0]; i++) {
        *columns[i] = malloc((size_t)samples * sizeof(double));
        missing |= *columns[i] == NULL;
    }
    return missing;
}

struct loop {
    const struct truth_controller *controller;
    const struct truth_excitation *excitation;
    double integral_rad;
    double waiting_Nm; ///< computed, to be held one sample later
};

static double command_Nm(struct loop *self, int n, double position, double velocity)
{
    const struct truth_controller *gain = self->controller;
    int at = n % TRUTH_PERIOD_SAMPLES;
    double error = self->excitation->velocity_rad_per_s[at] - velocity +
                   gain->position_gain_per_s * (self->excitation->position_rad[at] - position);
    double torque = gain->inertia_kgm2 * self->excitation->acceleration_rad_per_s2[at] +
                    gain->velocity_gain_Nms_per_rad * (error + gain->integral_rate_per_s * self->integral_rad);
    self->integral_rad += error / TRUTH_RATE_HZ;
    double held = gain->late_samples ? self->waiting_Nm : torque;
    self->waiting_Nm = torque;
    return held;
}

int truth_run_make(struct truth_run *self, const struct truth_plant_spec *plant,
                   const struct truth_controller *controller, const struct truth_sensors *sensors,
                   const struct truth_excitation *excitation, int periods, uint64_t seed)
{
    *self = (struct truth_run){.samples = periods * TRUTH_PERIOD_SAMPLES, .periods = periods};
    if (allocate(self, self->samples)) {
        return -1;
    }
    struct truth_random noise;
    truth_random_init(&noise, seed, 5u);
    struct truth_plant drive;
    truth_plant_init(&drive, plant, excitation->position_rad[0], seed);
    struct loop loop = {.controller = controller, .excitation = excitation};
    double count = two_pi / sensors->counts_per_rev;
    for (int n = 0; n < self->samples; n++) {
        double angle = drive.position_rad + sensors->position_rad * truth_random_normal(&noise);
        self->position_rad[n] = count * floor(angle / count + 0.5);
        self->velocity_rad_per_s[n] =
            drive.velocity_rad_per_s + sensors->velocity_rad_per_s * truth_random_normal(&noise);
        self->torque_ref_Nm[n] = command_Nm(&loop, n, self->position_rad[n], self->velocity_rad_per_s[n]);
        truth_plant_hold(&drive, self->torque_ref_Nm[n]);
        self->torque_Nm[n] = drive.torque_Nm + sensors->torque_Nm * truth_random_normal(&noise);
        self->true_position_rad[n] = drive.position_rad;
        self->true_velocity_rad_per_s[n] = drive.velocity_rad_per_s;
        if (!(fabs(drive.position_rad - excitation->position_rad[n % TRUTH_PERIOD_SAMPLES]) < 1.0)) {
            return -1;
        }
        truth_plant_advance(&drive);
    }
    return 0;
}

int truth_run_write(const struct truth_run *self, FILE *file)
{
    fprintf(file, "# sample_rate_hz: %d\n# period_samples: %d\n# periods: %d\n# settle_periods: 1\n# excited_bins: [",
            TRUTH_RATE_HZ, TRUTH_PERIOD_SAMPLES, self->periods - 1);
    for (int k = 1; k <= TRUTH_LINES; k++) {
        fprintf(file, "%s%d", k > 1 ? ", " : "", k);
    }
    fprintf(file, "]\ntime_s,torque_ref_Nm,torque_Nm,position_rad,velocity_rad_per_s\n");
    for (int n = 0; n < self->samples; n++) {
        fprintf(file, "%.3f,%.9g,%.6f,%.9g,%.6f\n", (double)n / TRUTH_RATE_HZ, self->torque_ref_Nm[n],
                self->torque_Nm[n], self->position_rad[n], self->velocity_rad_per_s[n]);
    }
    return ferror(file) ? -1 : 0;
}

void truth_run_free(struct truth_run *self)
{
    free(self->torque_ref_Nm);
    free(self->torque_Nm);
    free(self->position_rad);
    free(self->velocity_rad_per_s);
    free(self->true_position_rad);
    free(self->true_velocity_rad_per_s);
    *self = (struct truth_run){0};
}
