/* SPDX-License-Identifier: MIT */
/// From spectra to a model without being told orders or delay: weights, delay, orders, what the model misses, what its
/// poles are worth, and the drive behind the hold.
#ifndef SERVOSCOPE_ESTIMATE_PARAMETRIC_IDENTIFY_H
#define SERVOSCOPE_ESTIMATE_PARAMETRIC_IDENTIFY_H

#include "lab/estimate/parametric_orders.h"
#include "lab/estimate/parametric_variance.h"

/// What is known of a model beforehand.
struct parametric_request {
    enum parametric_domain domain;
    bool delay_free; ///< a delay is estimated whatever the data say
};

struct parametric_outcome {
    bool made;
    /// Standard deviations allow for what the model misses.
    struct parametric_model model;
    struct parametric_model noise; ///< the same with what noise alone does
    struct parametric_orders orders;
    double variance_dof; ///< complex, of a line's variance; 0: none was estimated
    size_t pooled_lines; ///< whose scatter was taken together; 1: each line has its own
    /// Cost by the noise alone against its expected value; misfit: their ratio where it is beyond chance, else 1.
    double noise_cost, noise_cost_expected, noise_cost_std, misfit;
    bool has_plant; ///< of a discrete model: the drive without the hold
    struct parametric_model plant;
    char hint[320]; ///< what setup the data speak for, if it is not that of the domain; empty: nothing to say
};

/// Identifies a model.
///
/// Weights:  parametric_weights_pool; where the best model misses more than noise explains, the data's variances are
///           raised by parametric_weights_add_distortion, and delay and orders are chosen again
/// Delay:    parametric_delay_find
/// Misfit:   what still is beyond chance then inflates the standard deviations
/// Hint:     models of the other kind (z for s, s for z) describe the data in 10 nats less, or with fewer poles in 2
///           less
/// Errors:   error_refused as parametric_orders_choose; *out_outcome is zeroed then
/// Test:     tests/unit/test_parametric_identify.c, bench/parametric.c
int parametric_identify(struct parametric_data *io_data, const struct parametric_weights *weights,
                        const struct parametric_request *request, struct parametric_outcome *out_outcome,
                        struct error *out_error);

#endif
