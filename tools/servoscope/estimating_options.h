/* SPDX-License-Identifier: MIT */
/// What `frf` is asked for: its options, and what they mean for every run.
#ifndef SERVOSCOPE_TOOLS_ESTIMATING_OPTIONS_H
#define SERVOSCOPE_TOOLS_ESTIMATING_OPTIONS_H

#include "lab/design/lines.h"
#include "lab/estimate/method.h"
#include "lab/estimate/periodic.h"
#include "lab/estimate/setup.h"
#include "lab/record/error.h"
#include "lab/record/run.h"
#include "lab/record/run_sequence.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/options.h"

#include <stdbool.h>

struct estimating_matrix;

/// The command line as it was read.
struct estimating_options {
    struct option_values runs;
    struct option_values compare; ///< saved responses
    const char *method;
    const char *settle;
    const char *input;
    const char *output;
    const char *reference;
    const char *lines;
    const char *map;
    const char *out;
    const char *report;
    const char *order;
    const char *domain;
    const char *model_out;
    const char *design;
    const char *hold;
    bool delay_free;
    double delay_s;
    double rate_hz;
    long long period_samples;
    long long half_width;
    long long segment_samples;
};

/// What is asked of every run.
struct estimating_request {
    const struct estimate_method *method;
    struct periodic_options cut;
    struct estimate_options tuning;
    enum setup_hold hold;
    struct estimating_matrix *matrix;
    const struct command_context *context;
    const struct run_sequence_segment *segment; ///< of a sequence that the run is part of; NULL: it is a run by itself
};

/// Reads the command line; what is not given stays as it is in *io_arguments.
/// Errors: error_usage
int estimating_options_read(int argc, char **argv, struct estimating_options *io_arguments, struct error *out_error);

/// What the options mean, matrix, context and segment aside. An option that would change nothing is refused, lest
/// somebody believe that it did.
/// Errors: error_usage
int estimating_request_make(const struct estimating_options *arguments, struct estimating_request *out_request,
                            struct error *out_error);

/// The lines of --lines on the grid of a run, which is why they are read once per run. They stay the caller's; io_cut
/// points to them.
/// Errors: error_usage
int estimating_options_lines(const struct estimating_options *arguments, const struct run *run,
                             struct periodic_options *io_cut, struct design_lines *out_lines, struct error *out_error);

#endif
