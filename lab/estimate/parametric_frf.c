/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_frf.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/method.h"
#include "lab/record/json_out.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// Scatter from period to period below this share of a line is rounding, no noise to weigh by.
static const double rounding_share = 1e-12;

static int spectra_alloc(size_t count, const char *name, struct parametric_spectra *out_self, struct error *out_error)
{
    *out_self = (struct parametric_spectra){0};
    out_self->frequency_hz = calloc(count, sizeof *out_self->frequency_hz);
    out_self->output_variance = calloc(count, sizeof *out_self->output_variance);
    out_self->input_variance = calloc(count, sizeof *out_self->input_variance);
    out_self->input = calloc(count, sizeof *out_self->input);
    out_self->output = calloc(count, sizeof *out_self->output);
    out_self->output_covariance = calloc(count, sizeof *out_self->output_covariance);
    if (!out_self->frequency_hz || !out_self->output_variance || !out_self->input_variance || !out_self->input ||
        !out_self->output || !out_self->output_covariance) {
        parametric_spectra_free(out_self);
        return error_set(out_error, error_refused, "%s: not enough memory for %zu lines", name, count);
    }
    out_self->data = (struct parametric_data){.name = name,
                                              .frequency_hz = out_self->frequency_hz,
                                              .input = out_self->input,
                                              .output = out_self->output,
                                              .output_variance = out_self->output_variance,
                                              .input_variance = out_self->input_variance,
                                              .output_covariance = out_self->output_covariance};
    return 0;
}

void parametric_spectra_free(struct parametric_spectra *self)
{
    free(self->frequency_hz);
    free(self->output_variance);
    free(self->input_variance);
    free(self->input);
    free(self->output);
    free(self->output_covariance);
    *self = (struct parametric_spectra){0};
}

/// Adds one line of the recording; returns whether it scatters.
static bool add_line(const struct periodic *recording, size_t first, size_t count, size_t line,
                     struct parametric_spectra *io_self)
{
    size_t stride = recording->bin_count;
    struct circle input = circle_of_column(recording->input_spectra + first * stride, count, stride, line);
    struct circle output = circle_of_column(recording->output_spectra + first * stride, count, stride, line);
    if (!(circle_chance_of_zero(&input) < estimate_chance_of_dead_line)) {
        return true;
    }
    double periods = (double)count;
    double complex covariance = 0.0;
    for (size_t m = first; m < first + count; m++) {
        covariance += (recording->output_spectra[m * stride + line] - output.mean) *
                      conj(recording->input_spectra[m * stride + line] - input.mean) / (periods * (periods - 1.0));
    }
    size_t k = io_self->data.count++;
    io_self->frequency_hz[k] =
        (double)recording->bins[line] * recording->run->sample_rate_hz / (double)recording->period_samples;
    io_self->input[k] = input.mean;
    io_self->output[k] = output.mean;
    io_self->input_variance[k] = input.variance / periods;
    io_self->output_variance[k] = output.variance / periods;
    io_self->output_covariance[k] = covariance;
    return output.variance > pow(rounding_share * cabs(output.mean), 2.0);
}

int parametric_spectra_from_periodic(const struct periodic *recording, size_t first, size_t count,
                                     struct parametric_spectra *out_self, struct error *out_error)
{
    const char *name = recording->run->path;
    if (count < 2 || first + count > recording->used) {
        *out_self = (struct parametric_spectra){0};
        return error_set(out_error, error_refused, "%s: periods %zu to %zu of %zu: expected at least 2 of those used",
                         name, first + 1, first + count, recording->used);
    }
    int status = spectra_alloc(recording->bin_count, name, out_self, out_error);
    bool scatters = true;
    for (size_t line = 0; line < recording->bin_count && !status; line++) {
        scatters = add_line(recording, first, count, line, out_self) && scatters;
    }
    if (!status && out_self->data.count == 0) {
        parametric_spectra_free(out_self);
        return error_set(out_error, error_refused,
                         "%s: %s has no power above its scatter on any of %zu lines: expected an excited input", name,
                         recording->input, recording->bin_count);
    }
    out_self->data.variance_dof = (double)(count - 1);
    out_self->data.unit_weights = !scatters;
    out_self->data.sample_rate_hz = recording->run->sample_rate_hz;
    return status;
}

