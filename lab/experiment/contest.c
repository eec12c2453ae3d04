/* SPDX-License-Identifier: MIT */
#include "lab/experiment/contest.h"

#include "lab/diagnose/search.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { fit_iterations = 10 };

void contest_free(struct contest *self)
{
    fit_free(&self->fit);
    for (size_t i = 0; i < self->runs; i++) {
        evidence_free(&self->evidence[i]);
        recording_free(&self->recordings[i]);
    }
    self->runs = 0;
}

/// One run: played, and kept only as what diagnosis makes of it.
static int add_run(struct contest *self, const struct contest_door *door, const struct variant *excitation,
                   const struct sim_model *drive, struct error *out_error)
{
    struct run run;
    struct sim_model with_seed = *drive;
    struct recording *recording = &self->recordings[self->runs];
    struct evidence *evidence = &self->evidence[self->runs];
    with_seed.seed = drive->seed + self->runs;
    int status = door->measure(door->user, &with_seed, excitation, self->runs, &run, out_error);
    if (status)
        return status;
    status = recording_prepare(&run, recording, out_error);
    run_free(&run);
    if (status)
        return status;
    double inertia = self->given->motor_inertia_kgm2 + self->given->load_inertia_kgm2;
    if (!evidence_init(evidence, recording, inertia)) {
        recording_free(recording);
        return error_set(out_error, error_refused, "memory is short");
    }
    evidence->phase_free = self->runs > 0;
    self->runs++;
    return 0;
}

/// The noise under a model, in all runs, and the lines in time that it leaves, where their search begins.
static bool estimate_noise(struct contest *self, const struct sim_model *model)
{
    bool good = true;
    for (size_t i = 0; i < self->runs; i++)
        good = good && evidence_estimate_noise(&self->evidence[i], model);
    return good;
}

static void take_tones(struct contest *self)
{
    struct sim_coverage *coverage = &self->recordings[0].coverage;
    coverage->tone_count = self->evidence[0].tone_count;
    memcpy(coverage->tones_hz, self->evidence[0].tones_hz, sizeof coverage->tones_hz);
}

int contest_init(struct contest *self, const struct contest_door *door, const struct variant *excitation,
                 const struct sim_model *drive, const struct sim_model *given, struct error *out_error)
{
    memset(self, 0, sizeof *self);
    self->given = given;
    int status = 0;
    for (size_t i = 0; !status && i < excitation->table_count; i++)
        status = add_run(self, door, excitation, drive, out_error);
    self->data = (struct fit_data){.runs = self->runs, .evidence = self->evidence};
    bool good = !status && estimate_noise(self, given);
    if (good) {
        // Lines are what the given model leaves; the noise is what the drive itself leaves.
        take_tones(self);
        good = estimate_noise(self, drive);
    }
    for (size_t i = 0; i < self->runs; i++) {
        self->data.values += self->evidence[i].values;
        self->data.contrasts += self->evidence[i].contrast.values;
    }
    hypothesis_init(&self->plain, given, false, true);
    self->plain.sensors_seen = status == 0 && self->evidence[0].kinematics.values > 0;
    good = good && fit_init(&self->fit, &self->data) && fit_run(&self->fit, &self->data, &self->plain, fit_iterations);
    if (!status && !good)
        status = error_set(out_error, error_refused,
                           "the model cannot be fitted to its own simulation, or memory is "
                           "short");
    if (status)
        contest_free(self);
    return status;
}

/// The rival from numbers at hand, where that is better than what its own search found.
static void try_start(const struct contest *self, int rival, const double *start, double *io_cost,
                      struct hypothesis *io_best)
{
    struct fit fit;
    struct hypothesis trial = self->plain;
    hypothesis_name(&trial, rival, start);
    if (!fit_init(&fit, &self->data))
        return;
    if (fit_run(&fit, &self->data, &trial, fit_iterations) && fit.cost < *io_cost) {
        *io_cost = fit.cost;
        *io_best = trial;
    }
    fit_free(&fit);
}

double contest_evidence(const struct contest *self, int cause, const double *values)
{
    struct fit fit;
    struct hypothesis with_cause = self->plain;
    hypothesis_name(&with_cause, cause, values);
    if (!fit_init(&fit, &self->data))
        return 0.0;
    bool good = fit_run(&fit, &self->data, &with_cause, fit_iterations);
    double nats = 0.5 * (self->fit.cost - fit.cost);
    fit_free(&fit);
    return good && isfinite(nats) ? nats : 0.0;
}

bool contest_decide(const struct contest *self, int cause, const double *values, int rival, const double *start,
                    struct contest_outcome *out_outcome)
{
    struct hypothesis with_cause = self->plain;
    struct fit fit;
    *out_outcome = (struct contest_outcome){.rival = self->plain};
    hypothesis_name(&with_cause, cause, values);
    if (!fit_init(&fit, &self->data))
        return false;
    bool good = fit_run(&fit, &self->data, &with_cause, fit_iterations);
    double cost = fit.cost, rival_cost = self->fit.cost;
    struct hypothesis found = self->plain;
    // However far the rival's first step leads: the best that it can do is the answer.
    if (search_add(&self->data, &self->recordings[0].coverage, rival, &self->fit, INFINITY, &found, &fit) &&
        fit.cost < rival_cost) {
        rival_cost = fit.cost;
        out_outcome->rival = found;
    }
    fit_free(&fit);
    if (start)
        try_start(self, rival, start, &rival_cost, &out_outcome->rival);
    out_outcome->evidence = 0.5 * (self->fit.cost - cost);
    out_outcome->rival_evidence = 0.5 * (self->fit.cost - rival_cost);
    out_outcome->nats = 0.5 * (rival_cost - cost);
    out_outcome->misfit = cost / (double)self->data.values;
    return good;
}

double contest_visibility(const struct contest *self, int cause, const double *values)
{
    struct fit fit;
    struct hypothesis with_cause = self->plain;
    if (!fit_init(&fit, &self->data))
        return 0.0;
    hypothesis_name(&with_cause, cause, values);
    double nats = 0.5 * (fit_cost(&fit, &self->data, &with_cause, with_cause.x) - self->fit.cost);
    fit_free(&fit);
    return isfinite(nats) ? fmax(nats, 0.0) : 0.0;
}
