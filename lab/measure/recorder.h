/* SPDX-License-Identifier: MIT */
/// Keeps the samples of a measurement and makes a run of them. Internal to lab/measure.
#ifndef SERVOSCOPE_MEASURE_RECORDER_H
#define SERVOSCOPE_MEASURE_RECORDER_H

#include "drivers/drive.h"
#include "lab/record/run.h"
#include "msgen/table.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum recorder_column {
    recorder_time,
    recorder_torque_ref,
    recorder_torque,
    recorder_position,
    recorder_velocity,
    recorder_position_ref,
    recorder_velocity_ref,
    recorder_valid,
    recorder_columns,
};

struct recorder {
    struct run run;                 ///< every column already in place, `rows_max` long
    double *data[recorder_columns]; ///< NULL for columns that are not kept
    size_t rows;
    size_t rows_max;
    size_t lost;
};

/// What belongs into the run beside the samples.
struct recorder_facts {
    const struct msgen_table *table;
    double sample_rate_hz;
    uint32_t settle_periods;
    const char *mode;
    uint32_t samples_late;
    uint32_t torque_clipped;
    bool interrupted;
    const char *stopped_by; ///< NULL if complete
};

/// Allocates everything that the loop will need. Errors: false if memory is short; nothing to free then.
bool recorder_init(struct recorder *self, size_t rows_max, bool linear, bool with_references);

/// Keeps one sample; allocates nothing, and drops what is beyond rows_max.
void recorder_add(struct recorder *self, const struct drive_setpoint *setpoint, const struct drive_sample *sample);

/// Hands the run over, with its keys; `valid` only if a sample was lost. Errors: false if memory is short, run empty
/// then. Frees the recorder either way.
bool recorder_finish(struct recorder *self, const struct recorder_facts *facts, struct run *out_run);

#endif
