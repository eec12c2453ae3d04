/* SPDX-License-Identifier: MIT */
#include "tests/truth/truth_case.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/truth/truth_evidence.h"

static const double two_pi = 6.283185307179586476925286766559;
enum { DRAWS = 40, DRAWS_FREE = 12, SIZE_STEPS = 10 };

static const struct {
    const char *name;
    double nats;
} sizes[truth_size_count] = {{"clear", 1e4}, {"moderate", 1e3}, {"faint", 1e2}};

const char *truth_size_name(enum truth_size size)
{
    return sizes[size].name;
}

enum truth_size truth_size_find(const char *name)
{
    int size = 0;
    while (size < truth_size_count && strcmp(sizes[size].name, name) != 0) {
        size++;
    }
    return (enum truth_size)size;
}

double truth_size_nats(enum truth_size size)
{
    return sizes[size].nats;
}

void truth_wish_name(const struct truth_wish *wish, char *out, int length)
{
    int used = snprintf(out, (size_t)length, "%s", truth_kind_name(wish->causes ? wish->kind[0] : truth_kind_clean));
    for (int i = 1; i < wish->causes && used < length; i++) {
        used += snprintf(out + used, (size_t)(length - used), "+%s", truth_kind_name(wish->kind[i]));
    }
}

int truth_wish_read(struct truth_wish *self, const char *name)
{
    char text[160], *rest = NULL;
    if (strlen(name) >= sizeof text) {
        return -1;
    }
    memcpy(text, name, strlen(name) + 1);
    self->causes = 0;
    for (char *word = strtok_r(text, "+", &rest); word; word = strtok_r(NULL, "+", &rest)) {
        enum truth_kind kind = truth_kind_find(word);
        if (kind == truth_kind_count || self->causes == TRUTH_CAUSES_MAX) {
            return -1;
        }
        for (int i = 0; i < self->causes; i++) {
            if (!truth_kind_goes_with(self->kind[i], kind)) {
                return -1;
            }
        }
        if (kind != truth_kind_clean) {
            self->kind[self->causes++] = kind;
        }
    }
    return 0;
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

// The coarsest encoder whose count is below 1.5 of the noise, so that rounding errors stay white.
static void set_counts(struct truth_sensors *io)
{
    io->counts_per_rev = 65536.0;
    while (two_pi / io->counts_per_rev > 1.5 * io->position_rad) {
        io->counts_per_rev *= 2.0;
    }
}

static void draw_sensors(struct truth_sensors *out, struct truth_random *random)
{
    *out = (struct truth_sensors){
        .position_rad = truth_random_log_uniform(random, 2e-6, 2e-5),
        .velocity_rad_per_s = truth_random_log_uniform(random, 5e-4, 5e-3),
        .torque_Nm = truth_random_log_uniform(random, 1e-3, 1e-2),
    };
    set_counts(out);
}

// One of two levels for the fit, a lower one for the validation; the carriage near the middle or far from it. A stroke
// is more than a turn in both runs.
static void draw_excitations(struct truth_case *self, struct truth_random *random)
{
    int loud = truth_random_integer(random, 0, 1), far = truth_random_integer(random, 0, 2) == 0;
    int stroke = self->protocol == truth_protocol_stroke;
    struct truth_excitation_wish wish = {
        .inertia_kgm2 = self->base.plant.motor_inertia_kgm2 + self->base.plant.load_inertia_kgm2,
        .torque_rms_Nm = loud ? truth_random_uniform(random, 0.45, 0.8) : truth_random_uniform(random, 0.25, 0.45),
        .speed_max_rad_per_s = truth_random_uniform(random, 1.2, 3.0),
        .corner_hz = truth_random_log_uniform(random, 2.0, 15.0),
        .stroke_rad = stroke ? truth_random_uniform(random, 3.2, 4.2) : 0.0,
        .centre_rad = (far ? 4.0 : 0.0) * truth_random_sign(random) + truth_random_uniform(random, -1.5, 1.5),
    };
    truth_excitation_make(&self->fit, &wish, random);
    wish.torque_rms_Nm *= 0.8;
    wish.speed_max_rad_per_s *= 0.8;
    wish.stroke_rad *= 0.985;
    truth_excitation_make(&self->validation, &wish, random);
    self->base.plant.coulomb_origin_rad = wish.centre_rad;
}

// Root mean square of |x|^power.
static double rms_of(const double *column, double offset, double power)
{
    double sum = 0.0;
    for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
        sum += pow(fabs(column[n] - offset), 2.0 * power);
    }
    return sqrt(sum / TRUTH_PERIOD_SAMPLES);
}

