/* SPDX-License-Identifier: MIT */
#include "sim/transition.h"

#include <math.h>
#include <string.h>

/// Positions, speeds and the torque on the motor.
enum { size_max = 2 * sim_masses_max + 1 };

struct square {
    size_t n;
    double a[size_max][size_max];
};

static struct square product(const struct square *a, const struct square *b)
{
    struct square c = {.n = a->n};
    for (size_t i = 0; i < a->n; i++)
        for (size_t k = 0; k < a->n; k++)
            for (size_t j = 0; j < a->n; j++)
                c.a[i][j] += a->a[i][k] * b->a[k][j];
    return c;
}

static double norm(const struct square *a)
{
    double most = 0.0;
    for (size_t i = 0; i < a->n; i++) {
        double sum = 0.0;
        for (size_t j = 0; j < a->n; j++)
            sum += fabs(a->a[i][j]);
        most = fmax(most, sum);
    }
    return most;
}

static void exponential(struct square *io_a)
{
    const double longest = 0.25;
    enum { terms = 11 }; // 0.25^12 / 12! < 2e-16
    int halvings = 0;
    double size = norm(io_a);
    if (!isfinite(size)) { // a search looks at models beyond all bounds, and has to see that they are no models
        for (size_t i = 0; i < io_a->n; i++)
            for (size_t j = 0; j < io_a->n; j++)
                io_a->a[i][j] = NAN;
        return;
    }
    if (size > longest)
        halvings = (int)ceil(log2(size / longest));
    for (size_t i = 0; i < io_a->n; i++)
        for (size_t j = 0; j < io_a->n; j++)
            io_a->a[i][j] = ldexp(io_a->a[i][j], -halvings);
    struct square sum = {.n = io_a->n};
    for (size_t i = 0; i < sum.n; i++)
        sum.a[i][i] = 1.0;
    for (int term = terms; term > 0; term--) { // Horner: 1 + A/1 (1 + A/2 (1 + ...))
        sum = product(io_a, &sum);
        for (size_t i = 0; i < sum.n; i++) {
            for (size_t j = 0; j < sum.n; j++)
                sum.a[i][j] /= term;
            sum.a[i][i] += 1.0;
        }
    }
    for (int i = 0; i < halvings; i++)
        sum = product(&sum, &sum);
    *io_a = sum;
}

/// Adds the torque of the spring and damper between a mass and its neighbour, as acceleration of the mass. Speeds are
/// counted in units of omega times the position's unit.
static void add_link(struct square *io_a, size_t mass, size_t neighbour, double stiffness, double damping, double omega,
                     double inertia)
{
    size_t row = 2 * mass + 1;
    io_a->a[row][2 * mass] -= stiffness / (inertia * omega);
    io_a->a[row][2 * neighbour] += stiffness / (inertia * omega);
    io_a->a[row][2 * mass + 1] -= damping / inertia;
    io_a->a[row][2 * neighbour + 1] += damping / inertia;
}

void sim_transition_init(struct sim_transition *self, const struct sim_chain *chain, double viscous, bool held,
                         double rate, double dt_s)
{
    // With speeds over omega, and the torque in units of J omega^2, all entries are rates of the chain: no digits are
    // lost to units.
    const double slow = 0.05;
    size_t n = 2 * chain->masses;
    double omega = fmax(rate, slow / dt_s), motor = chain->inertia[0];
    struct square a = {.n = n + 1};
    for (size_t i = 0; i < chain->masses; i++) {
        a.a[2 * i][2 * i + 1] = omega;
        if (i > 0)
            add_link(&a, i, i - 1, chain->stiffness[i - 1], chain->damping[i - 1], omega, chain->inertia[i]);
        if (i + 1 < chain->masses)
            add_link(&a, i, i + 1, chain->stiffness[i], chain->damping[i], omega, chain->inertia[i]);
    }
    a.a[1][1] -= viscous / motor;
    a.a[1][n] = omega;
    if (held)
        memset(a.a, 0, 2 * sizeof a.a[0]);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j <= n; j++)
            a.a[i][j] *= dt_s;
    exponential(&a);
    for (size_t i = 0; i < n; i++) {
        double row = i % 2 == 1 ? omega : 1.0;
        self->input[i] = row * a.a[i][n] / (motor * omega * omega);
        for (size_t j = 1; j < n; j++)
            self->state[i][j - 1] = row * a.a[i][j] / (j % 2 == 1 ? omega : 1.0);
    }
}
