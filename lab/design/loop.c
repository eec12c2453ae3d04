/* SPDX-License-Identifier: MIT */
#include "lab/design/loop.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { absent = -1, continuous_max = design_loop_plant_states + 1 };

/// Where in the state vector what is; absent (-1): the drive has no such state.
struct layout {
    int velocity, load_velocity, twist, lag, position; ///< the plant, in continuous time
    int filtered_velocity, integral;                   ///< the controllers
    int history; ///< first of the torque references still on their way, newest first
    size_t plant_count, history_count, count;
};

/// The plant over a part of a sample under a constant torque: x <- transition x + input torque.
struct piece {
    double transition[design_loop_plant_states][design_loop_plant_states];
    double input[design_loop_plant_states];
};

struct builder {
    const struct sim_model *model;
    struct layout at;
    double sample_s;
    enum design_loop_mode mode;
    struct piece before, after; ///< the change of the delayed torque within the sample
};

static struct layout layout_of(const struct sim_model *model, double dead_samples, enum design_loop_mode mode)
{
    struct layout at = {.load_velocity = absent, .twist = absent, .lag = absent, .position = absent};
    int next = 0;
    at.velocity = next++;
    if (model->structure == sim_structure_two_mass) {
        at.load_velocity = next++;
        at.twist = next++;
    }
    if (model->torque_lag_s > 0) {
        at.lag = next++;
    }
    if (mode == design_loop_cascade) {
        at.position = next++;
    }
    at.plant_count = (size_t)next;
    at.filtered_velocity = mode == design_loop_cascade && model->sensors.velocity_filter_s > 0 ? next++ : absent;
    at.integral = mode == design_loop_cascade && model->controller.velocity_integral_time_s > 0 ? next++ : absent;
    at.history = next;
    at.history_count = (size_t)ceil(dead_samples);
    at.count = (size_t)next + at.history_count;
    return at;
}

/// dx/dt = F (x, torque) as a square matrix; the last row, of the constant torque, is zero.
static void continuous_plant(const struct sim_model *model, const struct layout *at,
                             double out_rates[continuous_max][continuous_max])
{
    const bool two_mass = at->twist != absent;
    const size_t torque = at->lag != absent ? (size_t)at->lag : at->plant_count;
    const double inertia = model->motor_inertia_kgm2 + (two_mass ? 0 : model->load_inertia_kgm2);
    double *motor = out_rates[at->velocity];
    motor[torque] = 1 / inertia;
    motor[at->velocity] = -model->viscous_friction_Nms_per_rad / inertia;
    if (two_mass) {
        double *load = out_rates[at->load_velocity];
        motor[at->velocity] -= model->belt_damping_Nms_per_rad / inertia;
        motor[at->load_velocity] = model->belt_damping_Nms_per_rad / inertia;
        motor[at->twist] = -model->belt_stiffness_Nm_per_rad / inertia;
        load[at->velocity] = model->belt_damping_Nms_per_rad / model->load_inertia_kgm2;
        load[at->load_velocity] = -load[at->velocity];
        load[at->twist] = model->belt_stiffness_Nm_per_rad / model->load_inertia_kgm2;
        out_rates[at->twist][at->velocity] = 1;
        out_rates[at->twist][at->load_velocity] = -1;
    }
    if (at->lag != absent) {
        out_rates[at->lag][at->lag] = -1 / model->torque_lag_s;
        out_rates[at->lag][at->plant_count] = 1 / model->torque_lag_s;
    }
    if (at->position != absent) {
        out_rates[at->position][at->velocity] = 1;
    }
}

static void multiply(double a[continuous_max][continuous_max], double b[continuous_max][continuous_max],
                     double out[continuous_max][continuous_max])
{
    for (int i = 0; i < continuous_max; i++) {
        for (int j = 0; j < continuous_max; j++) {
            out[i][j] = 0;
            for (int k = 0; k < continuous_max; k++) {
                out[i][j] += a[i][k] * b[k][j];
            }
        }
    }
}

