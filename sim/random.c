/* SPDX-License-Identifier: MIT */
#include "sim/random.h"

#include <math.h>

void sim_random_seed(uint64_t state[4], uint64_t seed)
{
    for (int i = 0; i < 4; i++) {
        seed += 0x9E3779B97F4A7C15u;
        uint64_t z = seed;
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
        z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
        state[i] = z ^ (z >> 31);
    }
}

static uint64_t rotated(uint64_t x, int bits)
{
    return (x << bits) | (x >> (64 - bits));
}

uint64_t sim_random_bits(uint64_t state[4])
{
    uint64_t result = rotated(state[1] * 5, 7) * 9;
    uint64_t t = state[1] << 17;
    state[2] ^= state[0];
    state[3] ^= state[1];
    state[1] ^= state[2];
    state[0] ^= state[3];
    state[2] ^= t;
    state[3] = rotated(state[3], 45);
    return result;
}

double sim_random_uniform(uint64_t state[4])
{
    return ((double)(sim_random_bits(state) >> 11) + 0.5) * 0x1p-53;
}

double sim_random_normal(uint64_t state[4])
{
    const double turn = 6.283185307179586;
    double u = sim_random_uniform(state);
    double v = sim_random_uniform(state);
    return sqrt(-2.0 * log(u)) * cos(turn * v);
}
