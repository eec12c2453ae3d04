/* SPDX-License-Identifier: MIT */
/// Relative amplitudes by the limits, and what they alone already say about any design.
#ifndef SERVOSCOPE_DESIGN_SPECTRUM_H
#define SERVOSCOPE_DESIGN_SPECTRUM_H

#include "lab/design/design.h"

enum design_signal {
    design_position,
    design_velocity,
    design_acceleration,
    design_signal_count,
};

/// Position amplitudes A_k with frequencies; the derivative of order s has amplitude (2 pi f_k)^s A_k.
struct design_spectrum {
    size_t line_count;
    const uint32_t *bins; ///< the request's
    double *omega_rad_per_s;
    double *amplitude_rad;             ///< A_k; by the limits: each line alone just reaches its tightest one
    double limit[design_signal_count]; ///< INFINITY if free; acceleration: the tighter of its own and torque / inertia
};

/// A_k = min(q_max, v_max / w_k, a_max / w_k^2)     (first paper, 3.4), or by request->torque_shape.
/// Returns false if memory is short.
bool design_spectrum_create(const struct design_request *request, struct design_spectrum *out_spectrum);
void design_spectrum_free(struct design_spectrum *spectrum);

/// Amplitude of one line of one signal, without c_A.
double design_spectrum_amplitude(const struct design_spectrum *self, enum design_signal signal, size_t line);

/// Root of the mean square of one signal, without c_A; any phases.
double design_spectrum_rms(const struct design_spectrum *self, enum design_signal signal);

/// Largest c_A that any phases can reach within the limits.
/// Equation:  |u|_max^2 >= sum_k B_k^2 / 2 (1 + (f_k / f_max)^2), from the inequality of Bernstein and Szego
///            u'^2 + W^2 u^2 <= W^2 |u|_max^2 averaged over a period.
/// `points_per_period` > 0: the limits hold at that many equal steps only, which weakens it by the cosine of
/// pi k_max / points (Ehlich and Zeller), but never below the trivial |u|_max >= rms.
double design_spectrum_scale_bound(const struct design_spectrum *self, size_t points_per_period);

#endif