/// out = exp(F dt), by the series of exp(F dt / 2^s) and s squarings.
static void exponential(double rates[continuous_max][continuous_max], double dt_s,
                        double out[continuous_max][continuous_max])
{
    enum { terms = 18 }; // 0.5^18 / 18! is below rounding
    double size = 0;
    for (int i = 0; i < continuous_max; i++) {
        double row = 0;
        for (int j = 0; j < continuous_max; j++) {
            row += fabs(rates[i][j]) * dt_s;
        }
        size = fmax(size, row);
    }
    const int squarings = size > 0.5 ? (int)ceil(log2(size / 0.5)) : 0;
    double small[continuous_max][continuous_max];
    double scratch[continuous_max][continuous_max];
    for (int i = 0; i < continuous_max; i++) {
        for (int j = 0; j < continuous_max; j++) {
            small[i][j] = ldexp(rates[i][j] * dt_s, -squarings);
            out[i][j] = i == j;
        }
    }
    for (int term = terms; term > 0; term--) { // Horner: I + small / term (...)
        multiply(small, out, scratch);
        for (int i = 0; i < continuous_max; i++) {
            for (int j = 0; j < continuous_max; j++) {
                out[i][j] = (i == j) + scratch[i][j] / term;
            }
        }
    }
    for (int i = 0; i < squarings; i++) {
        multiply(out, out, scratch);
        memcpy(out, scratch, sizeof scratch);
    }
}

static struct piece piece_of(const struct builder *self, double dt_s)
{
    double rates[continuous_max][continuous_max] = {{0}};
    double moved[continuous_max][continuous_max];
    struct piece piece = {0};
    continuous_plant(self->model, &self->at, rates);
    exponential(rates, dt_s, moved);
    for (size_t i = 0; i < self->at.plant_count; i++) {
        memcpy(piece.transition[i], moved[i], self->at.plant_count * sizeof(double));
        piece.input[i] = moved[i][self->at.plant_count];
    }
    return piece;
}

static void move_plant(const struct builder *self, const struct piece *piece, double torque, double *inout_plant)
{
    double next[design_loop_plant_states] = {0};
    for (size_t i = 0; i < self->at.plant_count; i++) {
        next[i] = piece->input[i] * torque;
        for (size_t j = 0; j < self->at.plant_count; j++) {
            next[i] += piece->transition[i][j] * inout_plant[j];
        }
    }
    memcpy(inout_plant, next, self->at.plant_count * sizeof(double));
}

/// The torque reference of one sample; moves the controllers' states. The order is sim_belt_drive's.
static double control(const struct builder *self, const double *u, double *inout_state)
{
    const struct sim_controller *gains = &self->model->controller;
    const struct layout *at = &self->at;
    if (self->mode == design_loop_torque) {
        return u[2];
    }
    double velocity = inout_state[at->velocity];
    if (at->filtered_velocity != absent) {
        double share = -expm1(-self->sample_s / self->model->sensors.velocity_filter_s);
        double *filtered = &inout_state[at->filtered_velocity];
        *filtered += (velocity - *filtered) * share;
        velocity = *filtered;
    }
    double command =
        gains->position_gain_per_s * (u[0] - inout_state[at->position]) + gains->velocity_feedforward * u[1];
    double proportional = gains->velocity_gain_Nms_per_rad * (command - velocity);
    double torque = proportional + gains->torque_feedforward * u[2];
    if (at->integral != absent) {
        torque += inout_state[at->integral];
        inout_state[at->integral] += proportional * self->sample_s / gains->velocity_integral_time_s;
    }
    return torque;
}