static void measure_setting(struct truth_case *self)
{
    const struct truth_plant_spec *plant = &self->base.plant;
    double inertia = plant->motor_inertia_kgm2 + plant->load_inertia_kgm2, peak = 0.0;
    for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
        peak = fmax(peak, inertia * fabs(self->fit.acceleration_rad_per_s2[n]));
    }
    double acceleration = rms_of(self->fit.acceleration_rad_per_s2, 0.0, 1.0);
    double range = fmin(truth_excitation_range_rad(&self->fit), truth_excitation_range_rad(&self->validation));
    self->setting = (struct truth_setting){
        .range_rad = range,
        .centre_rad = plant->coulomb_origin_rad,
        .duration_s = (double)self->periods * TRUTH_PERIOD_SAMPLES / TRUTH_RATE_HZ,
        .torque_rms_Nm = inertia * acceleration,
        .torque_peak_Nm = peak + plant->coulomb_friction_Nm,
        .square_speed_rms = rms_of(self->fit.velocity_rad_per_s, 0.0, 2.0),
        .cube_torque_rms = pow(inertia, 3.0) * rms_of(self->fit.acceleration_rad_per_s2, 0.0, 3.0),
        .away_rms_rad = rms_of(self->fit.position_rad, plant->coulomb_origin_rad, 1.0),
    };
    if (plant->two_mass) {
        self->setting.twist_rms_rad = plant->load_inertia_kgm2 * acceleration / plant->belt_stiffness_Nm_per_rad;
    }
}

struct truth_drive truth_case_drive(const struct truth_case *self, unsigned known)
{
    struct truth_drive drive = self->base;
    for (int i = 0; i < self->wish.causes; i++) {
        truth_kind_apply(&self->hidden[i], &self->setting, (known >> i) & 1u, &drive);
    }
    // A bristle is as fast as the speed over its distance; a contact begins in the middle of a step.
    if (drive.plant.load_coulomb_Nm != 0.0 || drive.plant.gap_rad > 0.0 ||
        (drive.plant.presliding_distance_rad > 0.0 && drive.plant.presliding_distance_rad < 2e-3)) {
        drive.plant.step_s = 10e-6;
    }
    return drive;
}

static unsigned all_known(const struct truth_case *self)
{
    return (1u << self->wish.causes) - 1u;
}

static void compose(struct truth_case *self)
{
    self->truth = truth_case_drive(self, all_known(self));
    self->without = truth_case_drive(self, 0u).plant;
    truth_controller_tune(&self->controller, &self->truth.plant, self->position_gain_per_s);
}

static double off_by(double value, double ratio, struct truth_random *random)
{
    return value * (1.0 + truth_random_uniform(random, -ratio, ratio));
}

// Put the given model's own numbers off by a few percent, always by the same ones for one state of `random`.
static void put_off(struct truth_plant_spec *nominal, struct truth_random random)
{
    nominal->motor_inertia_kgm2 = off_by(nominal->motor_inertia_kgm2, 0.015, &random);
    nominal->load_inertia_kgm2 = off_by(nominal->load_inertia_kgm2, 0.015, &random);
    nominal->viscous_friction_Nms_per_rad = off_by(nominal->viscous_friction_Nms_per_rad, 0.03, &random);
    nominal->coulomb_friction_Nm = off_by(nominal->coulomb_friction_Nm, 0.03, &random);
    nominal->torque_lag_s = off_by(nominal->torque_lag_s, 0.02, &random);
    nominal->dead_time_s = off_by(nominal->dead_time_s, 0.02, &random);
    nominal->belt_stiffness_Nm_per_rad = off_by(nominal->belt_stiffness_Nm_per_rad, 0.02, &random);
    nominal->belt_damping_Nms_per_rad = off_by(nominal->belt_damping_Nms_per_rad, 0.02, &random);
}

