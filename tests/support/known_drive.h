/* SPDX-License-Identifier: MIT */
/// Drives whose equations are known, sampled exactly: responses to give to the tuner, and the closed loop's poles to
/// hold its verdicts against.
#ifndef SERVOSCOPE_TESTS_SUPPORT_KNOWN_DRIVE_H
#define SERVOSCOPE_TESTS_SUPPORT_KNOWN_DRIVE_H

#include "lab/record/frf_file.h"

#include <complex.h>
#include <lapacke.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { known_order_max = 4, known_loop_max = known_order_max + 8 };

static const double known_two_pi = 6.283185307179586;

/// x' = A x + B u, y = C x, with the torque held between samples.
struct known_drive {
    size_t order;
    double rate_hz;
    size_t delay_samples; ///< of the torque
    double A[known_order_max][known_order_max], B[known_order_max], C[known_order_max];
    double Ad[known_order_max][known_order_max], Bd[known_order_max];
};

/// Exact sampling: the exponential of [A B; 0 0] Ts by scaling and squaring of a Taylor series.
static inline void known_drive_sample(struct known_drive *self)
{
    enum { size = known_order_max + 1, squarings = 12, terms = 20 };
    double M[size][size] = {{0}}, E[size][size] = {{0}}, T[size][size], P[size][size];
    const size_t n = self->order;
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++)
            M[i][j] = self->A[i][j] / self->rate_hz / (1 << squarings);
        M[i][n] = self->B[i] / self->rate_hz / (1 << squarings);
    }
    for (size_t i = 0; i < size; i++)
        E[i][i] = 1.0;
    memcpy(T, E, sizeof T);
    for (int term = 1; term <= terms + squarings; term++) {
        const int squaring = term > terms;
        for (size_t i = 0; i < size; i++)
            for (size_t j = 0; j < size; j++) {
                P[i][j] = 0.0;
                for (size_t k = 0; k < size; k++)
                    P[i][j] += squaring ? E[i][k] * E[k][j] : T[i][k] * M[k][j] / term;
            }
        memcpy(squaring ? E : T, P, sizeof P);
        for (size_t i = 0; i < size && !squaring; i++)
            for (size_t j = 0; j < size; j++)
                E[i][j] += T[i][j];
    }
    for (size_t i = 0; i < n; i++) {
        memcpy(self->Ad[i], E[i], n * sizeof E[0][0]);
        self->Bd[i] = E[i][n];
    }
}

/// Torque to velocity of one inertia.
static inline struct known_drive known_rigid(double rate_hz, size_t delay_samples, double inertia_kgm2,
                                             double friction_Nms_per_rad)
{
    struct known_drive drive = {.order = 1, .rate_hz = rate_hz, .delay_samples = delay_samples, .C = {1.0}};
    drive.A[0][0] = -friction_Nms_per_rad / inertia_kgm2;
    drive.B[0] = 1.0 / inertia_kgm2;
    known_drive_sample(&drive);
    return drive;
}

/// Torque to motor velocity of two inertias on a belt, bearing friction on each.
static inline struct known_drive known_two_mass(double rate_hz, size_t delay_samples, double motor_kgm2,
                                                double load_kgm2, double stiffness_Nm_per_rad,
                                                double damping_Nms_per_rad, double bearing_Nms_per_rad)
{
    const double k = stiffness_Nm_per_rad, c = damping_Nms_per_rad, b = bearing_Nms_per_rad;
    struct known_drive drive = {.order = 3, .rate_hz = rate_hz, .delay_samples = delay_samples, .C = {1.0}};
    const double A[3][3] = {{-(c + b) / motor_kgm2, -k / motor_kgm2, c / motor_kgm2},
                            {1.0, 0.0, -1.0},
                            {c / load_kgm2, k / load_kgm2, -(c + b) / load_kgm2}};
    for (size_t i = 0; i < 3; i++)
        memcpy(drive.A[i], A[i], sizeof A[i]);
    drive.B[0] = 1.0 / motor_kgm2;
    known_drive_sample(&drive);
    return drive;
}

/// A strictly proper transfer function: numerator and denominator from the highest power down, denominator[0] != 0.
static inline struct known_drive known_transfer(double rate_hz, size_t delay_samples, size_t order,
                                                const double *numerator, const double *denominator)
{
    struct known_drive drive = {.order = order, .rate_hz = rate_hz, .delay_samples = delay_samples};
    for (size_t j = 0; j < order; j++) {
        drive.A[0][j] = -denominator[j + 1] / denominator[0];
        drive.C[j] = numerator[j] / denominator[0];
        if (j + 1 < order)
            drive.A[j + 1][j] = 1.0;
    }
    drive.B[0] = 1.0;
    known_drive_sample(&drive);
    return drive;
}

