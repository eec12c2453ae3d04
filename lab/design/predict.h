/* SPDX-License-Identifier: MIT */
/// How uncertain the frequency response of a drive will be, before anything moves: from a model of the drive with its
/// noise, the table, and the number of periods.
#ifndef SERVOSCOPE_DESIGN_PREDICT_H
#define SERVOSCOPE_DESIGN_PREDICT_H

#include "lab/design/design.h"
#include "sim/model.h"

struct design_predict_plan {
    size_t periods;   ///< counted periods P of the table, >= 1
    bool torque_mode; ///< the table drives the torque alone; else it is the reference of the cascade
};

/// Predicts the standard deviation of the response from torque to velocity, line by line: what `frf --method mean` is
/// expected to put into its column std.
///
/// Equation:  var G = (E |E_k|^2 + |G|^2 N s_u^2) / (P |U|^2),   E_k = Y_k - G U_k of one period without torque noise
///            U, Y: noise-free spectra of a settled period of the simulated drive in the chosen mode, G = Y / U; s_u
///            the sensor's torque noise. Every other source i (torque on the motor, velocity sensor, position sensor
///            with the encoder's q^2/12) is white, a sequence of independent pulses, and E_k is linear in them: with
///            y_i, u_i what a pulse of one standard deviation moves velocity and torque,
///
///                E |E_k|^2 = sum_i sum_m |sum_{n=0}^{N-1} (y_i[n - m] - G u_i[n - m]) exp(-j 2 pi k n / N)|^2
///
///            over all pulses m before and in the period; less 2/P of what neighbouring periods have in common,
///            because `std` comes from the scatter around their mean. Away from the lowest lines that is
///            N |F|^2 s_v^2 + N |G_d|^2 s_d^2, F the velocity filter and G_d the response to torque on the motor (G
///            without lag and dead time): what the controllers make of noise is in U as much as in Y, and cancels. What
///            does not cancel is that the motion it causes ends a period elsewhere than it began: that leaks into every
///            line as 1 / (exp(j w) - 1), rules the lowest lines in closed loop, and doubles the variance of a free
///            axis in open loop. The sum over pulses before the period has it. (In closed loop `std` is pessimistic
///            about it: one period ends where the next begins, so that their mean has less of it.)
/// Shapes:    out_std: result->bin_count values
/// Units:     rad/s per Nm (linear: m/s per N), sqrt(E |error|^2) of the complex value, as `std` of an FRF file
/// Validity:  noise small beside the motion: dry friction is linearised along the noise-free motion, at 8 places of the
///            period. A loop that rings for longer than a period makes more distant periods alike too, which is
///            not in it. In open loop an axis with dry friction drifts further from that motion the longer it runs
/// Errors:    error_usage: no periods; error_refused: a model that is none, or of another rate or kind of axis than the
///            request, that hits its end stops or leaves all bounds, a line without torque; memory is short
/// Cost:      some 10 N samples of simulation per noise source (8 times that with dry friction), and as many times K
///            multiplications
/// Test:      tests/unit/test_design_predict.c
int design_predict_std(const struct sim_model *model, const struct design_request *request,
                       const struct design_result *result, const struct design_predict_plan *plan, double *out_std,
                       struct error *out_error);

#endif