static void draw_case(struct truth_case *self, int draw, struct truth_random *random)
{
    int needs_belt = 0, needs_stroke = 0, coin = truth_random_integer(random, 0, 1);
    for (int i = 0; i < self->wish.causes; i++) {
        needs_belt |= truth_kind_needs_belt(self->wish.kind[i]);
        needs_stroke |= truth_kind_needs_stroke(self->wish.kind[i]);
    }
    self->protocol = self->wish.protocol != truth_protocol_any                               ? self->wish.protocol
                     : needs_stroke || (coin && draw < DRAWS_FREE) || draw >= 2 * DRAWS_FREE ? truth_protocol_stroke
                                                                                             : truth_protocol_multisine;
    self->periods = truth_random_integer(random, 0, 1) ? 11 : 7;
    draw_plant(&self->base.plant, truth_random_integer(random, 0, 1) || needs_belt, random);
    draw_sensors(&self->base.sensors, random);
    draw_excitations(self, random);
    measure_setting(self);
    for (int i = 0; i < self->wish.causes; i++) {
        self->hidden[i] = (struct truth_hidden){.kind = self->wish.kind[i], .amount = 1.0};
        for (int k = 0; k < TRUTH_DRAWS; k++) {
            self->hidden[i].draws[k] = truth_random_uniform(random, 0.0, 1.0);
        }
    }
    self->position_gain_per_s = truth_random_uniform(random, 40.0, 80.0);
    self->controller = (struct truth_controller){.late_samples = truth_random_integer(random, 0, 1)};
    self->controller.inertia_kgm2 = self->setting.torque_rms_Nm / rms_of(self->fit.acceleration_rad_per_s2, 0.0, 1.0);
}

uint64_t truth_case_noise_seed(const struct truth_case *self)
{
    uint64_t kind = self->wish.causes ? (uint64_t)self->wish.kind[0] : 0u;
    return 2u * (self->wish.seed * 64u + kind);
}

// Values that are no longer the given model's own to refit: those of the effect, and what would stand in for it.
static unsigned not_free(enum truth_kind kind)
{
    switch (kind) {
    case truth_kind_viscous_friction:
        return 1u << truth_refit_viscous;
    case truth_kind_coulomb_friction:
        return 1u << truth_refit_coulomb;
    case truth_kind_inertia: // the motor's share may move by a few percent only
        return 1u << truth_refit_load_inertia | 1u << truth_refit_motor_inertia;
    case truth_kind_torque_lag:
    case truth_kind_dead_time:
        return 1u << truth_refit_lag | 1u << truth_refit_dead_time;
    default:
        return 0u;
    }
}

// What does much the same as the effect: below its corner a lag is a delay, and the given one may be off as well.
static int find_stand_in(enum truth_kind kind, enum truth_refit *out)
{
    *out = kind == truth_kind_torque_lag ? truth_refit_dead_time : truth_refit_lag;
    return kind == truth_kind_torque_lag || kind == truth_kind_dead_time;
}

