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

/// One pair of orders; `fitted` false: the data do not determine it; `judged` false: it is out of the question, or
/// three quarters of the lines do not determine it.
struct parametric_order_row {
    size_t numerator_order, denominator_order, parameters;
    bool fitted, judged, stable;
    /// It has a pole and a zero in one place (parametric_mark_cancelling), or a pole above all lines that they do not
    /// determine: its frequency is less than two standard deviations.
    bool doubtful;
    double cost, cost_expected;
    double mdl;      ///< parametric_description_length()
    double held_out; ///< mean |residual|^2 of lines not fitted; 0 unless judged
};

struct parametric_orders {
    size_t count;
    struct parametric_order_row rows[parametric_rows_max];
    size_t by_mdl;      ///< row of least mdl
    size_t by_held_out; ///< row with fewest parameters that chance alone makes worse than the best: within one standard
                        ///< error of the lines' differences
    /// As few poles as a row has that is stable, not doubtful, and that no larger such row surely betters: that noise
    /// alone gains as much has a chance below one in a thousand (F test, counting that a resonance could be found at
    /// any line), and lines not fitted agree by more than one standard error. Description length alone adds poles that
    /// are not there in every eighth fit.
    /// Of the rows with as many poles: of a discrete model the one with as many zeros, of a continuous one that which
    /// Akaike's criterion prefers; what is left out or taken by mistake moves the response by more than its deviations
    /// say.
    size_t chosen;
    char why[320]; ///< one sentence
};

/// lines log(V / lines) + lines p log(2 lines) / (2 lines - p - 2), in nats; infinite without spare lines.
double parametric_description_length(size_t lines, size_t parameters, double cost);

/// Fits every numerator order from its lowest power up to each denominator order.
/// Errors: error_refused as parametric_fit if no pair can be fitted; outputs are zeroed then
/// Cost:   a fit for each pair, five for those within 40 nats of the shortest description
/// Test:   tests/unit/test_parametric_orders.c
int parametric_orders_choose(const struct parametric_data *data, const struct parametric_orders_options *options,
                             struct parametric_orders *out_orders, struct parametric_model *out_model,
                             struct error *out_error);

#endif
