/* SPDX-License-Identifier: MIT */
/// Which orders a transfer function should have: all of them are fitted, and judged by description length and by data
/// that the fit has not seen.
#ifndef SERVOSCOPE_ESTIMATE_PARAMETRIC_ORDERS_H
#define SERVOSCOPE_ESTIMATE_PARAMETRIC_ORDERS_H

#include "lab/estimate/parametric.h"

enum { parametric_rows_max = parametric_order_max * (parametric_order_max + 3) / 2 };

struct parametric_orders_options {
    struct parametric_structure structure;   ///< everything but the two orders
    size_t denominator_min, denominator_max; ///< 0: 1 and 6
    /// Spectra of other periods to judge by, settled; NULL: every fourth line in turn is held out.
    const struct parametric_data *held_out;
};

/// One pair of orders; `fitted` false: the data do not determine it.
struct parametric_order_row {
    size_t numerator_order, denominator_order, parameters;
    bool fitted, stable;
    double cost, cost_expected;
    double mdl;      ///< lines (log(V / lines) + p log(2 lines) / (2 lines - p - 2)) for p parameters
    double held_out; ///< mean |residual|^2 of lines not fitted
};

struct parametric_orders {
    size_t count;
    struct parametric_order_row rows[parametric_rows_max];
    size_t by_mdl;      ///< row of least mdl
    size_t by_held_out; ///< row with fewest parameters that chance alone makes worse than the best: within one standard
                        ///< error of the lines' differences
    size_t chosen; ///< by_mdl, unless its held-out error is beyond two standard errors of the best: then by_held_out;
                   ///< if that is unstable, the stable row of least mdl within two standard errors of the best
    char why[320]; ///< one sentence
};

/// Fits every numerator order from its lowest power up to each denominator order.
/// Errors: error_refused as parametric_fit if no pair can be fitted; outputs are zeroed then
/// Cost:   five fits a pair
/// Test:   tests/unit/test_parametric_orders.c
int parametric_orders_choose(const struct parametric_data *data, const struct parametric_orders_options *options,
                             struct parametric_orders *out_orders, struct parametric_model *out_model,
                             struct error *out_error);

#endif
