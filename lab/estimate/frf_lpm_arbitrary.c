/* SPDX-License-Identifier: MIT */
#include "lab/estimate/frf_lpm_arbitrary.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/complex_fit.h"
#include "lab/estimate/method.h"
#include "lab/estimate/spectra.h"
#include "lab/numeric/cmplx.h"

#include <math.h>
#include <stdlib.h>

enum { usual_order = 2, usual_dof = 9, most_lines = 4000 };

struct fit {
    const struct arbitrary *recording;
    size_t order;
    size_t half_width;
    size_t rows;    ///< 2n + 1
    size_t columns; ///< 2 (R + 1)
    size_t dof;
    size_t step;               ///< record lines from one line of the response to the next
    double complex *regressor; ///< spectra of the record: reference, else input
    double complex *input;     ///< NULL without a reference
    double complex *output;
    double complex *K;
    double *lengths;
    double complex *input_values;
    double complex *output_values;
};

static int plan(const struct estimate_options *options, struct fit *io_self, struct error *out_error)
{
    const struct arbitrary *recording = io_self->recording;
    io_self->order = options->order < 0 ? usual_order : (size_t)options->order;
    io_self->columns = 2 * (io_self->order + 1);
    io_self->half_width = options->half_width ? options->half_width : io_self->order + (usual_dof + 1) / 2;
    io_self->rows = 2 * io_self->half_width + 1;
    if (io_self->order > estimate_order_max || io_self->rows <= io_self->columns) {
        return error_set(out_error, error_refused,
                         "%s: order %zu with %zu lines on each side: expected an order from 0 to %d and fewer unknowns "
                         "(%zu) than lines (%zu), so that some are left for the variance",
                         recording->run->path, io_self->order, io_self->half_width, estimate_order_max,
                         io_self->columns, io_self->rows);
    }
    io_self->dof = io_self->rows - io_self->columns;
    size_t top = (recording->rows - 1) / 2;
    size_t least = top / most_lines + 1;
    io_self->step = io_self->half_width > least ? io_self->half_width : least;
    if (options->segment_samples) {
        io_self->step = (recording->rows + options->segment_samples / 2) / options->segment_samples;
        io_self->step = io_self->step > 0 ? io_self->step : 1;
    }
    if (top < io_self->rows + io_self->step) {
        return error_set(out_error, error_refused,
                         "%s: %zu rows in one piece have %zu lines: method lpm needs %zu around each line of the "
                         "response, expected a longer recording or a smaller --half-width",
                         recording->run->path, recording->rows, top, io_self->rows);
    }
    return 0;
}

static bool allocate_and_transform(struct fit *io_self)
{
    const struct arbitrary *recording = io_self->recording;
    size_t lines = recording->rows / 2 + 1;
    bool with_reference = recording->reference != NULL;
    const char *regressor_name = with_reference ? recording->reference : recording->input;
    const double *regressor = run_column(recording->run, regressor_name) + recording->first;
    const double *input = run_column(recording->run, recording->input) + recording->first;
    const double *output = run_column(recording->run, recording->output) + recording->first;
    io_self->regressor = malloc(lines * sizeof *io_self->regressor);
    io_self->output = malloc(lines * sizeof *io_self->output);
    io_self->input = with_reference ? malloc(lines * sizeof *io_self->input) : NULL;
    io_self->K = malloc(io_self->rows * io_self->columns * sizeof *io_self->K);
    io_self->lengths = malloc(io_self->columns * sizeof *io_self->lengths);
    io_self->input_values = malloc(2 * io_self->rows * sizeof *io_self->input_values);
    io_self->output_values = io_self->input_values ? io_self->input_values + io_self->rows : NULL;
    return io_self->regressor && io_self->output && (io_self->input || !with_reference) && io_self->K &&
           io_self->lengths && io_self->input_values &&
           spectra_transform_two(regressor, output, recording->rows, io_self->regressor, io_self->output) &&
           /* The input beside itself: only needed where there is a reference. */
           (!with_reference || spectra_transform_two(input, input, recording->rows, io_self->input, io_self->input));
}

static void free_fit(struct fit *self)
{
    free(self->regressor);
    free(self->output);
    free(self->input);
    free(self->K);
    free(self->lengths);
    free(self->input_values);
}

/// Columns: the transient's polynomial, then that of the response from the highest power to the one that is wanted.
static void fill_columns(struct fit *io_self, size_t centre)
{
    for (size_t i = 0; i < io_self->rows; i++) {
        size_t line = centre + i - io_self->half_width;
        double distance = ((double)i - (double)io_self->half_width) / (double)io_self->half_width;
        for (size_t s = 0; s <= io_self->order; s++) {
            double factor = pow(distance, (double)s);
            io_self->K[s * io_self->rows + i] = factor;
            io_self->K[(io_self->columns - 1 - s) * io_self->rows + i] = factor * io_self->regressor[line];
        }
        io_self->output_values[i] = io_self->output[line];
        if (io_self->input) {
            io_self->input_values[i] = io_self->input[line];
        }
    }
}

