/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/estimating_matrix.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int refuse_memory(struct error *out_error)
{
    return error_set(out_error, error_refused, "memory is short");
}

int estimating_matrix_open(const struct estimating_matrix_request *request, struct estimating_matrix *out_self,
                           struct error *out_error)
{
    *out_self = (struct estimating_matrix){
        .allowed = !request->input, .output = request->output, .lines_given = request->lines != NULL};
    if (!request->design) {
        return 0;
    }
    if (request->lines) {
        return error_set(out_error, error_usage, "--lines: '%s': %s says the lines of each input", request->lines,
                         request->design);
    }
    int status = sequence_file_read(request->design, &out_self->design, out_error);
    out_self->has_design = status == 0;
    return status;
}

int estimating_matrix_read(struct estimating_matrix *self, const char *path, const struct run_options *options,
                           const char *needs_whole, size_t period_samples, struct estimating_pieces *out_run,
                           struct error *out_error)
{
    if (self->kept_path && strcmp(self->kept_path, path) == 0) {
        *out_run = (struct estimating_pieces){.run = self->kept};
        self->kept = (struct run){0};
        free(self->kept_path);
        self->kept_path = NULL;
        return 0;
    }
    return estimating_pieces_open(path, options, needs_whole, period_samples, out_run, out_error);
}

void estimating_matrix_give_back(struct estimating_matrix *self, struct estimating_pieces *run)
{
    char *path = self->wanted && !run->stream && run->run.path ? strdup(run->run.path) : NULL;
    if (!path) {
        estimating_pieces_free(run);
        return;
    }
    run_free(&self->kept);
    free(self->kept_path);
    self->kept = run->run;
    self->kept_path = path;
    run->run = (struct run){0};
}

static bool has_single_input(const struct run *run)
{
    return run_column(run, "torque_Nm") || run_column(run, "force_N") || run_column(run, "current_A") ||
           run_column(run, "voltage_V");
}

static bool copy_names(const char *const *names, size_t count, char **out_names, size_t *out_count)
{
    for (size_t i = 0; i < count; i++) {
        out_names[i] = strdup(names[i]);
        if (!out_names[i]) {
            return false;
        }
        *out_count = i + 1;
    }
    return true;
}

int estimating_matrix_begin(struct estimating_matrix *self, const struct run *run, struct error *out_error)
{
    const char *inputs[inputs_max];
    const char *outputs[inputs_max];
    if (!self->allowed || self->wanted || has_single_input(run)) {
        return 0;
    }
    const size_t input_count = inputs_list(run, inputs);
    if (input_count < 2) {
        return 0;
    }
    if (self->lines_given) {
        return error_set(out_error, error_usage,
                         "--lines: %s has the inputs %s to %s, each with lines of its own: expected --input COLUMN too",
                         run->path, inputs[0], inputs[input_count - 1]);
    }
    size_t output_count = self->output ? 1 : inputs_list_outputs(run, outputs);
    outputs[0] = self->output ? self->output : outputs[0];
    if (output_count == 0) {
        return error_set(out_error, error_refused,
                         "%s: no output column: expected velocity_1_rad_per_s or the like, or --output COLUMN",
                         run->path);
    }
    self->wanted = true;
    bool copied = copy_names(inputs, input_count, self->inputs, &self->input_count) &&
                  copy_names(outputs, output_count, self->outputs, &self->output_count);
    return copied ? estimating_is_matrix : refuse_memory(out_error);
}

int estimating_matrix_lines(const struct estimating_matrix *self, const struct run *run,
                            struct periodic_options *io_cut, struct inputs *out_inputs, struct error *out_error)
{
    const struct inputs_known known = {.design = self->has_design ? &self->design : NULL,
                                       .period_samples = io_cut->period_samples};
    const char *names[inputs_max];
    const bool asked = self->wanted || self->has_design;
    struct error ignored;
    *out_inputs = (struct inputs){0};
    if (self->lines_given || (!asked && (!io_cut->input || inputs_list(run, names) < 2))) {
        return 0;
    }
    /* Of an input that somebody chose, all lines with power are taken where they cannot be divided. */
    int status = inputs_find(run, &known, out_inputs, asked ? out_error : &ignored);
    for (size_t p = 0; p < out_inputs->count && io_cut->input; p++) {
        if (strcmp(out_inputs->names[p], io_cut->input) == 0) {
            io_cut->bins = out_inputs->bins[p];
            io_cut->bin_count = out_inputs->bin_count[p];
        }
    }
    return asked ? status : 0;
}

/// The number before the unit, 1 without one.
static unsigned long number_of(const char *name)
{
    for (const char *at = strchr(name, '_'); at; at = strchr(at + 1, '_')) {
        if (isdigit((unsigned char)at[1])) {
            return strtoul(at + 1, NULL, 10);
        }
    }
    return 1;
}

char *estimating_matrix_path(const struct estimating_matrix *self, const char *out, size_t output, size_t input)
{
    const char *name = strrchr(out, '/') ? strrchr(out, '/') + 1 : out;
    const char *dot = strrchr(name, '.');
    const size_t stem = dot && dot > name ? (size_t)(dot - out) : strlen(out);
    const size_t size = strlen(out) + 48;
    char *path = malloc(size);
    if (path) {
        snprintf(path, size, "%.*s-%lu-%lu%s", (int)stem, out, number_of(self->outputs[output]),
                 number_of(self->inputs[input]), out + stem);
    }
    return path;
}

void estimating_matrix_free(struct estimating_matrix *self)
{
    for (size_t i = 0; i < inputs_max; i++) {
        free(self->inputs[i]);
        free(self->outputs[i]);
    }
    sequence_file_free(&self->design);
    run_free(&self->kept);
    free(self->kept_path);
    *self = (struct estimating_matrix){0};
}
