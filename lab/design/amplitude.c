/* SPDX-License-Identifier: MIT */
#include "lab/design/amplitude.h"

#include "lab/design/lines.h"
#include "lab/design/optimal_power.h"
#include "lab/record/model_file.h"
#include "lab/record/number.h"
#include "sim/linear.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586;

static double line_hz(const struct design_request *request)
{
    return (double)request->rate_num_hz / request->rate_den / (double)request->period_samples;
}

static int out_of_memory(struct error *out_error)
{
    return error_set(out_error, error_refused, "memory is short for the amplitudes of the lines");
}

// ---- D-optimal

static int refuse_model(const char *place, const struct design_request *request, enum design_optimal_status status,
                        const struct design_optimal_report *report, struct error *out_error)
{
    switch (status) {
    case design_optimal_not_finite:
        return error_set(out_error, error_refused,
                         "%s: the model has an undamped resonance on the line at %.9g Hz, expected damping or friction",
                         place, request->bins[report->line] * line_hz(request));
    case design_optimal_singular:
        return error_set(
            out_error, error_refused,
            "%s: the %zu lines do not tell the model's parameters apart, expected more lines, some of them "
            "near its resonance",
            place, request->bin_count);
    case design_optimal_slow:
        return error_set(out_error, error_refused,
                         "%s: after %zu steps the design is still %.2g from optimal, expected %g", place, report->steps,
                         report->gap, DESIGN_OPTIMAL_GAP);
    case design_optimal_memory:
        return out_of_memory(out_error);
    case design_optimal_ok:
        break;
    }
    return 0;
}

/// lines x parameters, by reference to the torque that the table asks for; returns the number of parameters.
static size_t fill_sensitivities(const struct sim_model *model, const struct design_request *request,
                                 double complex *out)
{
    size_t count = 0;
    for (size_t k = 0; k < request->bin_count; k++) {
        double complex line[sim_linear_parameters_max];
        const double omega = two_pi * line_hz(request) * request->bins[k];
        const double complex actuator = sim_linear_actuator(model, omega);
        count = sim_linear_sensitivities(model, omega, line);
        for (size_t i = 0; i < count; i++) {
            out[k * count + i] = actuator * line[i];
        }
    }
    return count;
}

int design_amplitude_optimal(const char *place, const struct sim_model *model, double alpha,
                             const struct design_request *request, double *out_shape, struct error *out_error)
{
    struct design_optimal_report report;
    const size_t lines = request->bin_count;
    if (!(alpha > 0 && alpha <= 1)) {
        return error_set(out_error, error_usage,
                         "%s: ALPHA %g, expected above 0 and at most 1: the share of the power that is spread evenly; "
                         "without it most lines would get none",
                         place, alpha);
    }
    double complex *sensitivities = calloc(lines * sim_linear_parameters_max, sizeof *sensitivities);
    if (!sensitivities) {
        return out_of_memory(out_error);
    }
    const size_t parameters = fill_sensitivities(model, request, sensitivities);
    enum design_optimal_status optimal = design_optimal_power(lines, parameters, sensitivities, out_shape, &report);
    free(sensitivities);
    int status = refuse_model(place, request, optimal, &report, out_error);
    for (size_t k = 0; !status && k < lines; k++) {
        out_shape[k] = sqrt((1 - alpha) * out_shape[k] + alpha / (double)lines);
    }
    return status;
}

/// `arguments` is MODEL.json,ALPHA.
static int shape_optimal(const char *specification, const char *arguments, const struct design_request *request,
                         double *shape, struct error *out_error)
{
    struct sim_model model;
    char place[512];
    double alpha = 0;
    const char *comma = strrchr(arguments, ',');
    snprintf(place, sizeof place, "amplitude '%s'", specification);
    if (!comma || comma == arguments) {
        return error_set(out_error, error_usage, "%s: expected d-optimal:MODEL.json,ALPHA", place);
    }
    enum number_status number = number_parse(comma + 1, strlen(comma + 1), &alpha);
    if (number != number_ok) {
        return error_set(out_error, error_usage, "%s: ALPHA '%s' %s, expected above 0 and at most 1", place, comma + 1,
                         number_status_str(number));
    }
    const size_t length = (size_t)(comma - arguments);
    char *path = malloc(length + 1);
    if (!path) {
        return out_of_memory(out_error);
    }
    memcpy(path, arguments, length);
    path[length] = '\0';
    int status = model_file_read(path, &model, out_error);
    free(path);
    return status ? status : design_amplitude_optimal(place, &model, alpha, request, shape, out_error);
}

// ---- File

struct row_reader {
    const char *path;
    size_t number; ///< of the row, from 1
    const struct design_request *request;
    double *shape; ///< 0: no row yet
    struct error *out_error;
};

/// Splits a row into its two cells; false if it has fewer or more. Cells are not terminated.
static bool split_row(const char *row, const char *out_cell[2], size_t out_length[2])
{
    static const char between[] = ", \t";
    for (size_t i = 0; i < 2; i++) {
        row += strspn(row, " \t");
        out_cell[i] = row;
        out_length[i] = strcspn(row, between);
        row += out_length[i];
        row += strspn(row, " \t");
        if (i == 0 && *row == ',') {
            row++;
        }
    }
    return out_length[0] > 0 && out_length[1] > 0 && *row == '\0';
}