static bool fit_line(struct fit *io_self, size_t centre, double complex *out_response, double *out_variance)
{
    fill_columns(io_self, centre);
    if (!complex_fit_orthonormalise(io_self->rows, io_self->columns, io_self->K, io_self->lengths)) {
        return false;
    }
    double last = io_self->lengths[io_self->columns - 1];
    double complex to_output =
        complex_fit_last(io_self->rows, io_self->columns, io_self->K, last, io_self->output_values);
    double complex to_input = 1.0;
    if (io_self->input) {
        to_input = complex_fit_last(io_self->rows, io_self->columns, io_self->K, last, io_self->input_values);
    }
    double factor = 1.0 / (last * last * (double)io_self->dof);
    *out_response = to_output / to_input;
    double residual = 0.0;
    double scatter = 0.0;
    for (size_t i = 0; i < io_self->rows; i++) {
        double complex input = io_self->input ? io_self->input_values[i] : 0.0;
        residual += cmplx_power(io_self->output_values[i] - *out_response * input);
        scatter += cmplx_power(input);
    }
    *out_variance = factor * residual / cmplx_power(to_input);
    struct circle input_line = {io_self->dof + 1, to_input, scatter * factor * (double)(io_self->dof + 1)};
    return circle_chance_of_zero(&input_line) < estimate_chance_of_dead_line;
}

static int estimate_lines(struct fit *io_self, struct frf *out_frf, struct error *out_error)
{
    const struct arbitrary *recording = io_self->recording;
    double step_hz = recording->run->sample_rate_hz * (double)io_self->step / (double)recording->rows;
    size_t first = (io_self->half_width + io_self->step) / io_self->step;
    size_t last = ((recording->rows - 1) / 2 - io_self->half_width) / io_self->step;
    int status = estimate_begin_arbitrary(recording, "lpm", 2.0 * (double)io_self->dof, last - first + 1, step_hz,
                                          out_frf, out_error);
    for (size_t j = first; j <= last && !status; j++) {
        double complex response = 0.0;
        double variance = 0.0;
        out_frf->frequency_hz[j - first] = (double)j * step_hz;
        if (fit_line(io_self, j * io_self->step, &response, &variance)) {
            estimate_set_line(out_frf, j - first, response, sqrt(variance));
        }
    }
    return status ? status : estimate_end_arbitrary(recording, out_frf, out_error);
}

static bool set_keys(const struct fit *self, struct frf *io_frf)
{
    const char *reference = self->recording->reference;
    return estimate_set_key(io_frf, "lpm_order", "%zu", self->order) &&
           estimate_set_key(io_frf, "lpm_half_width", "%zu", self->half_width) &&
           (reference ? estimate_set_key(io_frf, "reference", "%s", reference) &&
                            estimate_warn_of_reference(reference, io_frf)
                      : estimate_warn_of_feedback(NULL, io_frf));
}

int frf_lpm_estimate_arbitrary(const struct arbitrary *recording, const struct estimate_options *options,
                               struct frf *out_frf, struct error *out_error)
{
    static const struct estimate_options defaults = {.order = estimate_order_auto};
    struct fit self = {.recording = recording};
    int status = plan(options ? options : &defaults, &self, out_error);
    if (status) {
        return status;
    }
    if (allocate_and_transform(&self)) {
        status = estimate_lines(&self, out_frf, out_error);
    } else {
        status = error_set(out_error, error_refused, "%s: not enough memory for the spectra of %zu rows",
                           recording->run->path, recording->rows);
    }
    if (!status && !set_keys(&self, out_frf)) {
        status = estimate_refuse_memory(out_frf, out_error);
    }
    free_fit(&self);
    return status;
}

bool frf_lpm_arbitrary_at(const struct arbitrary *recording, const double *frequency_hz, size_t count,
                          double complex *out_response, double *out_std)
{
    const struct estimate_options options = {.order = estimate_order_auto};
    const double lines_per_hz = (double)recording->rows / recording->run->sample_rate_hz;
    struct fit self = {.recording = recording};
    struct error ignored;
    for (size_t k = 0; k < count; k++) {
        out_response[k] = 0.0;
        out_std[k] = INFINITY;
    }
    if (plan(&options, &self, &ignored)) {
        return true;
    }
    const bool done = allocate_and_transform(&self);
    for (size_t k = 0; k < count && done; k++) {
        const size_t centre = (size_t)llround(frequency_hz[k] * lines_per_hz);
        double variance;
        if (centre > self.half_width && centre + self.half_width <= (recording->rows - 1) / 2 &&
            fit_line(&self, centre, &out_response[k], &variance)) {
            out_std[k] = sqrt(variance);
        }
    }
    free_fit(&self);
    return done;
}
