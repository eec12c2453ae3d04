/* SPDX-License-Identifier: MIT */
/// What the tests of the DFT hold it against: random words, bins, and sums of integers that nothing can overflow.
#ifndef SERVOSCOPE_TESTS_SUPPORT_EXACT_SUM_H
#define SERVOSCOPE_TESTS_SUPPORT_EXACT_SUM_H

#include "unity.h"

#include <stdint.h>
#include <stdio.h>

/// The upper half of Knuth's MMIX generator's state.
static inline uint32_t exact_random_u32(uint64_t *io_state)
{
    *io_state = *io_state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*io_state >> 32);
}

/// At most `most` bins spread over 1 .. below N/2, both ends included. Returns how many.
static inline uint32_t exact_spread_bins(uint32_t period, uint32_t most, uint32_t *out_bins)
{
    uint32_t last = (period - 1u) / 2u, count = 0;
    for (uint32_t i = 0; i < most && i < last; i++) {
        uint32_t bin = most >= last ? i + 1u : 1u + (uint32_t)((uint64_t)i * (last - 1u) / (most - 1u));
        if (count == 0 || bin > out_bins[count - 1u])
            out_bins[count++] = bin;
    }
    return count;
}

/// high 2^32 + low, 0 <= low < 2^32: 95 bits, far beyond any sum here, on any machine.
struct exact_sum {
    int64_t high, low;
};

static inline void exact_sum_add(struct exact_sum *self, int64_t value)
{
    const int64_t base = INT64_C(1) << 32;
    int64_t low = (value % base + base) % base;
    self->low += low;
    self->high += (value - low) / base + self->low / base;
    self->low %= base;
}

static inline void exact_sum_expect(const struct exact_sum *expected, int64_t actual, uint32_t period, uint32_t bin)
{
    char message[64];
    struct exact_sum found = {0, 0};
    exact_sum_add(&found, actual);
    snprintf(message, sizeof message, "N = %u, bin %u", (unsigned)period, (unsigned)bin);
    TEST_ASSERT_EQUAL_INT64_MESSAGE(expected->high, found.high, message);
    TEST_ASSERT_EQUAL_INT64_MESSAGE(expected->low, found.low, message);
}

#endif