/// The excited line that is nearest to a frequency; bins ascend.
static size_t nearest_line(const struct design_request *request, double bins)
{
    size_t low = 0;
    size_t high = request->bin_count - 1;
    while (high - low > 1) {
        size_t middle = low + (high - low) / 2;
        if (request->bins[middle] <= bins) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return fabs(request->bins[high] - bins) < fabs(request->bins[low] - bins) ? high : low;
}

static int take_numbers(const struct row_reader *self, double frequency_hz, double amplitude)
{
    const double bins = frequency_hz / line_hz(self->request);
    const size_t line = nearest_line(self->request, bins);
    if (!(fabs(self->request->bins[line] - bins) <= design_lines_tolerance(bins))) {
        return error_set(self->out_error, error_refused,
                         "%s:%zu: %.9g Hz is not an excited line, the nearest is %.9g Hz", self->path, self->number,
                         frequency_hz, self->request->bins[line] * line_hz(self->request));
    }
    if (self->shape[line] > 0) {
        return error_set(self->out_error, error_refused, "%s:%zu: %.9g Hz is there twice", self->path, self->number,
                         frequency_hz);
    }
    if (!(amplitude > 0)) {
        return error_set(self->out_error, error_refused, "%s:%zu: amplitude %.9g, expected a positive number",
                         self->path, self->number, amplitude);
    }
    self->shape[line] = amplitude;
    return 0;
}

static bool is_word(const char *text, size_t length, const char *word)
{
    return strlen(word) == length && strncmp(text, word, length) == 0;
}

static int take_row(const struct row_reader *self, char *row, bool *inout_names_may_come)
{
    static const char *const names[2] = {"frequency_hz", "amplitude"};
    const char *cell[2];
    size_t length[2];
    double value[2];
    row[strcspn(row, "#\r\n")] = '\0';
    if (row[strspn(row, " \t")] == '\0') {
        return 0;
    }
    const bool names_may_come = *inout_names_may_come;
    *inout_names_may_come = false;
    if (!split_row(row, cell, length)) {
        return error_set(self->out_error, error_refused,
                         "%s:%zu: '%.60s', expected two numbers: frequency_hz,amplitude", self->path, self->number,
                         row);
    }
    if (names_may_come && is_word(cell[0], length[0], names[0]) && is_word(cell[1], length[1], names[1])) {
        return 0;
    }
    for (size_t i = 0; i < 2; i++) {
        enum number_status number = number_parse(cell[i], length[i], &value[i]);
        if (number != number_ok) {
            return error_set(self->out_error, error_refused, "%s:%zu: %s: '%.*s' %s", self->path, self->number,
                             names[i], length[i] < 60 ? (int)length[i] : 60, cell[i], number_status_str(number));
        }
    }
    return take_numbers(self, value[0], value[1]);
}

static int read_rows(struct row_reader *self, FILE *stream)
{
    char *row = NULL;
    size_t capacity = 0;
    bool names_may_come = true;
    int status = 0;
    while (!status && getline(&row, &capacity, stream) >= 0) {
        self->number++;
        status = take_row(self, row, &names_may_come);
    }
    free(row);
    if (!status && ferror(stream)) {
        return error_set(self->out_error, error_refused, "%s: cannot be read: %s", self->path, strerror(errno));
    }
    for (size_t k = 0; !status && k < self->request->bin_count; k++) {
        if (!(self->shape[k] > 0)) {
            status = error_set(self->out_error, error_refused,
                               "%s:%zu: the file ends without an amplitude for %.9g Hz, expected one for each of the "
                               "%zu excited lines",
                               self->path, self->number + 1, self->request->bins[k] * line_hz(self->request),
                               self->request->bin_count);
        }
    }
    return status;
}

static int shape_from_file(const char *path, const struct design_request *request, double *shape,
                           struct error *out_error)
{
    struct row_reader reader = {.path = path, .request = request, .shape = shape, .out_error = out_error};
    FILE *stream = fopen(path, "r");
    if (!stream) {
        return error_set(out_error, error_refused,
                         "amplitude '%s': cannot be opened: %s; expected constraint, flat, one-over-f, "
                         "d-optimal:MODEL.json,ALPHA or the name of a file",
                         path, strerror(errno));
    }
    int status = read_rows(&reader, stream);
    fclose(stream);
    return status;
}

// ---- All

static int fill_shape(const char *specification, const struct design_request *request, double *shape,
                      struct error *out_error)
{
    static const char optimal[] = "d-optimal:";
    const bool flat = strcmp(specification, "flat") == 0;
    if (flat || strcmp(specification, "one-over-f") == 0) {
        for (size_t k = 0; k < request->bin_count; k++) {
            shape[k] = flat ? 1 : 1 / sqrt((double)request->bins[k]);
        }
        return 0;
    }
    if (strncmp(specification, optimal, sizeof optimal - 1) == 0) {
        return shape_optimal(specification, specification + sizeof optimal - 1, request, shape, out_error);
    }
    return shape_from_file(specification, request, shape, out_error);
}

int design_amplitude_shape(const char *specification, const struct design_request *request, double **out_shape,
                           struct error *out_error)
{
    *out_shape = NULL;
    if (strcmp(specification, "constraint") == 0) {
        return 0;
    }
    double *shape = calloc(request->bin_count, sizeof *shape);
    if (!shape) {
        return out_of_memory(out_error);
    }
    int status = fill_shape(specification, request, shape, out_error);
    if (status) {
        free(shape);
        return status;
    }
    *out_shape = shape;
    return 0;
}