// Of each effect. refit: as long as a better refit is found, for the answer; else one projection, for the search.
static int find_evidence(struct truth_case *self, struct truth_evidence *scratch, int keep_basis, int refit)
{
    unsigned fixed = 0u;
    int aperiodic = 0, status = 0;
    for (int i = 0; i < self->wish.causes; i++) {
        fixed |= not_free(self->wish.kind[i]);
        aperiodic |= truth_kind_is_aperiodic(self->wish.kind[i]) && self->wish.kind[i] != truth_kind_lost_samples;
    }
    struct truth_evidence_setting setting = {
        .controller = &self->controller,
        .excitation = &self->fit,
        .periods = self->periods,
        .seed = truth_case_noise_seed(self),
        .not_free = fixed,
        .aperiodic = aperiodic,
        .keep_basis = keep_basis,
    };
    for (int i = 0; i < self->wish.causes && !status; i++) {
        struct truth_drive other = truth_case_drive(self, all_known(self) & ~(1u << i));
        struct truth_plant_spec given = other.plant;
        put_off(&given, self->errors);
        truth_kind_refit(self->wish.kind[i], &self->truth.plant, &given, &other.plant);
        setting.reach = find_stand_in(self->wish.kind[i], &setting.stand_in) ? TRUTH_REFIT_SHARE : 0.0;
        status = refit ? truth_evidence_refit(&self->truth, &given, &other, &setting, &scratch[i])
                       : truth_evidence_find(&self->truth, &other, &setting, &scratch[i]);
        self->evidence_nats[i] = scratch[i].nats;
        self->share[i] = scratch[i].share;
        if (self->wish.kind[i] == truth_kind_lost_samples) {
            double rows = self->truth.sensors.lost_share * self->periods * TRUTH_PERIOD_SAMPLES;
            self->evidence_nats[i] = truth_evidence_of_loss_nats(&self->truth.sensors, rows);
        }
    }
    self->unlike = 1.0;
    for (int i = 0; i < self->wish.causes && !status; i++) {
        for (int k = 0; k < i; k++) {
            double likeness = truth_evidence_likeness(&scratch[i], &scratch[k]);
            self->unlike = fmin(self->unlike, 1.0 - likeness * likeness);
        }
    }
    return status;
}

double truth_case_left_nats(const struct truth_case *self, const struct truth_drive *other)
{
    const struct truth_evidence_setting setting = {
        .controller = &self->controller,
        .excitation = &self->fit,
        .periods = self->periods,
        .seed = truth_case_noise_seed(self),
        .aperiodic = 1,
    };
    // Repeated rows are no matter of the motion: a drive with them is never the same as one without.
    if ((self->truth.sensors.lost_share > 0.0) != (other->sensors.lost_share > 0.0)) {
        return INFINITY;
    }
    struct truth_evidence *evidence = malloc(sizeof *evidence);
    double nats = NAN;
    if (evidence && !truth_evidence_find(&self->truth, other, &setting, evidence)) {
        nats = evidence->nats;
    }
    free(evidence);
    return nats;
}

static void scale_noise(struct truth_case *self, double factor)
{
    self->base.plant.process_noise_Nm *= factor;
    self->base.sensors.torque_Nm *= factor;
    self->base.sensors.velocity_rad_per_s *= factor;
    self->base.sensors.position_rad *= factor;
    set_counts(&self->base.sensors);
}

// What is known of how an effect's evidence grows with its amount: a bracket, in logarithms.
struct bracket {
    double low, high, last_amount, last_nats, slope;
};

// The next amount to try; evidence usually grows with the square.
static double next_amount(struct bracket *self, double amount, double nats, double target)
{
    double x = log(amount), y = log(fmax(nats, 1e-3));
    if (nats < target) {
        self->low = fmax(self->low, x);
    } else {
        self->high = fmin(self->high, x);
    }
    if (self->last_nats > 0.0 && fabs(x - self->last_amount) > 1e-3) {
        self->slope = fmin(6.0, fmax(0.7, (y - log(self->last_nats)) / (x - self->last_amount)));
    }
    self->last_amount = x;
    self->last_nats = fmax(nats, 1e-3);
    double next = x + fmin(2.0, fmax(-2.0, (log(target) - y) / self->slope));
    if (next >= self->high) {
        next = 0.5 * (fmax(self->low, x - 2.0) + self->high);
    } else if (next <= self->low) {
        next = 0.5 * (self->low + fmin(self->high, x + 2.0));
    }
    return exp(next);
}

static double mean_log_ratio(const struct truth_case *self, double target)
{
    double sum = 0.0;
    for (int i = 0; i < self->wish.causes; i++) {
        sum += log(fmax(1e-3, self->evidence_nats[i]) / target) / self->wish.causes;
    }
    return sum;
}

// Sizes of one effect are met within a factor of 1.6; several have at least half of theirs each, and 30 times at most.
static int sizes_fit(const struct truth_case *self, double target)
{
    const double alike = 0.3, seen = 0.002;
    int several = self->wish.causes > 1, fit = self->unlike >= alike;
    for (int i = 0; i < self->wish.causes; i++) {
        enum truth_kind kind = self->wish.kind[i];
        double ratio = self->evidence_nats[i] / target;
        int in_torque = kind != truth_kind_lost_samples && kind != truth_kind_encoder_eccentricity &&
                        kind != truth_kind_sensor_filter;
        fit &= ratio <= (several ? 30.0 : 1.6) && ratio >= 1.0 / (several ? 2.0 : 1.6);
        fit &= self->share[i] >= seen || !in_torque;
    }
    return fit;
}

