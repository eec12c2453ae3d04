/* SPDX-License-Identifier: MIT */
/// Two masses on cubic springs, the second paper's plant, and what is known of it exactly: (9.1) to (9.4).
///
///     m1 q1'' = -c1 q1' - k1(q1) + k2(e) + c2 e' + u1     e = q2 - q1
///     m2 q2'' = -k2(e) - c2 e' + u2                       k_i(x) = a_i x + b_i x^2 + d_i x^3
///
/// The paper excites mass 2 and measures the position of mass 1. Its second "c1" is c2: only so (9.4) comes out.
/// Nothing of sim/ is used here.
#ifndef SERVOSCOPE_TESTS_SUPPORT_CUBIC_PLANT_H
#define SERVOSCOPE_TESTS_SUPPORT_CUBIC_PLANT_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

struct cubic_plant {
    double mass_kg[2];
    double damping_Ns_per_m[2];
    double stiffness_N_per_m[2];
    double quadratic_N_per_m2[2]; ///< none in the paper
    double cubic_N_per_m3[2];
};

struct cubic_state {
    double position_m[2];
    double velocity_m_per_s[2];
};

enum {
    cubic_substeps = 4,                           ///< of the integration, in a sample
    cubic_points_per_sample = 2 * cubic_substeps, ///< of the input: its ends and middle in each substep
};

/// The paper's numbers.
extern const struct cubic_plant cubic_plant_paper;

/// One period of input for cubic_plant_play().
struct cubic_input {
    size_t samples;        ///< in the period
    const double *force_N; ///< cubic_points_per_sample * samples values
    bool held; ///< the value at the sample holds until the next, as behind a drive's output; else it moves on
};

/// Plays whole periods through the plant from the state given, by the classical Runge-Kutta method of order 4.
/// Shapes:    out_position_m: periods x input->samples, mass 1 at the sampling instants; NULL: not wanted (settling)
/// Units:     sample_s: time between samples
void cubic_plant_play(const struct cubic_plant *self, const struct cubic_input *input, double sample_s, size_t periods,
                      struct cubic_state *io_state, double *out_position_m);

/// Response of the linearised plant from the force on mass 2 to the position of mass 1.
double complex cubic_plant_response(const struct cubic_plant *self, double frequency_hz);

/// The same as printed in (9.4).
double complex cubic_plant_printed_response(double frequency_hz);

/// The linearised plant as x' = A x + B u, x = (q1, q2, q1', q2'), u a force on each mass.
void cubic_plant_linearise(const struct cubic_plant *self, double out_A[4][4], double out_B[4][2]);

#endif
