/* SPDX-License-Identifier: MIT */
#include "tests/truth/truth_run.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>

static const double two_pi = 6.283185307179586476925286766559;
static const double sensitivity_max = 1.9;
static const double mean_loss = 2.5; // rows of a loss of 1 to LONGEST_LOSS
enum { LONGEST_LOSS = 4 };

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
                          &self->velocity_rad_per_s, &self->true_position_rad, &self->true_velocity_rad_per_s,
                          &self->true_torque_Nm};
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

struct seen {
    double position_rad, velocity_rad_per_s; ///< behind the filter
    double raw_position_rad, raw_velocity_rad_per_s;
    struct truth_random noise, loss;
};

// The filter's exact answer to an input that is straight between samples.
static double filtered(double before, double raw_before, double raw, double filter_s)
{
    if (!(filter_s > 0.0)) {
        return raw;
    }
    double sample = 1.0 / TRUTH_RATE_HZ, slope = (raw - raw_before) / sample, left = exp(-sample / filter_s);
    return raw - slope * filter_s + (before - raw_before + slope * filter_s) * left;
}

static void look(struct seen *self, const struct truth_sensors *sensors, const struct truth_plant *drive, int first)
{
    double angle = drive->position_rad + sensors->eccentricity_phase_rad;
    double raw_position = drive->position_rad + sensors->eccentricity_rad * cos(angle);
    double raw_velocity = drive->velocity_rad_per_s;
    if (sensors->speed_from_encoder) {
        raw_velocity *= 1.0 - sensors->eccentricity_rad * sin(angle);
    }
    if (first) {
        self->position_rad = self->raw_position_rad = raw_position;
        self->velocity_rad_per_s = self->raw_velocity_rad_per_s = raw_velocity;
    }
    self->position_rad = filtered(self->position_rad, self->raw_position_rad, raw_position, sensors->filter_s);
    self->velocity_rad_per_s =
        filtered(self->velocity_rad_per_s, self->raw_velocity_rad_per_s, raw_velocity, sensors->filter_s);
    self->raw_position_rad = raw_position;
    self->raw_velocity_rad_per_s = raw_velocity;
}

static double rounded(double angle, double counts_per_rev)
{
    double count = counts_per_rev > 0.0 ? two_pi / counts_per_rev : 0.0;
    return count > 0.0 ? count * floor(angle / count + 0.5) : angle;
}

static void write_row(struct truth_run *self, int n, const struct truth_sensors *sensors, struct seen *seen,
                      const struct truth_plant *drive)
{
    self->torque_Nm[n] = truth_plant_output_Nm(drive) + sensors->torque_Nm * truth_random_normal(&seen->noise);
    self->true_position_rad[n] = drive->position_rad;
    self->true_velocity_rad_per_s[n] = drive->velocity_rad_per_s;
    self->true_torque_Nm[n] = truth_plant_output_Nm(drive);
}

// Rows are lost in runs of one to four.
static void lose_rows(struct truth_run *self, const struct truth_sensors *sensors, struct truth_random *random)
{
    for (int n = 1; n < self->samples; n++) {
        if (truth_random_uniform(random, 0.0, 1.0) >= sensors->lost_share / mean_loss) {
            continue;
        }
        for (int more = truth_random_integer(random, 1, LONGEST_LOSS); more > 0 && n < self->samples; more--, n++) {
            self->torque_Nm[n] = self->torque_Nm[n - 1];
            self->position_rad[n] = self->position_rad[n - 1];
            self->velocity_rad_per_s[n] = self->velocity_rad_per_s[n - 1];
            self->lost++;
        }
    }
}

int truth_run_make(struct truth_run *self, const struct truth_plant_spec *plant,
                   const struct truth_controller *controller, const struct truth_sensors *sensors,
                   const struct truth_excitation *excitation, int periods, uint64_t seed)
{
    *self = (struct truth_run){.samples = periods * TRUTH_PERIOD_SAMPLES, .periods = periods};
    if (allocate(self, self->samples)) {
        return -1;
    }
    struct seen seen = {0};
    truth_random_init(&seen.noise, seed, 5u);
    truth_random_init(&seen.loss, seed, 6u);
    struct truth_plant drive;
    truth_plant_init(&drive, plant, excitation->position_rad[0], seed);
    struct loop loop = {.controller = controller, .excitation = excitation};
    for (int n = 0; n < self->samples; n++) {
        look(&seen, sensors, &drive, n == 0);
        double angle = seen.position_rad + sensors->position_rad * truth_random_normal(&seen.noise);
        self->position_rad[n] = rounded(angle, sensors->counts_per_rev);
        self->velocity_rad_per_s[n] =
            seen.velocity_rad_per_s + sensors->velocity_rad_per_s * truth_random_normal(&seen.noise);
        self->torque_ref_Nm[n] = command_Nm(&loop, n, self->position_rad[n], self->velocity_rad_per_s[n]);
        truth_plant_hold(&drive, self->torque_ref_Nm[n]);
        write_row(self, n, sensors, &seen, &drive);
        if (!(fabs(drive.position_rad - excitation->position_rad[n % TRUTH_PERIOD_SAMPLES]) < 1.0)) {
            return -1;
        }
        truth_plant_advance(&drive);
    }
    if (sensors->lost_share > 0.0) {
        lose_rows(self, sensors, &seen.loss);
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
    free(self->true_torque_Nm);
    *self = (struct truth_run){0};
}