// What the amounts could not do is left to the noise, by a factor of 6 at most.
static int reach_by_noise(struct truth_case *self, struct truth_evidence *scratch, double target)
{
    const double most = 6.0;
    if (find_evidence(self, scratch, 0, 1)) {
        return 0;
    }
    double ratio = mean_log_ratio(self, target), factor = exp(0.5 * ratio);
    if (!(factor <= most && factor >= 1.0 / most)) {
        return 0;
    }
    if (self->wish.causes == 1 && fabs(ratio) > 0.1) {
        scale_noise(self, factor);
    }
    compose(self);
    return !find_evidence(self, scratch, 0, 1) && sizes_fit(self, target);
}

// One more try at the amounts: 1 when they are right or cannot change any more, 0 when not, -1 when the drive fails.
static int step_amounts(struct truth_case *self, struct truth_evidence *scratch, struct bracket *brackets,
                        double target, int step)
{
    const double first_noise = 6.0;
    int settled = 1;
    compose(self);
    if (find_evidence(self, scratch, step > 0, 0)) {
        return -1;
    }
    if (step == 0) {
        scale_noise(self, fmin(first_noise, fmax(1.0 / first_noise, exp(0.5 * mean_log_ratio(self, target)))));
        return 0;
    }
    for (int i = 0; i < self->wish.causes; i++) {
        double before = self->hidden[i].amount, ratio = log(fmax(1e-3, self->evidence_nats[i]) / target);
        int close = self->wish.causes > 1 ? ratio > -0.4 && ratio < 3.0 : fabs(ratio) < 0.15;
        if (!close) {
            self->hidden[i].amount = next_amount(&brackets[i], before, self->evidence_nats[i], target);
            settled &= fabs(log(self->hidden[i].amount / before)) < 0.03;
        }
    }
    return settled;
}

// Change the noise, then the amounts, then the noise, until each effect has the evidence asked for. Whether it has.
static int reach_size(struct truth_case *self)
{
    struct truth_evidence *scratch = malloc(TRUTH_CAUSES_MAX * sizeof *scratch);
    struct bracket brackets[TRUTH_CAUSES_MAX];
    double target = truth_size_nats(self->wish.size);
    int settled = scratch ? 0 : -1;
    for (int i = 0; i < self->wish.causes; i++) {
        double low, high;
        truth_kind_bounds(self->wish.kind[i], &low, &high);
        brackets[i] = (struct bracket){.low = log(low), .high = log(high), .slope = 2.0};
        // Any amount, with the noise that makes it as plain as asked for; what noise may not do, the amount does.
        self->hidden[i].amount = low * pow(high / low, 0.1 + 0.8 * self->hidden[i].draws[TRUTH_DRAWS - 1]);
    }
    for (int step = 0; !settled && step < SIZE_STEPS; step++) {
        settled = step_amounts(self, scratch, brackets, target, step);
    }
    int reached = settled >= 0 && reach_by_noise(self, scratch, target);
    free(scratch);
    return reached;
}

void truth_case_make(struct truth_case *self, const struct truth_wish *wish)
{
    *self = (struct truth_case){.wish = *wish};
    struct truth_random random;
    uint64_t stream = 1000u + (uint64_t)wish->size;
    for (int i = 0; i < wish->causes; i++) {
        stream = stream * 64u + (uint64_t)wish->kind[i];
    }
    truth_random_init(&random, wish->seed, stream);
    for (int draw = 0; draw < DRAWS && !self->reached; draw++) {
        draw_case(self, draw, &random);
        self->errors = random;
        int room = 1;
        for (int i = 0; i < wish->causes; i++) {
            room &= truth_kind_has_room(wish->kind[i], &self->setting);
        }
        self->reached = wish->causes == 0 || (room && reach_size(self));
        compose(self);
    }
    self->nominal = self->without;
    put_off(&self->nominal, self->errors);
}
