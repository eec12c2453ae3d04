/* SPDX-License-Identifier: MIT */
/// A table for tests of a measurement: equal torques on the lowest lines, and the motion of a rigid body under them.
#ifndef SERVOSCOPE_TESTS_SUPPORT_RIGID_TABLE_H
#define SERVOSCOPE_TESTS_SUPPORT_RIGID_TABLE_H

#include "lab/measure/table_bytes.h"
#include "lab/numeric/statistics.h"
#include "lab/record/table_file.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <math.h>
#include <stdint.h>

struct rigid_table {
    double rate_hz;
    uint32_t length, lines; ///< samples of a period; lines 1, 2, .. lines
    double torque_Nm;       ///< of each line
    double inertia_kgm2;
    uint64_t seed; ///< of the phases; 0: they grow with the square of the line's number
};

/// Writes the table among the test's files and reads it back, as a measurement does.
static inline void rigid_table_make(const struct rigid_table *self, struct table_bytes *out_table)
{
    const double two_pi = 6.283185307179586476925, acceleration = self->torque_Nm / self->inertia_kgm2;
    struct error error = {0};
    struct table made;
    struct random random;
    random_seed(&random, self->seed);
    TEST_ASSERT_EQUAL_INT(0, table_alloc(&made, self->length, 3, self->lines, &error));
    TEST_ASSERT_EQUAL_INT(0, table_set_rate(&made, self->rate_hz, &error));
    for (uint32_t b = 0; b < self->lines; b++) {
        const double omega = two_pi * (1 + b) * self->rate_hz / self->length;
        const double phase = self->seed ? two_pi * random_uniform(&random) : (double)b * b;
        made.bins[b] = 1 + b;
        for (uint32_t n = 0; n < self->length; n++) {
            const double angle = omega * n / self->rate_hz + phase;
            made.torque[n] += self->torque_Nm * cos(angle);
            made.velocity[n] += acceleration / omega * sin(angle);
            made.position[n] -= acceleration / (omega * omega) * cos(angle);
        }
    }
    const char *path = scratch_path("table.mst");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_write_mst(path, &made, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_bytes_read(path, out_table, &error), error.message);
    table_free(&made);
}

#endif
