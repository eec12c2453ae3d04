/* SPDX-License-Identifier: MIT */
#include "tests/support/cubic_plant.h"

static const double two_pi = 6.283185307179586476925;

const struct cubic_plant cubic_plant_paper = {
    .mass_kg = {0.1, 0.1},
    .damping_Ns_per_m = {0.1, 0.05},
    .stiffness_N_per_m = {306.0, 20.0},
    .cubic_N_per_m3 = {550.0, 250.0},
};

/// What an integration needs of the plant: reciprocals, because a division is the slowest step of a derivative.
struct equations {
    const struct cubic_plant *plant;
    double per_mass_per_kg[2];
};

static double spring(const struct cubic_plant *plant, size_t i, double x)
{
    const double steeper = x * x * plant->cubic_N_per_m3[i];
    return x * (plant->stiffness_N_per_m[i] + x * plant->quadratic_N_per_m2[i] + steeper);
}

static struct cubic_state derivative(const struct equations *self, const struct cubic_state *state, double force_N)
{
    const double *q = state->position_m;
    const double *v = state->velocity_m_per_s;
    const double *c = self->plant->damping_Ns_per_m;
    const double between_N = spring(self->plant, 1, q[1] - q[0]) + c[1] * (v[1] - v[0]);
    const double ground_N = spring(self->plant, 0, q[0]) + c[0] * v[0];
    return (struct cubic_state){
        .position_m = {v[0], v[1]},
        .velocity_m_per_s = {(between_N - ground_N) * self->per_mass_per_kg[0],
                             (force_N - between_N) * self->per_mass_per_kg[1]},
    };
}

static struct cubic_state moved(const struct cubic_state *from, const struct cubic_state *slope, double time_s)
{
    struct cubic_state to;
    for (size_t i = 0; i < 2; i++) {
        to.position_m[i] = from->position_m[i] + time_s * slope->position_m[i];
        to.velocity_m_per_s[i] = from->velocity_m_per_s[i] + time_s * slope->velocity_m_per_s[i];
    }
    return to;
}

static double weighted(double first, double second, double third, double fourth)
{
    return first + 2 * (second + third) + fourth;
}

/// One substep; forces at its begin, middle and end.
static void step(const struct equations *self, const double force_N[3], double h_s, struct cubic_state *io_state)
{
    const struct cubic_state k1 = derivative(self, io_state, force_N[0]);
    const struct cubic_state at2 = moved(io_state, &k1, h_s / 2);
    const struct cubic_state k2 = derivative(self, &at2, force_N[1]);
    const struct cubic_state at3 = moved(io_state, &k2, h_s / 2);
    const struct cubic_state k3 = derivative(self, &at3, force_N[1]);
    const struct cubic_state at4 = moved(io_state, &k3, h_s);
    const struct cubic_state k4 = derivative(self, &at4, force_N[2]);
    struct cubic_state slope;
    for (size_t i = 0; i < 2; i++) {
        slope.position_m[i] = weighted(k1.position_m[i], k2.position_m[i], k3.position_m[i], k4.position_m[i]);
        slope.velocity_m_per_s[i] =
            weighted(k1.velocity_m_per_s[i], k2.velocity_m_per_s[i], k3.velocity_m_per_s[i], k4.velocity_m_per_s[i]);
    }
    *io_state = moved(io_state, &slope, h_s / 6);
}

/// The input over one sample, its end included.
static void fill_sample(const struct cubic_input *input, size_t sample, double out_force_N[cubic_points_per_sample + 1])
{
    const size_t points = input->samples * cubic_points_per_sample;
    for (size_t i = 0; i <= cubic_points_per_sample; i++) {
        const size_t point = sample * cubic_points_per_sample + (input->held ? 0 : i);
        out_force_N[i] = input->force_N[point < points ? point : 0];
    }
}

void cubic_plant_play(const struct cubic_plant *self, const struct cubic_input *input, double sample_s, size_t periods,
                      struct cubic_state *io_state, double *out_position_m)
{
    const struct equations equations = {.plant = self,
                                        .per_mass_per_kg = {1.0 / self->mass_kg[0], 1.0 / self->mass_kg[1]}};
    struct cubic_state state = *io_state;
    for (size_t n = 0; n < periods * input->samples; n++) {
        double force_N[cubic_points_per_sample + 1];
        fill_sample(input, n % input->samples, force_N);
        if (out_position_m) {
            out_position_m[n] = state.position_m[0];
        }
        for (size_t i = 0; i < cubic_points_per_sample; i += 2) {
            step(&equations, &force_N[i], sample_s / cubic_substeps, &state);
        }
    }
    *io_state = state;
}

double complex cubic_plant_response(const struct cubic_plant *self, double frequency_hz)
{
    const double complex s = I * two_pi * frequency_hz;
    const double complex between = self->stiffness_N_per_m[1] + s * self->damping_Ns_per_m[1];
    const double complex first =
        self->mass_kg[0] * s * s + s * self->damping_Ns_per_m[0] + self->stiffness_N_per_m[0] + between;
    const double complex second = self->mass_kg[1] * s * s + between;
    return between / (first * second - between * between);
}

double complex cubic_plant_printed_response(double frequency_hz)
{
    const double complex s = I * two_pi * frequency_hz;
    return (5.0 * s + 2000.0) / ((s * s + 1.561 * s + 3273.0) * (s * s + 0.4394 * s + 187.0));
}

void cubic_plant_linearise(const struct cubic_plant *self, double out_A[4][4], double out_B[4][2])
{
    const double *m = self->mass_kg, *c = self->damping_Ns_per_m, *k = self->stiffness_N_per_m;
    const double A[4][4] = {
        {0.0, 0.0, 1.0, 0.0},
        {0.0, 0.0, 0.0, 1.0},
        {-(k[0] + k[1]) / m[0], k[1] / m[0], -(c[0] + c[1]) / m[0], c[1] / m[0]},
        {k[1] / m[1], -k[1] / m[1], c[1] / m[1], -c[1] / m[1]},
    };
    for (size_t i = 0; i < 4; i++) {
        for (size_t j = 0; j < 4; j++) {
            out_A[i][j] = A[i][j];
        }
        for (size_t p = 0; p < 2; p++) {
            out_B[i][p] = i == p + 2 ? 1.0 / m[p] : 0.0;
        }
    }
}
