/* SPDX-License-Identifier: MIT */
#include "lab/measure/recorder.h"

#include <stdio.h>
#include <stdlib.h>

static const char *const rotary_names[recorder_columns] = {
    "time_s",           "torque_ref_Nm",          "torque_Nm", "position_rad", "velocity_rad_per_s",
    "position_ref_rad", "velocity_ref_rad_per_s", "valid",
};
static const char *const linear_names[recorder_columns] = {
    "time_s",         "force_ref_N",          "force_N", "position_m", "velocity_m_per_s",
    "position_ref_m", "velocity_ref_m_per_s", "valid",
};

bool recorder_init(struct recorder *self, size_t rows_max, bool linear, bool with_references)
{
    *self = (struct recorder){.rows_max = rows_max};
    self->run.rows = rows_max;
    self->run.linear = linear;
    for (int c = 0; c < recorder_columns; c++) {
        if (!with_references && (c == recorder_position_ref || c == recorder_velocity_ref)) {
            continue;
        }
        self->data[c] = run_add_column(&self->run, (linear ? linear_names : rotary_names)[c]);
        if (!self->data[c]) {
            run_free(&self->run);
            return false;
        }
    }
    return true;
}

static void put(struct recorder *self, enum recorder_column column, double value)
{
    if (self->data[column]) {
        self->data[column][self->rows] = value;
    }
}

void recorder_add(struct recorder *self, const struct drive_setpoint *setpoint, const struct drive_sample *sample)
{
    if (self->rows == self->rows_max) {
        return;
    }
    put(self, recorder_torque_ref, sample->torque_ref_Nm);
    put(self, recorder_torque, sample->torque_Nm);
    put(self, recorder_position, sample->position_rad);
    put(self, recorder_velocity, sample->velocity_rad_per_s);
    put(self, recorder_position_ref, setpoint->position_rad);
    put(self, recorder_velocity_ref, setpoint->velocity_rad_per_s);
    put(self, recorder_valid, sample->valid ? 1.0 : 0.0);
    self->lost += !sample->valid;
    self->rows++;
}

static bool set_count(struct run *run, const char *key, size_t value)
{
    char text[32];
    snprintf(text, sizeof text, "%zu", value);
    return run_set_key(run, key, text);
}

static bool set_bins(struct run *run, const struct msgen_table *table)
{
    run->bins = malloc(table->bin_count * sizeof *run->bins);
    if (!run->bins) {
        return false;
    }
    run->bin_count = table->bin_count;
    for (uint32_t b = 0; b < table->bin_count; b++) {
        run->bins[b] = msgen_table_bin(table, b);
    }
    return true;
}

/// The whole periods among the rows: settling ones first.
static void count_periods(struct run *run, const struct recorder_facts *facts)
{
    size_t whole = run->rows / facts->table->period_samples;
    run->period_samples = facts->table->period_samples;
    run->settle_periods = whole < facts->settle_periods ? whole : facts->settle_periods;
    run->periods = whole - run->settle_periods;
    run->has_settle_periods = true;
}

static void drop_last_column(struct run *run)
{
    run->column_count--;
    free(run->columns[run->column_count].name);
    free(run->columns[run->column_count].data);
}

bool recorder_finish(struct recorder *self, const struct recorder_facts *facts, struct run *out_run)
{
    struct run *run = &self->run;
    run->rows = self->rows;
    run->sample_rate_hz = facts->sample_rate_hz;
    run->has_table_crc32 = true;
    run->table_crc32 = facts->table->header_crc32;
    count_periods(run, facts);
    for (size_t n = 0; n < run->rows; n++) {
        self->data[recorder_time][n] = (double)n / facts->sample_rate_hz;
    }
    if (self->lost == 0) {
        drop_last_column(run);
    }
    bool done = set_bins(run, facts->table) && run_set_key(run, "mode", facts->mode) &&
                set_count(run, "samples_lost", self->lost) && set_count(run, "samples_late", facts->samples_late);
    if (done && facts->torque_clipped > 0) {
        done = set_count(run, "torque_clipped", facts->torque_clipped);
    }
    if (done && facts->interrupted) {
        done = run_set_key(run, "interrupted", "true");
    }
    if (done && facts->stopped_by) {
        done = run_set_key(run, "stopped_by", facts->stopped_by);
    }
    if (!done) {
        run_free(run);
        return false;
    }
    *out_run = *run;
    *run = (struct run){0};
    return true;
}
