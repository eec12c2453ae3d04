/* SPDX-License-Identifier: MIT */
/// Means of complex values that scatter in circles, and how sure they are.
#ifndef SERVOSCOPE_ESTIMATE_CIRCLE_H
#define SERVOSCOPE_ESTIMATE_CIRCLE_H

#include <complex.h>
#include <stddef.h>

/// Mean and sample variance of `count` complex values.
/// Equation:  mean = 1/M sum x_m;   variance = 1/(M-1) sum |x_m - mean|^2, of one value, both parts together
struct circle {
    size_t count;
    double complex mean;
    double variance; ///< 0 for a single value
};

/// Takes column `column` of rows x columns values.
struct circle circle_of_column(const double complex *values, size_t rows, size_t columns, size_t column);

/// Returns the chance that circular normal scatter alone moves the mean this far from zero:
/// M |mean|^2 / variance ~ F(2, 2(M-1)), whose tail is (1 + F/(M-1))^-(M-1). 0 for a single value or without scatter,
/// 1 if the mean is zero.
double circle_chance_of_zero(const struct circle *self);

/// Returns how many times its variance over `count` values the power of a mean must be, for scatter alone to explain it
/// with less than `chance`: count |mean|^2 / variance > ratio is circle_chance_of_zero < chance, without its
/// logarithms.
double circle_certain_ratio(double chance, size_t count);

/// Returns the factor c for which |error| <= c std holds with the given probability.
/// std = sqrt(E|error|^2) is itself an estimate, with dof_complex complex degrees of freedom (M - 1 for M periods).
///
/// Equation: c^2 = quantile of F(2, 2 dof) = dof ((1 - p)^(-1/dof) - 1)
///           3.555 at 95 % and M = 10, -ln 0.05 = 2.996 without limit
/// Range:    0 < probability < 1, dof_complex > 0 (not only whole numbers); NaN outside
double circle_confidence_factor(double probability, double dof_complex);

#endif
