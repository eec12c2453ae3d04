/* SPDX-License-Identifier: MIT */
#include "bench/start_study.h"

#include "lab/design/design.h"
#include "lab/design/start_phase.h"
#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { period = 2000, lines_max = 200, rate_hz = 1000 };

static const double two_pi = 6.283185307179586;
static const double inertia_kgm2 = 0.00516;

const char *const start_rule_names[start_rule_count] = {"none", "random", "paper", "bank", "known"};
const char *const start_mode_names[start_mode_count] = {"open loop", "closed loop"};

static double between(struct random *random, double low, double high)
{
    return low + (high - low) * random_uniform(random);
}

static double between_logarithmic(struct random *random, double low, double high)
{
    return low * pow(high / low, random_uniform(random));
}

// ---- Designs

struct wish {
    const char *method;
    enum design_grid grid;
    double velocity_limit_rad_per_s;
    uint32_t highest_bin;
    uint32_t step;
    double torque_slope; ///< > 0: torque falls with this power of frequency; 0: by the limits
};

static struct wish wish_of(uint64_t design_seed, size_t index)
{
    static const double testbed_velocity = 0.05 / 0.0159;
    const struct wish fixed[start_designs] = {
        {"clip", design_grid_samples, testbed_velocity, 200, 1, 0},
        {"mca", design_grid_samples, testbed_velocity, 200, 1, 0},
        {"fast", design_grid_samples, testbed_velocity, 200, 1, 0},
        {"fast", design_grid_continuous, testbed_velocity, 200, 1, 0},
        {"fast", design_grid_samples, testbed_velocity, 200, 1, 0.5},
        {"mca", design_grid_samples, testbed_velocity, 200, 2, 0},
    };
    struct wish wish = fixed[index];
    if (design_seed > 0) {
        struct random random;
        random_seed(&random, design_seed * start_designs + index);
        wish.velocity_limit_rad_per_s = between_logarithmic(&random, 1.5, 12);
        wish.highest_bin = (uint32_t)between(&random, 160, 200.99);
        wish.torque_slope *= between(&random, 0, 2);
    }
    return wish;
}

static int make_design(const struct wish *wish, struct design_result *out_result, struct error *out_error)
{
    uint32_t bins[lines_max];
    double shape[lines_max];
    size_t count = 0;
    for (uint32_t bin = 1; bin <= wish->highest_bin; bin += wish->step) {
        shape[count] = pow(bin, -wish->torque_slope);
        bins[count++] = bin;
    }
    const struct design_request request = {
        .rate_num_hz = rate_hz,
        .rate_den = 1,
        .period_samples = period,
        .bin_count = count,
        .bins = bins,
        .limits = {.velocity_rad_per_s = wish->velocity_limit_rad_per_s, .torque_Nm = 1},
        .inertia_kgm2 = inertia_kgm2,
        .torque_shape = wish->torque_slope > 0 ? shape : NULL,
        .method = wish->method,
        .grid = wish->grid,
        .start = design_start_paper,
        .starts = 1,
        .threads = 1,
    };
    return design_run(&request, out_result, out_error);
}

// ---- A simulation that shares nothing with the designer

struct plant {
    double motor_inertia, load_inertia, stiffness, damping, friction;
};

enum { plant_states = 4, states = plant_states + 1 }; // angles and speeds of motor and load; the integral part

static struct plant draw_plant(struct random *random)
{
    const double antiresonance = two_pi * between_logarithmic(random, 8, 80);
    const double load_share = between(random, 0.3, 0.8);
    const double damping_ratio = between(random, 0.01, 0.06);
    const double friction_per_s = between_logarithmic(random, 0.2, 5);
    const double load = load_share * inertia_kgm2;
    return (struct plant){.motor_inertia = inertia_kgm2 - load,
                          .load_inertia = load,
                          .stiffness = antiresonance * antiresonance * load,
                          .damping = 2 * damping_ratio * antiresonance * load,
                          .friction = friction_per_s * inertia_kgm2};
}

static void plant_rates(const struct plant *plant, const double *x, double torque, double *out_rates)
{
    double belt = plant->stiffness * (x[0] - x[2]) + plant->damping * (x[1] - x[3]);
    out_rates[0] = x[1];
    out_rates[1] = (torque - plant->friction * x[1] - belt) / plant->motor_inertia;
    out_rates[2] = x[3];
    out_rates[3] = belt / plant->load_inertia;
}