int parametric_spectra_from_frf(const struct frf *frf, const char *name, double sample_rate_hz, bool unit_weights,
                                struct parametric_spectra *out_self, struct error *out_error)
{
    int status = spectra_alloc(frf->count, name, out_self, out_error);
    if (status) {
        return status;
    }
    for (size_t line = 0; line < frf->count; line++) {
        if (frf->valid[line] && frf->frequency_hz[line] > 0.0) {
            size_t k = out_self->data.count++;
            double std = frf_known(frf->std[line]) ? frf->std[line] : 0.0;
            out_self->frequency_hz[k] = frf->frequency_hz[line];
            out_self->output[k] = frf->real[line] + I * frf->imag[line];
            out_self->output_variance[k] = std * std;
        }
    }
    out_self->data.input = NULL;
    out_self->data.input_variance = NULL;
    out_self->data.output_covariance = NULL;
    out_self->data.variance_dof = 0.5 * frf->degrees_of_freedom; // real ones in the file
    out_self->data.unit_weights = unit_weights;
    out_self->data.sample_rate_hz = sample_rate_hz;
    return 0;
}

/// "36.62 +- 0.01 Hz damping 0.05 +- 0.001; ..." for a key.
static void print_roots(const struct parametric_root *roots, size_t count, size_t size, char *out_text)
{
    size_t used = 0;
    out_text[0] = '\0';
    for (size_t i = 0; i < count && used < size; i++) {
        int printed =
            snprintf(out_text + used, size - used, "%s%.6g +- %.2g Hz damping %.4g +- %.2g", i ? "; " : "",
                     roots[i].frequency_hz, roots[i].frequency_std_hz, roots[i].damping, roots[i].damping_std);
        used += printed > 0 ? (size_t)printed : size;
    }
}

bool parametric_fill_frf(const struct parametric_model *model, const struct parametric_orders *orders,
                         struct frf *io_frf)
{
    char poles[480];
    double misfit = parametric_misfit(model);
    for (size_t line = 0; line < io_frf->count; line++) {
        double std;
        double complex response = parametric_response(model, io_frf->frequency_hz[line], &std);
        estimate_set_line(io_frf, line, response, std);
        io_frf->std[line] = std * sqrt(misfit);
    }
    print_roots(model->poles, model->pole_count, sizeof poles, poles);
    bool set = estimate_set_key(io_frf, "parametric_order", "%zu over %zu in %s", model->structure.numerator_order,
                                model->structure.denominator_order,
                                model->structure.domain == parametric_discrete ? "1/z" : "s") &&
               estimate_set_key(io_frf, "parametric_poles", "%s", poles) &&
               estimate_set_key(io_frf, "parametric_delay_s", "%.9g", model->delay_s) &&
               estimate_set_key(io_frf, "parametric_residual_whiteness_chance", "%.3g", model->whiteness_chance);
    if (set && model->cost_expected > 0.0) {
        set = estimate_set_key(io_frf, "parametric_cost", "%.5g, expected %.5g +- %.3g", model->cost,
                               model->cost_expected, model->cost_std);
    } else if (set) {
        set = estimate_set_key(io_frf, "parametric_weights", "equal: nothing scatters from period to period");
    }
    if (set && misfit > 1.0) {
        set =
            estimate_set_key(io_frf, "parametric_warning",
                             "the residual has %.3g times the variance that scatter between periods explains: "
                             "nonlinearity, or more dynamics than the model has; std allows for it, noise_std does not",
                             misfit);
    }
    if (set && orders) {
        set = estimate_set_key(io_frf, "parametric_why", "%s", orders->why);
    }
    return set;
}

static int write_model(const struct estimate_options *options, const struct parametric_model *model,
                       const struct parametric_orders *orders, struct error *out_error)
{
    if (!options || !options->model_path) {
        return 0;
    }
    cJSON *object = parametric_json(model, orders);
    int status = object ? json_write(options->model_path, object, out_error)
                        : error_set(out_error, error_refused, "%s: memory is short", options->model_path);
    cJSON_Delete(object);
    return status;
}

int frf_parametric_estimate(const struct periodic *recording, const struct estimate_options *options,
                            struct frf *out_frf, struct error *out_error)
{
    struct parametric_spectra spectra;
    struct parametric_orders orders;
    struct parametric_model model;
    struct parametric_orders_options choice = {.structure = {.domain = parametric_discrete}};
    if (options) {
        choice.structure.domain = options->continuous ? parametric_continuous : parametric_discrete;
        choice.structure.delay_free = options->delay_free;
    }
    *out_frf = (struct frf){0};
    int status = parametric_spectra_from_periodic(recording, 0, recording->used, &spectra, out_error);
    if (status) {
        return status;
    }
    status = parametric_orders_choose(&spectra.data, &choice, &orders, &model, out_error);
    // The model's standard deviations come from the scatter of all lines together.
    double dof = 2.0 * (double)spectra.data.count * (double)(recording->used - 1);
    parametric_spectra_free(&spectra);
    status = status ? status : write_model(options, &model, &orders, out_error);
    status = status ? status : estimate_begin(recording, "parametric", dof, out_frf, out_error);
    if (status) {
        return status;
    }
    if (!parametric_fill_frf(&model, &orders, out_frf)) {
        return estimate_refuse_memory(out_frf, out_error);
    }
    return estimate_end(recording, out_frf, out_error);
}
