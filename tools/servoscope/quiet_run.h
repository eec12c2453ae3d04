/* SPDX-License-Identifier: MIT */
/// A model's own measurement without noise, in memory: what it would answer to a table if it were the drive.
#ifndef SERVOSCOPE_TOOLS_QUIET_RUN_H
#define SERVOSCOPE_TOOLS_QUIET_RUN_H

#include "lab/record/error.h"
#include "lab/record/frf_file.h"
#include "lab/record/run.h"
#include "msgen/table.h"
#include "sim/model.h"

/// Plays a table through a model in its cascade: two settling and two counted periods, no noise, no quantisation.
/// Errors: error_refused if the model cannot follow (it then says where it went); *out_run is empty then
int quiet_run(const struct sim_model *model, const struct msgen_table *table, struct run *out_run,
              struct error *out_error);

/// Frequency response of the same, by the same estimator that measured runs get: friction and all, at this excitation.
/// Errors: as quiet_run; *out_frf is empty then
int quiet_run_response(const struct sim_model *model, const struct msgen_table *table, struct frf *out_frf,
                       struct error *out_error);

#endif