/// Moves the plant over one sample of constant torque: Runge and Kutta's fourth order in 32 steps.
static void move_plant(const struct plant *plant, double torque, double *inout_x)
{
    enum { steps = 32 };
    const double dt = 1.0 / rate_hz / steps;
    for (int i = 0; i < steps; i++) {
        double slope[4][plant_states];
        double at[plant_states];
        const double reach[4] = {0, dt / 2, dt / 2, dt};
        for (int stage = 0; stage < 4; stage++) {
            for (int s = 0; s < plant_states; s++) {
                at[s] = inout_x[s] + (stage > 0 ? reach[stage] * slope[stage - 1][s] : 0);
            }
            plant_rates(plant, at, torque, slope[stage]);
        }
        for (int s = 0; s < plant_states; s++) {
            inout_x[s] += dt / 6 * (slope[0][s] + 2 * slope[1][s] + 2 * slope[2][s] + slope[3][s]);
        }
    }
}

/// One sample of the plant is linear: what it makes of each state and of the torque, integrated once.
struct sampled {
    double by_state[plant_states][plant_states], by_torque[plant_states];
};

static struct sampled sample_plant(const struct plant *plant)
{
    struct sampled sampled = {0};
    for (int column = 0; column <= plant_states; column++) {
        double x[plant_states] = {0};
        if (column < plant_states) {
            x[column] = 1;
        }
        move_plant(plant, column == plant_states ? 1 : 0, x);
        for (int row = 0; row < plant_states; row++) {
            double *entry = column < plant_states ? &sampled.by_state[row][column] : &sampled.by_torque[row];
            *entry = x[row];
        }
    }
    return sampled;
}

/// Plays sample n of the table: controllers, then the plant.
static void play(const struct sampled *sampled, const struct design_result *table, enum start_mode mode, size_t n,
                 double *inout_x)
{
    const double position_gain = 40;
    const double velocity_gain = 0.6;
    const double integral_time_s = 0.05;
    double torque = table->torque_Nm[n];
    if (mode == start_closed_loop) {
        double wanted = table->velocity_rad_per_s[n] + position_gain * (table->position_rad[n] - inout_x[0]);
        double pull = velocity_gain * (wanted - inout_x[1]);
        torque += pull + inout_x[4];
        inout_x[4] += pull / (integral_time_s * rate_hz);
    }
    double next[plant_states];
    for (int row = 0; row < plant_states; row++) {
        next[row] = sampled->by_torque[row] * torque;
        for (int column = 0; column < plant_states; column++) {
            next[row] += sampled->by_state[row][column] * inout_x[column];
        }
    }
    memcpy(inout_x, next, sizeof next);
}

/// One period of the motor's velocity in steady state, sample by sample of the table: period after period until two of
/// them agree. Friction slows these drives with a time constant of 5 s at most: the rest is three times the difference.
static void settle(const struct sampled *sampled, const struct design_result *table, enum start_mode mode,
                   double out_velocity[period])
{
    enum { periods_max = 100 };
    const double agreement = 1e-8;
    double x[states] = {0};
    double change = INFINITY;
    double peak = 0;
    memset(out_velocity, 0, period * sizeof *out_velocity);
    for (int p = 0; p < periods_max && change > agreement * peak; p++) {
        change = peak = 0;
        for (size_t n = 0; n < period; n++) {
            change = fmax(change, fabs(x[1] - out_velocity[n]));
            peak = fmax(peak, fabs(x[1]));
            out_velocity[n] = x[1];
            play(sampled, table, mode, n, x);
        }
    }
}

/// Begins at rest at sample t0, in closed loop where the position reference is.
static double transient_share(const struct sampled *sampled, const struct design_result *table, enum start_mode mode,
                              size_t t0, const double settled[period])
{
    double x[states] = {0};
    double transient = 0;
    double steady = 0;
    if (mode == start_closed_loop) {
        x[0] = x[2] = table->position_rad[t0];
    }
    for (size_t i = 0; i < period; i++) {
        size_t n = (t0 + i) % period;
        transient += (x[1] - settled[n]) * (x[1] - settled[n]);
        steady += settled[n] * settled[n];
        play(sampled, table, mode, n, x);
    }
    return transient / steady;
}

// ---- The study

static struct sim_model model_of(const struct plant *plant)
{
    struct sim_model model;
    sim_model_default(&model);
    model.structure = sim_structure_two_mass;
    model.motor_inertia_kgm2 = plant->motor_inertia;
    model.load_inertia_kgm2 = plant->load_inertia;
    model.belt_stiffness_Nm_per_rad = plant->stiffness;
    model.belt_damping_Nms_per_rad = plant->damping;
    model.viscous_friction_Nms_per_rad = plant->friction;
    return model;
}

