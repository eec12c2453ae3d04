/* SPDX-License-Identifier: MIT */
/// A machine with several inputs, as `frf` takes it: one response for each output and input, OUT-1-2.csv that of output
/// 1 from input 2, each on the lines of its own input.
#ifndef SERVOSCOPE_TOOLS_ESTIMATING_MATRIX_H
#define SERVOSCOPE_TOOLS_ESTIMATING_MATRIX_H

#include "lab/estimate/inputs.h"
#include "lab/estimate/periodic.h"
#include "lab/record/error.h"
#include "lab/record/run.h"
#include "lab/record/sequence_file.h"
#include "tools/servoscope/estimating_pieces.h"

#include <stdbool.h>
#include <stddef.h>

/// What reading a run ends with where it turns out that it has several inputs and none was chosen.
enum { estimating_is_matrix = -1 };

/// Zero-initialise, then estimating_matrix_open(); estimating_matrix_free() in every case.
struct estimating_matrix {
    bool allowed;       ///< nobody chose an input
    bool wanted;        ///< a run has several; the names below are filled in
    bool lines_given;   ///< --lines
    const char *output; ///< --output; NULL: all
    size_t input_count, output_count;
    char *inputs[inputs_max];
    char *outputs[inputs_max];
    bool has_design;
    struct sequence_file design;
    char *kept_path; ///< the last run read, so that all pairs of one run take it from here
    struct run kept;
};

/// What was asked for on the command line.
struct estimating_matrix_request {
    const char *design; ///< --design: the manifest that says which lines are whose; NULL: none
    const char *input, *output, *lines;
};

int estimating_matrix_open(const struct estimating_matrix_request *request, struct estimating_matrix *out_self,
                           struct error *out_error);

/// Reads a run (estimating_pieces_open), or gives out the one that is kept.
int estimating_matrix_read(struct estimating_matrix *self, const char *path, const struct run_options *options,
                           const char *needs_whole, size_t period_samples, struct estimating_pieces *out_run,
                           struct error *out_error);

/// Takes a run back: a whole one is kept for the next pair if there are pairs, else it is freed.
void estimating_matrix_give_back(struct estimating_matrix *self, struct estimating_pieces *run);

/// Finds out whether a run makes a matrix, and of which columns; at most once.
/// Errors: estimating_is_matrix if it does; error_refused, error_usage: it does, and cannot be taken
int estimating_matrix_begin(struct estimating_matrix *self, const struct run *run, struct error *out_error);

/// Sets the lines of a cut to those of its input, where there are several; *out_inputs owns them and is empty
/// otherwise.
/// Errors: as inputs_find(), where the division of the lines was asked for (a matrix, a design)
int estimating_matrix_lines(const struct estimating_matrix *self, const struct run *run,
                            struct periodic_options *io_cut, struct inputs *out_inputs, struct error *out_error);

/// OUT.csv with -OUTPUT-INPUT before the ending, the numbers those of the columns (1 for a column without); to be
/// freed, NULL if memory is short.
char *estimating_matrix_path(const struct estimating_matrix *self, const char *out, size_t output, size_t input);

void estimating_matrix_free(struct estimating_matrix *self);

#endif
