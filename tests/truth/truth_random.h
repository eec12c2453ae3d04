/* SPDX-License-Identifier: MIT */
#ifndef TRUTH_RANDOM_H
#define TRUTH_RANDOM_H

#include <stdint.h>

/// Random numbers of the truth plant: PCG-XSH-RR 64/32 (O'Neill 2014), so that a seed gives the same case on any
/// machine whatever its libc. Streams with one seed are independent of each other.
struct truth_random {
    uint64_t state;
    uint64_t increment;
    double spare;
    int has_spare;
};

/// Start stream `stream` of `seed`.
void truth_random_init(struct truth_random *self, uint64_t seed, uint64_t stream);
/// 32 random bits.
uint32_t truth_random_bits(struct truth_random *self);
/// Uniform in [lo, hi).
double truth_random_uniform(struct truth_random *self, double lo, double hi);
/// Uniform in the logarithm over [lo, hi); both positive.
double truth_random_log_uniform(struct truth_random *self, double lo, double hi);
/// +1 or -1.
double truth_random_sign(struct truth_random *self);
/// Whole number in lo..hi, both included.
int truth_random_integer(struct truth_random *self, int lo, int hi);
/// Normal, mean 0, variance 1 (Marsaglia's polar method).
double truth_random_normal(struct truth_random *self);

#endif