static enum design_loop_mode loop_mode(enum start_mode mode)
{
    return mode == start_open_loop ? design_loop_torque : design_loop_cascade;
}

static struct design_transient_table table_of(const struct design_result *result)
{
    return (struct design_transient_table){
        .rate_hz = rate_hz,
        .period_samples = period,
        .line_count = result->bin_count,
        .bins = result->bins,
        .amplitude_rad = result->amplitude_rad,
        .phase_rad = result->phase_rad,
        .inertia_kgm2 = inertia_kgm2,
    };
}

/// `begin`: the starts that do not depend on the drive; known and random are filled in here.
static int add_plant(struct start_study *self, const struct design_result *design, struct random *random,
                     size_t begin[start_mode_count][start_rule_count], struct error *out_error)
{
    const struct plant plant = draw_plant(random);
    const struct sampled sampled = sample_plant(&plant);
    const struct sim_model model = model_of(&plant);
    const struct design_transient_table table = table_of(design);
    int status = 0;
    for (int mode = 0; !status && mode < start_mode_count; mode++) {
        double settled[period];
        double expected = 0;
        settle(&sampled, design, (enum start_mode)mode, settled);
        begin[mode][start_rule_random] = (size_t)between(random, 0, period);
        status = design_start_choose(&table, &model, loop_mode((enum start_mode)mode), &begin[mode][start_rule_known],
                                     &expected, out_error);
        for (int rule = 0; !status && rule < start_rule_count; rule++) {
            self->share[mode][rule][self->count] =
                transient_share(&sampled, design, (enum start_mode)mode, begin[mode][rule], settled);
        }
    }
    self->count++;
    return status;
}

static int add_design(struct start_study *self, const struct start_draw *draw, size_t index, struct random *random,
                      struct error *out_error)
{
    struct design_result design;
    const struct wish wish = wish_of(draw->design_seed, index);
    int status = make_design(&wish, &design, out_error);
    if (status) {
        return status;
    }
    const struct design_transient_table table = table_of(&design);
    size_t begin[start_mode_count][start_rule_count] = {{0}};
    double expected = 0;
    for (int mode = 0; !status && mode < start_mode_count; mode++) {
        begin[mode][start_rule_paper] =
            design_start_phase_paper(period, design.velocity_rad_per_s, design.acceleration_rad_per_s2);
        status = design_start_choose(&table, NULL, loop_mode((enum start_mode)mode), &begin[mode][start_rule_bank],
                                     &expected, out_error);
    }
    for (size_t i = 0; !status && i < start_plants; i++) {
        status = add_plant(self, &design, random, begin, out_error);
    }
    design_result_free(&design);
    return status;
}

int start_study_add(struct start_study *self, const struct start_draw *draw, struct error *out_error)
{
    const size_t size = (self->count + start_designs * start_plants) * sizeof(double);
    for (int i = 0; i < start_mode_count * start_rule_count; i++) {
        double **share = &self->share[i / start_rule_count][i % start_rule_count];
        double *grown = realloc(*share, size);
        if (!grown) {
            return error_set(out_error, error_refused, "memory is short for the study");
        }
        *share = grown;
    }
    struct random random;
    random_seed(&random, draw->plant_seed);
    int status = 0;
    for (size_t i = 0; !status && i < start_designs; i++) {
        status = add_design(self, draw, i, &random, out_error);
    }
    return status;
}

void start_study_free(struct start_study *self)
{
    for (int i = 0; i < start_mode_count * start_rule_count; i++) {
        free(self->share[i / start_rule_count][i % start_rule_count]);
    }
    *self = (struct start_study){0};
}

double start_study_mean(const struct start_study *self, enum start_mode mode, enum start_rule rule)
{
    double sum = 0;
    for (size_t i = 0; i < self->count; i++) {
        sum += self->share[mode][rule][i];
    }
    return sum / (double)self->count;
}

static int compare(const void *a, const void *b)
{
    const double left = *(const double *)a;
    const double right = *(const double *)b;
    return (left > right) - (left < right);
}

double start_study_quantile(const struct start_study *self, enum start_mode mode, enum start_rule rule,
                            double probability)
{
    double *sorted = malloc(self->count * sizeof *sorted);
    if (!sorted || self->count == 0) {
        free(sorted);
        return 0;
    }
    memcpy(sorted, self->share[mode][rule], self->count * sizeof *sorted);
    qsort(sorted, self->count, sizeof *sorted, compare);
    double value = sorted[(size_t)(probability * (double)(self->count - 1) + 0.5)];
    free(sorted);
    return value;
}
