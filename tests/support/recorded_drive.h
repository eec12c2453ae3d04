/* SPDX-License-Identifier: MIT */
/// Periodic runs of the simulated drive, prepared for a fit: truth and noise are known.
#ifndef SERVOSCOPE_TESTS_SUPPORT_RECORDED_DRIVE_H
#define SERVOSCOPE_TESTS_SUPPORT_RECORDED_DRIVE_H

#include "lab/diagnose/fit.h"
#include "sim/belt_drive.h"

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

enum { recorded_samples = 512, recorded_periods_max = 10, recorded_rows_max = recorded_samples * 13 };

static const double recorded_two_pi = 6.283185307179586;

/// What the drive is asked for in row n. Returns torque that the recording has there and nothing moves by.
typedef double recorded_command(size_t n, double rate_hz, struct sim_command *out_command);

struct recorded_drive {
    struct recording recording;
    size_t starts[recorded_periods_max];
    struct evidence evidence;
    struct fit_data data;
    struct fit fit;
    double columns[4][recorded_rows_max], block[4][recorded_samples];
};

static inline struct stretch recorded_stretch(double *torque_ref, double *torque, double *position, double *velocity,
                                              size_t rows)
{
    return (struct stretch){.samples = rows,
                            .torque_ref = torque_ref,
                            .torque = torque,
                            .position = position,
                            .velocity = velocity,
                            .substeps = sim_substeps};
}

/// Starts at a position, records `periods` periods after `lead` rows, and estimates the noise under the true model,
/// residuals in torques on 0.005 kg m2. Returns whether memory sufficed; to be freed either way.
static inline bool recorded_drive_init(struct recorded_drive *self, const struct sim_model *truth, double start,
                                       recorded_command *command_at, size_t lead, size_t periods)
{
    static struct sim_belt_drive drive;
    size_t rows = lead + periods * recorded_samples;
    memset(self, 0, sizeof *self);
    sim_belt_drive_init(&drive, truth, start);
    for (size_t n = 0; n < rows; n++) {
        struct sim_command command;
        struct sim_sample s;
        double astray = command_at(n, truth->sample_rate_hz, &command);
        sim_belt_drive_step(&drive, &command, &s);
        const double row[4] = {s.torque_ref + astray, s.torque + astray, s.position, s.velocity};
        for (size_t c = 0; c < 4; c++) {
            self->columns[c][n] = row[c];
            if (n >= lead)
                self->block[c][(n - lead) % recorded_samples] += row[c] / (double)periods;
        }
    }
    for (size_t p = 0; p < periods; p++)
        self->starts[p] = lead + p * recorded_samples;
    double(*all)[recorded_rows_max] = self->columns, (*block)[recorded_samples] = self->block;
    self->recording =
        (struct recording){.periodic = true,
                           .rate_hz = truth->sample_rate_hz,
                           .periods = periods,
                           .lead = lead,
                           .starts = self->starts,
                           .band = 60,
                           .block = recorded_stretch(block[0], block[1], block[2], block[3], recorded_samples),
                           .all = recorded_stretch(all[0], all[1], all[2], all[3], rows)};
    bool good =
        evidence_init(&self->evidence, &self->recording, 0.005) && evidence_estimate_noise(&self->evidence, truth);
    self->data = (struct fit_data){.runs = 1, .evidence = &self->evidence, .values = self->evidence.values};
    return good && fit_init(&self->fit, &self->data);
}

static inline void recorded_drive_free(struct recorded_drive *self)
{
    fit_free(&self->fit);
    evidence_free(&self->evidence);
}

#endif
