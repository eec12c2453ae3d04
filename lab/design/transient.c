/* SPDX-License-Identifier: MIT */
#include "lab/design/transient.h"

#include "lab/numeric/fft.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586;

/// Components that carry less than this share of the transient's mean over all t0 are left out: far below what the
/// best t0 leaves of it.
static const double negligible = 1e-9;

/// Q = sum_i w_i w_i' with the eigenvalue's root in each w_i: the columns of `inout_gramian` become the w_i.
static bool split_gramian(size_t states, double *inout_gramian)
{
    double *eigenvalues = malloc(states * sizeof *eigenvalues);
    const lapack_int n = (lapack_int)states;
    bool found = eigenvalues && LAPACKE_dsyev(LAPACK_COL_MAJOR, 'V', 'U', n, inout_gramian, n, eigenvalues) == 0;
    for (size_t i = 0; found && i < states; i++) {
        double root = sqrt(fmax(eigenvalues[i], 0));
        for (size_t s = 0; s < states; s++) {
            inout_gramian[i * states + s] *= root;
        }
    }
    free(eigenvalues);
    return found;
}

/// Phasors of position, velocity and torque reference of one line.
static void references_of(const struct design_transient_table *table, size_t line, double out_u[2 * design_loop_inputs])
{
    const double omega = two_pi * table->bins[line] * table->rate_hz / (double)table->period_samples;
    const double re = table->amplitude_rad[line] * cos(table->phase_rad[line]);
    const double im = table->amplitude_rad[line] * sin(table->phase_rad[line]);
    out_u[0] = re;
    out_u[1] = im;
    out_u[2] = -omega * im;
    out_u[3] = omega * re;
    out_u[4] = -table->inertia_kgm2 * omega * omega * re;
    out_u[5] = -table->inertia_kgm2 * omega * omega * im;
}

/// Buffers of one pass over the lines.
struct workspace {
    double *weights; ///< w_i, states x states
    double *solver;
    double *state;
};

/// D_k = rest u - X, seen through every w_i; and the line's share of the steady velocity.
static bool add_line(const struct design_loop *loop, const struct design_transient_table *table, size_t line,
                     const struct workspace *work, struct design_transient *self)
{
    const size_t states = loop->states;
    const double angle = two_pi * table->bins[line] / (double)table->period_samples;
    double u[2 * design_loop_inputs];
    references_of(table, line, u);
    if (!design_loop_steady_state(loop, angle, u, work->solver, work->state)) {
        return false;
    }
    const double velocity_square = work->state[0] * work->state[0] + work->state[1] * work->state[1];
    self->steady_energy += velocity_square * (double)table->period_samples / 2;
    for (size_t part = 0; part < 2; part++) {
        for (size_t s = 0; s < states; s++) {
            double rest = 0;
            for (size_t j = 0; j < design_loop_inputs; j++) {
                rest += loop->rest[j * states + s] * u[2 * j + part];
            }
            work->state[2 * s + part] = rest - work->state[2 * s + part];
        }
        for (size_t i = 0; i < states; i++) {
            double sum = 0;
            for (size_t s = 0; s < states; s++) {
                sum += work->weights[i * states + s] * work->state[2 * s + part];
            }
            self->components[2 * (i * table->line_count + line) + part] = sum;
        }
    }
    return isfinite(velocity_square);
}

static double component_energy(const struct design_transient *self, size_t component)
{
    const double *y = &self->components[2 * component * self->line_count];
    double sum = 0;
    for (size_t i = 0; i < 2 * self->line_count; i++) {
        sum += y[i] * y[i];
    }
    return sum;
}

static void drop_negligible(struct design_transient *self)
{
    double whole = 0;
    for (size_t i = 0; i < self->component_count; i++) {
        whole += component_energy(self, i);
    }
    const size_t length = 2 * self->line_count;
    size_t kept = 0;
    for (size_t i = 0; i < self->component_count; i++) {
        if (component_energy(self, i) > negligible * whole) {
            memmove(&self->components[kept * length], &self->components[i * length], length * sizeof(double));
            kept++;
        }
    }
    self->component_count = kept;
}

