/* SPDX-License-Identifier: MIT */
/// One drawn drive of each kind, with and without delay, identified without being told its order; `./run bench
/// parametric` is the long version with fresh seeds.
#include "bench/parametric_study.h"
#include "unity.h"

#include <stdio.h>

void setUp(void) {}

void tearDown(void) {}

/// Lines of one fit stand or fall together, so that six fits may miss the 95 % by far; noise_std without pooling, or a
/// wrong order, would miss this.
static const double least_covered = 0.75;

static void test_parametric_finds_the_poles_of_drawn_drives(void)
{
    static struct study_recording recording;
    struct study_tally tally = {0};
    double error;
    for (size_t group = 0; group < 2 * study_kinds; group++) {
        char message[64];
        size_t right = tally.right;
        snprintf(message, sizeof message, "kind %zu, seed %zu", group % study_kinds, 100 + group);
        study_draw(group % study_kinds, group >= study_kinds, 100 + group, &recording);
        TEST_ASSERT_TRUE_MESSAGE(study_count(&recording, &tally, NULL), message);
        TEST_ASSERT_EQUAL_size_t_MESSAGE(right + 1, tally.right, message);
    }
    TEST_ASSERT_TRUE(study_coverage(&tally, &error) >= least_covered);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_parametric_finds_the_poles_of_drawn_drives);
    return UNITY_END();
}