/// One sample: x and u in, the next x out.
static void step(const struct builder *self, const double *u, double *inout_state)
{
    const struct layout *at = &self->at;
    double torque = control(self, u, inout_state);
    double *history = &inout_state[at->history];
    const size_t delayed = at->history_count;
    double later = delayed > 1 ? history[delayed - 2] : torque;
    move_plant(self, &self->before, delayed > 0 ? history[delayed - 1] : torque, inout_state);
    move_plant(self, &self->after, later, inout_state);
    if (delayed > 0) {
        memmove(history + 1, history, (delayed - 1) * sizeof *history);
        history[0] = torque;
    }
}

/// The columns of A and B are what one step makes of each unit vector.
static void fill_matrices(const struct builder *self, struct design_loop *loop)
{
    const size_t states = loop->states;
    for (size_t j = 0; j < states + design_loop_inputs; j++) {
        double u[design_loop_inputs] = {0};
        double x[design_loop_states_max] = {0};
        if (j < states) {
            x[j] = 1;
        } else {
            u[j - states] = 1;
        }
        step(self, u, x);
        memcpy(j < states ? &loop->transition[j * states] : &loop->input[(j - states) * states], x,
               states * sizeof(double));
    }
    if (self->at.position != absent) { // relaxed belt, motor where the reference is; all else is zero
        loop->rest[self->at.position] = 1;
    }
}

/// The Hessenberg form makes a steady state cost states^2 instead of states^3; the eigenvalues are those of H.
static enum design_loop_status reduce(struct design_loop *loop)
{
    const lapack_int n = (lapack_int)loop->states;
    const size_t size = loop->states * loop->states;
    // Rounding of an eigenvalue of exactly 1: a drive without friction that only follows a torque.
    const double rounding = 1e-7;
    double *scratch = malloc((size + 3 * loop->states) * sizeof *scratch);
    if (!scratch) {
        return design_loop_memory;
    }
    double *reflectors = scratch + size;
    double *re = reflectors + loop->states;
    double *im = re + loop->states;
    memcpy(loop->hessenberg, loop->transition, size * sizeof *scratch);
    bool reduced = LAPACKE_dgehrd(LAPACK_COL_MAJOR, n, 1, n, loop->hessenberg, n, reflectors) == 0;
    memcpy(loop->basis, loop->hessenberg, size * sizeof *scratch);
    reduced = reduced && LAPACKE_dorghr(LAPACK_COL_MAJOR, n, 1, n, loop->basis, n, reflectors) == 0;
    for (size_t j = 0; j < loop->states; j++) {
        for (size_t i = j + 2; i < loop->states; i++) {
            loop->hessenberg[j * loop->states + i] = 0;
        }
    }
    memcpy(scratch, loop->hessenberg, size * sizeof *scratch);
    loop->growth = INFINITY;
    if (reduced && LAPACKE_dhseqr(LAPACK_COL_MAJOR, 'E', 'N', n, 1, n, scratch, n, re, im, NULL, n) == 0) {
        loop->growth = 0;
        for (size_t i = 0; i < loop->states; i++) {
            loop->eigenvalues[2 * i] = re[i];
            loop->eigenvalues[2 * i + 1] = im[i];
            loop->growth = fmax(loop->growth, hypot(re[i], im[i]));
        }
    }
    free(scratch);
    return loop->growth <= 1 + rounding ? design_loop_ok : design_loop_unstable;
}

static bool allocate(struct design_loop *loop)
{
    const size_t size = loop->states * loop->states;
    loop->transition = calloc(size, sizeof(double));
    loop->input = calloc(loop->states * design_loop_inputs, sizeof(double));
    loop->rest = calloc(loop->states * design_loop_inputs, sizeof(double));
    loop->hessenberg = calloc(size, sizeof(double));
    loop->basis = calloc(size, sizeof(double));
    loop->eigenvalues = calloc(2 * loop->states, sizeof(double));
    return loop->transition && loop->input && loop->rest && loop->hessenberg && loop->basis && loop->eigenvalues;
}