enum design_transient_status design_transient_create(const struct design_loop *loop,
                                                     const struct design_transient_table *table,
                                                     struct design_transient *out_transient)
{
    const size_t states = loop->states;
    struct design_transient self = {.line_count = table->line_count,
                                    .bins = table->bins,
                                    .period_samples = table->period_samples,
                                    .component_count = states};
    struct workspace work = {.weights = malloc(states * states * sizeof(double)),
                             .solver = malloc(2 * states * (states + 1) * sizeof(double)),
                             .state = malloc(2 * states * sizeof(double))};
    enum design_transient_status status = design_transient_memory;
    self.components = malloc(2 * states * table->line_count * sizeof(double));
    if (work.weights && work.solver && work.state && self.components &&
        design_loop_gramian(loop, table->period_samples, work.weights) && split_gramian(states, work.weights)) {
        status = design_transient_ok;
        for (size_t k = 0; status == design_transient_ok && k < table->line_count; k++) {
            status = add_line(loop, table, k, &work, &self) ? design_transient_ok : design_transient_no_steady_state;
        }
    }
    free(work.weights);
    free(work.solver);
    free(work.state);
    if (status != design_transient_ok) {
        design_transient_free(&self);
        return status;
    }
    drop_negligible(&self);
    *out_transient = self;
    return design_transient_ok;
}

void design_transient_free(struct design_transient *transient)
{
    free(transient->components);
    *transient = (struct design_transient){0};
}

double design_transient_share(const struct design_transient *self, double t0_samples)
{
    double energy = 0;
    for (size_t i = 0; i < self->component_count; i++) {
        const double *y = &self->components[2 * i * self->line_count];
        double sum = 0;
        for (size_t k = 0; k < self->line_count; k++) {
            double turns = fmod((double)self->bins[k] * t0_samples, (double)self->period_samples);
            double angle = two_pi * turns / (double)self->period_samples;
            sum += y[2 * k] * cos(angle) - y[2 * k + 1] * sin(angle);
        }
        energy += sum * sum;
    }
    return energy / self->steady_energy;
}

/// Puts a real signal into the spectrum of a pair, the second one of it in the imaginary part.
static void place(const struct design_transient *self, size_t component, bool second, double *inout_spectrum)
{
    if (component >= self->component_count) {
        return;
    }
    const double *y = &self->components[2 * component * self->line_count];
    for (size_t k = 0; k < self->line_count; k++) {
        double *up = &inout_spectrum[2 * (size_t)self->bins[k]];
        double *down = &inout_spectrum[2 * (self->period_samples - self->bins[k])];
        double re = y[2 * k] / 2;
        double im = y[2 * k + 1] / 2;
        up[0] += second ? -im : re;
        up[1] += second ? re : im;
        down[0] += second ? im : re;
        down[1] += second ? re : -im;
    }
}

bool design_transient_add_shares(const struct design_transient *self, double *inout_share)
{
    const size_t length = self->period_samples;
    struct fft_plan *plan = fft_plan_create(length);
    double *spectrum = malloc(2 * length * sizeof *spectrum);
    double *signals = malloc(2 * length * sizeof *signals);
    const bool enough_memory = plan && spectrum && signals;
    for (size_t i = 0; enough_memory && i < self->component_count; i += 2) {
        memset(spectrum, 0, 2 * length * sizeof *spectrum);
        place(self, i, false, spectrum);
        place(self, i + 1, true, spectrum);
        fft_inverse(plan, spectrum, signals);
        for (size_t n = 0; n < length; n++) {
            double energy = signals[2 * n] * signals[2 * n] + signals[2 * n + 1] * signals[2 * n + 1];
            inout_share[n] += energy / self->steady_energy;
        }
    }
    if (plan) {
        fft_plan_destroy(plan);
    }
    free(spectrum);
    free(signals);
    return enough_memory;
}
