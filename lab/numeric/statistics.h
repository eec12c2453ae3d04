/* SPDX-License-Identifier: MIT */
/// Distributions that confidence regions and tests need, and random numbers that are the same on every machine.
/// Real degrees of freedom throughout: a complex number counts as two.
#ifndef SERVOSCOPE_NUMERIC_STATISTICS_H
#define SERVOSCOPE_NUMERIC_STATISTICS_H

#include <stddef.h>
#include <stdint.h>

/// Returns P(X <= x) of the chi-square distribution, the regularised lower incomplete gamma function P(dof/2, x/2).
/// Range:  dof > 0, x >= 0; relative error below 1e-12 (1e-9 for dof beyond 1e4); NaN outside the range
/// Test:   tests/unit/test_statistics.c
double statistics_chi2_cdf(double x, double dof);

/// Returns P(X > x) of the chi-square distribution; keeps its digits where the probability is tiny.
double statistics_chi2_tail(double x, double dof);

/// Returns P(X <= x) of the F distribution, the regularised incomplete beta function I_z(d1/2, d2/2),
/// z = d1 x / (d1 x + d2).
/// Range:  d1, d2 > 0, x >= 0; NaN outside
double statistics_f_cdf(double x, double d1, double d2);

/// Returns P(X > x) of the F distribution; keeps its digits where the probability is tiny.
double statistics_f_tail(double x, double d1, double d2);

/// Returns x with P(X <= x) = probability.
/// Range:  0 < probability < 1; NaN outside
double statistics_chi2_quantile(double probability, double dof);
double statistics_f_quantile(double probability, double d1, double d2);

/// Returns the median (mean of the two middle values for an even count); reorders `values`. NaN if count is 0.
double statistics_median(double *values, size_t count);

/// Generator xoshiro256++ (Blackman, Vigna), seeded through splitmix64. Same seed, same numbers, on every machine.
struct random {
    uint64_t state[4];
};

void random_seed(struct random *self, uint64_t seed);
uint64_t random_bits(struct random *self);
/// Uniform in [0, 1), 53 bits.
double random_uniform(struct random *self);
/// Standard normal (Box and Muller, both uniform draws used for one number, so that a draw has no memory).
double random_normal(struct random *self);

#endif