enum design_loop_status design_loop_create(const struct sim_model *model, double rate_hz, enum design_loop_mode mode,
                                           struct design_loop *out_loop)
{
    const double rounding = 1e-9; // a dead time of whole samples must not be counted as one more, as in sim/plant.c
    const double dead_samples = fmax(model->dead_time_s * rate_hz - rounding, 0);
    if (!(dead_samples <= design_loop_dead_samples_max)) {
        return design_loop_dead_time;
    }
    struct builder builder = {
        .model = model, .at = layout_of(model, dead_samples, mode), .sample_s = 1 / rate_hz, .mode = mode};
    const double change = 1 - (ceil(dead_samples) - dead_samples); // share of the sample until the torque changes
    builder.before = piece_of(&builder, dead_samples > 0 ? change * builder.sample_s : 0);
    builder.after = piece_of(&builder, dead_samples > 0 ? (1 - change) * builder.sample_s : builder.sample_s);
    struct design_loop loop = {.states = builder.at.count};
    enum design_loop_status status = design_loop_memory;
    if (allocate(&loop)) {
        fill_matrices(&builder, &loop);
        status = reduce(&loop);
    }
    if (status == design_loop_memory) {
        design_loop_free(&loop);
    }
    *out_loop = loop;
    return status;
}

void design_loop_free(struct design_loop *loop)
{
    free(loop->transition);
    free(loop->input);
    free(loop->rest);
    free(loop->hessenberg);
    free(loop->basis);
    free(loop->eigenvalues);
    *loop = (struct design_loop){0};
}

/// out = a b or, `transposed`, a' b; n x n, column after column.
static void product(size_t n, bool transposed, const double *a, const double *b, double *out)
{
    for (size_t j = 0; j < n; j++) {
        for (size_t i = 0; i < n; i++) {
            double sum = 0;
            for (size_t k = 0; k < n; k++) {
                sum += (transposed ? a[i * n + k] : a[k * n + i]) * b[j * n + k];
            }
            out[j * n + i] = sum;
        }
    }
}

/// Q_{a+b} = Q_a + (A^a)' Q_b A^a; inout: Q_a becomes Q_{a+b}.
static void extend(size_t n, const double *power, const double *further, double *scratch, double *inout_gramian)
{
    double *half = scratch;
    double *whole = scratch + n * n;
    product(n, false, further, power, half);
    product(n, true, power, half, whole);
    for (size_t i = 0; i < n * n; i++) {
        inout_gramian[i] += whole[i];
    }
}

bool design_loop_gramian(const struct design_loop *self, size_t samples, double *out_gramian)
{
    const size_t n = self->states;
    const size_t size = n * n;
    double *buffer = calloc(6 * size, sizeof *buffer);
    if (!buffer) {
        return false;
    }
    double *done_power = buffer; // A^m and Q_m of the m samples done so far
    double *power = buffer + size;
    double *gramian = buffer + 2 * size; // A^p and Q_p of p = 1, 2, 4, ...
    double *scratch = buffer + 3 * size;
    memset(out_gramian, 0, size * sizeof *out_gramian);
    memcpy(power, self->transition, size * sizeof *power);
    gramian[0] = 1;
    for (size_t i = 0; i < n; i++) {
        done_power[i * n + i] = 1;
    }
    for (size_t left = samples; left > 0; left /= 2) {
        if (left % 2 == 1) {
            extend(n, done_power, gramian, scratch, out_gramian);
            product(n, false, power, done_power, scratch);
            memcpy(done_power, scratch, size * sizeof *scratch);
        }
        double *doubled = scratch + 2 * size;
        memcpy(doubled, gramian, size * sizeof *doubled);
        extend(n, power, doubled, scratch, gramian);
        product(n, false, power, power, scratch);
        memcpy(power, scratch, size * sizeof *scratch);
    }
    free(buffer);
    return true;
}

