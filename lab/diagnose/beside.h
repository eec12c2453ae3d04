/* SPDX-License-Identifier: MIT */
/// What a change of the residual would explain beside everything that a fitted hypothesis can move: linear least
/// squares about the fit, its own columns taken out once, so that a look at one change more costs a few products.
#ifndef SERVOSCOPE_DIAGNOSE_BESIDE_H
#define SERVOSCOPE_DIAGNOSE_BESIDE_H

#include "lab/diagnose/fit.h"

struct beside {
    size_t rows;    ///< data->values
    size_t length;  ///< and one for each coordinate: the priors, and what the contrasts say
    size_t columns; ///< of the basis: coordinates at a wall of their box cannot move and are not in it
    double *basis;  ///< length x columns, orthonormal
    double *rest;   ///< length: what no coordinate can explain of the residual
    double cost;    ///< |rest|^2: the fit's cost but for what contrasts have of it, if the fit is where it wants to be
    double *work;   ///< two columns
};

/// Errors: false if memory is short.
bool beside_init(struct beside *self, const struct fit_data *data, const struct hypothesis *hypothesis,
                 const struct fit *fit);
void beside_free(struct beside *self);

/// Cost that is left if the residual may change by any multiples of one or two columns (rows each, one after the other)
/// beside the coordinates; out_sizes: the best multiples, zero for a column that adds nothing of its own.
double beside_cost(const struct beside *self, const double *columns, size_t count, double *out_sizes);

#endif
