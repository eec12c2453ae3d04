/* SPDX-License-Identifier: MIT */
#include "tests/truth/truth_random.h"

#include <math.h>

uint32_t truth_random_bits(struct truth_random *self)
{
    uint64_t old = self->state;
    self->state = old * 6364136223846793005ULL + self->increment;
    uint32_t mixed = (uint32_t)(((old >> 18) ^ old) >> 27);
    uint32_t turn = (uint32_t)(old >> 59);
    return (mixed >> turn) | (mixed << ((32u - turn) & 31u));
}

void truth_random_init(struct truth_random *self, uint64_t seed, uint64_t stream)
{
    *self = (struct truth_random){.increment = (stream << 1) | 1u};
    truth_random_bits(self);
    self->state += seed;
    truth_random_bits(self);
}

double truth_random_uniform(struct truth_random *self, double lo, double hi)
{
    uint64_t high = truth_random_bits(self) >> 5;
    uint64_t low = truth_random_bits(self) >> 6;
    double unit = (double)(high * 67108864u + low) / 9007199254740992.0;
    return lo + (hi - lo) * unit;
}

double truth_random_log_uniform(struct truth_random *self, double lo, double hi)
{
    return exp(truth_random_uniform(self, log(lo), log(hi)));
}

double truth_random_sign(struct truth_random *self)
{
    return truth_random_bits(self) >> 31 ? 1.0 : -1.0;
}

int truth_random_integer(struct truth_random *self, int lo, int hi)
{
    return lo + (int)floor(truth_random_uniform(self, 0.0, (double)(hi - lo + 1)));
}

double truth_random_normal(struct truth_random *self)
{
    if (self->has_spare) {
        self->has_spare = 0;
        return self->spare;
    }
    double a, b, square;
    do {
        a = truth_random_uniform(self, -1.0, 1.0);
        b = truth_random_uniform(self, -1.0, 1.0);
        square = a * a + b * b;
    } while (!(square > 0.0 && square < 1.0));
    double scale = sqrt(-2.0 * log(square) / square);
    self->spare = b * scale;
    self->has_spare = 1;
    return a * scale;
}