static bool resonates(const struct design_loop *self, double angle_rad)
{
    const double distance = 1e-9;
    for (size_t i = 0; i < self->states; i++) {
        double re = self->eigenvalues[2 * i] - cos(angle_rad);
        double im = self->eigenvalues[2 * i + 1] - sin(angle_rad);
        if (hypot(re, im) < distance) {
            return true;
        }
    }
    return false;
}

/// out = U' v or, not `transposed`, U v; v and out: states complex numbers.
static void change_basis(const struct design_loop *self, bool transposed, const double *v, double *out)
{
    const size_t n = self->states;
    for (size_t i = 0; i < n; i++) {
        double re = 0;
        double im = 0;
        for (size_t j = 0; j < n; j++) {
            double weight = transposed ? self->basis[i * n + j] : self->basis[j * n + i];
            re += weight * v[2 * j];
            im += weight * v[2 * j + 1];
        }
        out[2 * i] = re;
        out[2 * i + 1] = im;
    }
}

/// Subtracts factor times one row of `count` complex numbers from another.
static void subtract_row(size_t count, const double factor[2], const double *row, double *inout_other)
{
    for (size_t j = 0; j < count; j++) {
        inout_other[2 * j] -= factor[0] * row[2 * j] - factor[1] * row[2 * j + 1];
        inout_other[2 * j + 1] -= factor[0] * row[2 * j + 1] + factor[1] * row[2 * j];
    }
}

static void divide(const double a[2], const double b[2], double out[2])
{
    const double square = b[0] * b[0] + b[1] * b[1];
    const double re = (a[0] * b[0] + a[1] * b[1]) / square;
    out[1] = (a[1] * b[0] - a[0] * b[1]) / square;
    out[0] = re;
}

/// Solves (z I - H) y = v, row after row with v as the last column: elimination between neighbours, the larger pivot on
/// top.
static void solve_hessenberg(size_t n, double *rows, double *out_y)
{
    const size_t width = 2 * (n + 1);
    for (size_t i = 0; i + 1 < n; i++) {
        double *top = &rows[i * width + 2 * i];
        double *below = top + width;
        double factor[2];
        if (hypot(below[0], below[1]) > hypot(top[0], top[1])) {
            for (size_t j = 0; j < width - 2 * i; j++) {
                double was = top[j];
                top[j] = below[j];
                below[j] = was;
            }
        }
        divide(below, top, factor);
        subtract_row(n + 1 - i, factor, top, below);
    }
    for (size_t i = n; i-- > 0;) {
        const double *row = &rows[i * width];
        double right[2] = {row[2 * n], row[2 * n + 1]};
        for (size_t j = i + 1; j < n; j++) {
            subtract_row(1, &row[2 * j], &out_y[2 * j], right);
        }
        divide(right, &row[2 * i], &out_y[2 * i]);
    }
}

bool design_loop_steady_state(const struct design_loop *self, double angle_rad, const double *amplitudes,
                              double *scratch, double *out_state)
{
    const size_t n = self->states;
    double v[2 * design_loop_states_max] = {0};
    double y[2 * design_loop_states_max];
    if (resonates(self, angle_rad)) {
        return false;
    }
    for (size_t i = 0; i < 2 * n; i++) {
        for (size_t j = 0; j < design_loop_inputs; j++) {
            v[i] += self->input[j * n + i / 2] * amplitudes[2 * j + i % 2];
        }
    }
    change_basis(self, true, v, y);
    for (size_t i = 0; i < n; i++) {
        double *row = &scratch[2 * i * (n + 1)];
        for (size_t j = 0; j < n; j++) {
            row[2 * j] = (i == j ? cos(angle_rad) : 0) - self->hessenberg[j * n + i];
            row[2 * j + 1] = i == j ? sin(angle_rad) : 0;
        }
        row[2 * n] = y[2 * i];
        row[2 * n + 1] = y[2 * i + 1];
    }
    solve_hessenberg(n, scratch, y);
    change_basis(self, false, y, out_state);
    return true;
}
