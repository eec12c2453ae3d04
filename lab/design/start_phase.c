/* SPDX-License-Identifier: MIT */
#include "lab/design/start_phase.h"

#include "lab/design/start_bank.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

size_t design_start_phase_paper(size_t samples, const double *velocity_rad_per_s, const double *acceleration_rad_per_s2)
{
    size_t best = 0;
    double least = INFINITY;
    for (size_t n = 0; n < samples; n++) {
        size_t next = n + 1 < samples ? n + 1 : 0;
        double here = velocity_rad_per_s[n];
        double there = velocity_rad_per_s[next];
        if ((here > 0) == (there > 0)) {
            continue;
        }
        size_t nearer = fabs(here) <= fabs(there) ? n : next;
        if (fabs(acceleration_rad_per_s2[nearer]) < least) {
            least = fabs(acceleration_rad_per_s2[nearer]);
            best = nearer;
        }
    }
    return best;
}

/// What is asked of each drive: all t0 into `shares`, or one t0 added to `sum`.
struct question {
    const struct design_transient_table *table;
    enum design_loop_mode mode;
    double *shares; ///< NULL: only start_index
    size_t start_index;
    double sum;
    size_t drives; ///< that have answered
};

static int refuse_memory(struct error *out_error)
{
    return error_set(out_error, error_refused, "memory is short for the start of the table");
}

static int ask_loop(struct question *self, const struct design_loop *loop, struct error *out_error)
{
    struct design_transient transient;
    switch (design_transient_create(loop, self->table, &transient)) {
    case design_transient_no_steady_state:
        return error_set(out_error, error_refused,
                         "start: the drive has no steady state, an undamped resonance lies on a line; expected belt "
                         "damping or friction above 0");
    case design_transient_memory:
        return refuse_memory(out_error);
    case design_transient_ok:
        break;
    }
    bool answered = true;
    if (self->shares) {
        answered = design_transient_add_shares(&transient, self->shares);
    } else {
        self->sum += design_transient_share(&transient, (double)self->start_index);
    }
    self->drives++;
    design_transient_free(&transient);
    return answered ? 0 : refuse_memory(out_error);
}

static int ask_drive(struct question *self, const struct sim_model *drive, bool may_be_unstable,
                     struct error *out_error)
{
    struct design_loop loop;
    int status = 0;
    switch (design_loop_create(drive, self->table->rate_hz, self->mode, &loop)) {
    case design_loop_memory:
        return refuse_memory(out_error);
    case design_loop_dead_time:
        return error_set(out_error, error_refused,
                         "start: dead_time_s: %g is %.1f samples at %g Hz, expected at most %d", drive->dead_time_s,
                         drive->dead_time_s * self->table->rate_hz, self->table->rate_hz,
                         (int)design_loop_dead_samples_max);
    case design_loop_unstable:
        if (!may_be_unstable) {
            status = error_set(out_error, error_refused,
                               "start: the drive is unstable %s at %g Hz, a deviation grows %.6g-fold from sample to "
                               "sample; expected a stable one (lower gains of the controller)",
                               self->mode == design_loop_cascade ? "with its cascade" : "in torque mode",
                               self->table->rate_hz, loop.growth);
        }
        break;
    case design_loop_ok:
        status = ask_loop(self, &loop, out_error);
        break;
    }
    design_loop_free(&loop);
    return status;
}

/// A nominal drive that its nominal controller cannot hold at this rate stands for no real one: it is passed over.
static int ask_bank(struct question *self, struct error *out_error)
{
    int status = 0;
    for (size_t i = 0; !status && i < design_start_bank_size; i++) {
        struct sim_model drive;
        design_start_bank_drive(self->table, i, &drive);
        status = ask_drive(self, &drive, true, out_error);
    }
    if (!status && self->drives == 0) {
        status = error_set(out_error, error_refused,
                           "start: no nominal drive is stable at %g Hz, expected a higher rate", self->table->rate_hz);
    }
    return status;
}

static int ask(struct question *self, const struct sim_model *drive, struct error *out_error)
{
    return drive ? ask_drive(self, drive, false, out_error) : ask_bank(self, out_error);
}

int design_start_map(const struct design_transient_table *table, const struct sim_model *drive,
                     enum design_loop_mode mode, double *out_shares, struct error *out_error)
{
    struct question question = {.table = table, .mode = mode, .shares = out_shares};
    memset(out_shares, 0, table->period_samples * sizeof *out_shares);
    int status = ask(&question, drive, out_error);
    for (size_t n = 0; !status && n < table->period_samples; n++) {
        out_shares[n] /= (double)question.drives;
    }
    return status;
}

int design_start_choose(const struct design_transient_table *table, const struct sim_model *drive,
                        enum design_loop_mode mode, size_t *out_start_index, double *out_share, struct error *out_error)
{
    double *shares = calloc(table->period_samples, sizeof *shares);
    int status = shares ? design_start_map(table, drive, mode, shares, out_error) : refuse_memory(out_error);
    size_t best = 0;
    for (size_t n = 1; !status && n < table->period_samples; n++) {
        best = shares[n] < shares[best] ? n : best;
    }
    if (!status) {
        *out_start_index = best;
        *out_share = shares[best];
    }
    free(shares);
    return status;
}

int design_start_expect(const struct design_transient_table *table, const struct sim_model *drive,
                        enum design_loop_mode mode, size_t start_index, double *out_share, struct error *out_error)
{
    struct question question = {.table = table, .mode = mode, .start_index = start_index};
    int status = ask(&question, drive, out_error);
    if (!status) {
        *out_share = question.sum / (double)question.drives;
    }
    return status;
}
