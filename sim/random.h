/* SPDX-License-Identifier: MIT */
/// Random numbers of the simulation: xoshiro256** (Blackman, Vigna 2018), seeded through splitmix64; same seed, same
/// numbers.
#ifndef SERVOSCOPE_SIM_RANDOM_H
#define SERVOSCOPE_SIM_RANDOM_H

#include <stdint.h>

/// Fills the four words of state from any seed, zero included.
void sim_random_seed(uint64_t state[4], uint64_t seed);
/// 64 random bits.
uint64_t sim_random_bits(uint64_t state[4]);
/// Uniform in (0, 1): 53 bits, never 0 or 1.
double sim_random_uniform(uint64_t state[4]);
/// Standard normal, by Box and Muller; two uniforms a call, so that the stream never depends on the values.
double sim_random_normal(uint64_t state[4]);

#endif
