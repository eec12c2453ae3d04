/* SPDX-License-Identifier: MIT */
/// `servoscope design --separate`: the excitation that tells two causes apart, found in simulation, written as tables,
/// with the commands that measure and diagnose it.
#ifndef SERVOSCOPE_TOOLS_SEPARATING_H
#define SERVOSCOPE_TOOLS_SEPARATING_H

#include "lab/design/offset.h"
#include "sim/model.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/design_options.h"

struct separating {
    const struct design_options *options;
    const struct design_request *request; ///< lines, amplitudes and the limits in full
    const struct design_offset *offset;
    const struct command_context *context;
    int effects[2];
    struct sim_model model;
};

/// Understands --separate and what belongs to it, reads the model; the request has to have its rate and axis.
/// Errors: error_usage for options that contradict each other and unknown causes, error_refused for the model
int separating_prepare(const struct design_options *options, const struct design_request *request,
                       struct separating *out_self, struct error *out_error);

/// Finds the excitation, writes PREFIX (or PREFIX-1 and PREFIX-2), prints. Nothing is written where nothing separates
/// the causes; that is a result, not an error.
/// Errors: error_refused as separation_run() and for files
int separating_run(const struct separating *self, struct error *out_error);

#endif
