/* SPDX-License-Identifier: MIT */
/// How much a drive at rest is disturbed by the beginning of a table, by the rule that chose where it begins: measured
/// in time, by a simulation of its own, over designs and random drives that nobody told the designer about.
/// For `./run bench start` and for tests/golden/test_design_start.c.
#ifndef SERVOSCOPE_BENCH_START_STUDY_H
#define SERVOSCOPE_BENCH_START_STUDY_H

#include "lab/record/error.h"

#include <stddef.h>
#include <stdint.h>

enum { start_designs = 6, start_plants = 24 };

enum start_rule {
    start_rule_none,   ///< sample 0
    start_rule_random, ///< any sample
    start_rule_paper,  ///< zero crossing of the velocity with the least acceleration
    start_rule_bank,   ///< design_start_choose for the mode, drive unknown
    start_rule_known,  ///< design_start_choose for the mode and the drive
    start_rule_count,
};
extern const char *const start_rule_names[start_rule_count];

enum start_mode { start_open_loop, start_closed_loop, start_mode_count };
extern const char *const start_mode_names[start_mode_count];

/// Which drives and designs.
struct start_draw {
    uint64_t plant_seed;
    /// 0: the testbed's clip, mca, fast (samples and continuous), fast with torque falling over frequency, mca on odd
    /// lines. Else six that this seed draws: velocity limit, highest line, spectrum.
    uint64_t design_seed;
};

/// Energy of the motor's velocity, first period minus settled period, over that of the settled period.
struct start_study {
    size_t count; ///< per mode and rule: start_designs * start_plants for each draw added
    double *share[start_mode_count][start_rule_count];
};

/// Adds one draw. Drives: antiresonance 8..80 Hz and friction time constant 0.2..5 s (logarithmic), load 0.3..0.8 of
/// the inertia, belt damping ratio 0.01..0.06. Cascade: the default model's gains.
int start_study_add(struct start_study *self, const struct start_draw *draw, struct error *out_error);
void start_study_free(struct start_study *self);

double start_study_mean(const struct start_study *self, enum start_mode mode, enum start_rule rule);
/// Value that `probability` of the cases stay below.
double start_study_quantile(const struct start_study *self, enum start_mode mode, enum start_rule rule,
                            double probability);

#endif