/// Response at delay = exp(-j w Ts): C (z I - Ad)^-1 Bd and the torque's delay.
static inline double complex known_response(const struct known_drive *self, double complex delay)
{
    double complex M[known_order_max][known_order_max + 1];
    const size_t n = self->order;
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++)
            M[i][j] = (i == j ? 1.0 / delay : 0.0) - self->Ad[i][j];
        M[i][n] = self->Bd[i];
    }
    for (size_t p = 0; p < n; p++) {
        size_t best = p;
        for (size_t i = p + 1; i < n; i++)
            best = cabs(M[i][p]) > cabs(M[best][p]) ? i : best;
        for (size_t j = 0; j <= n; j++) {
            const double complex swap = M[p][j];
            M[p][j] = M[best][j];
            M[best][j] = swap;
        }
        for (size_t i = 0; i < n; i++) {
            const double complex factor = i == p ? 0.0 : M[i][p] / M[p][p];
            for (size_t j = p; j <= n; j++)
                M[i][j] -= factor * M[p][j];
        }
    }
    double complex sum = 0.0;
    for (size_t i = 0; i < n; i++)
        sum += self->C[i] * M[i][n] / M[i][i];
    return sum * cpow(delay, (double)self->delay_samples);
}

/// Largest modulus of the closed loop's poles with u = Kp e + Ki Ts sum e, the present e included, e = -y.
static inline double known_worst_pole(const struct known_drive *self, double Kp, double Ki)
{
    const size_t n = self->order, d = self->delay_samples, size = n + d + 1, sum = n + d;
    double M[known_loop_max * known_loop_max] = {0}, real[known_loop_max], imag[known_loop_max], worst = 0.0;
    const double Ts = 1.0 / self->rate_hz;
    double u[known_loop_max] = {0}; // torque asked for, as a row over the states
    for (size_t j = 0; j < n; j++)
        u[j] = -(Kp + Ki * Ts) * self->C[j];
    u[sum] = Ki * Ts;
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < size; j++) {
            const double torque = d == 0 ? u[j] : (j == n ? 1.0 : 0.0); // states n .. n + d - 1: oldest torque first
            M[i * size + j] = (j < n ? self->Ad[i][j] : 0.0) + self->Bd[i] * torque;
        }
    for (size_t i = 0; i < d; i++)
        for (size_t j = 0; j < size; j++)
            M[(n + i) * size + j] = i + 1 < d ? (j == n + i + 1 ? 1.0 : 0.0) : u[j];
    for (size_t j = 0; j < n; j++)
        M[sum * size + j] = -self->C[j];
    M[sum * size + sum] = 1.0;
    LAPACKE_dgeev(LAPACK_ROW_MAJOR, 'N', 'N', (lapack_int)size, M, (lapack_int)size, real, imag, NULL, 1, NULL, 1);
    for (size_t i = 0; i < size; i++) {
        // Without an integral the sum stays a pole at 1 that nobody sees.
        const int unseen = Ki == 0.0 && hypot(real[i] - 1.0, imag[i]) < 1e-12;
        worst = unseen ? worst : fmax(worst, hypot(real[i], imag[i]));
    }
    return worst;
}

/// Response file content: lines at first, first + step, ...; std 0 where the noise is 0.
static inline struct frf known_frf(const struct known_drive *drive, double first_hz, double step_hz, size_t count)
{
    struct frf frf;
    struct error error;
    if (frf_alloc(&frf, count, &error) || !frf_set_text(&frf.input, "torque_ref_Nm") ||
        !frf_set_text(&frf.output, "velocity_rad_per_s") || !frf_set_text(&frf.units, "rad_per_s/Nm") ||
        !frf_set_text(&frf.method, "mean"))
        abort();
    frf.keys = calloc(1, sizeof *frf.keys);
    char rate[40];
    snprintf(rate, sizeof rate, "%.17g", drive->rate_hz);
    if (!frf.keys || !frf_set_text(&frf.keys[0].key, "sample_rate_hz") || !frf_set_text(&frf.keys[0].value, rate))
        abort();
    frf.key_count = 1;
    for (size_t k = 0; k < count; k++) {
        frf.frequency_hz[k] = first_hz + step_hz * (double)k;
        const double complex G = known_response(drive, cexp(-I * known_two_pi * frf.frequency_hz[k] / drive->rate_hz));
        frf.real[k] = creal(G);
        frf.imag[k] = cimag(G);
        frf.valid[k] = true;
    }
    return frf;
}

#endif
