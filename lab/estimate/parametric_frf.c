/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_frf.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/method.h"
#include "lab/estimate/parametric_region.h"
#include "lab/estimate/parametric_text.h"
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
    out_self->noise_share = calloc(count, sizeof *out_self->noise_share);
    out_self->input = calloc(count, sizeof *out_self->input);
    out_self->output = calloc(count, sizeof *out_self->output);
    out_self->output_covariance = calloc(count, sizeof *out_self->output_covariance);
    if (!out_self->frequency_hz || !out_self->output_variance || !out_self->input_variance || !out_self->noise_share ||
        !out_self->input || !out_self->output || !out_self->output_covariance) {
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
    free(self->noise_share);
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
    // Of signals that scatter by rounding alone, rounding may carry it beyond what their variances allow.
    double most = sqrt(io_self->input_variance[k] * io_self->output_variance[k]);
    io_self->output_covariance[k] = cabs(covariance) > most ? covariance * (most / cabs(covariance)) : covariance;
    io_self->noise_share[k] = 1.0;
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
            double noise = frf_known(frf->noise_std[line]) ? frf->noise_std[line] : std;
            out_self->noise_share[k] = std > 0.0 ? noise * noise / (std * std) : 1.0;
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

struct parametric_weights parametric_spectra_weights(struct parametric_spectra *self)
{
    bool has_input = self->data.input_variance != NULL;
    return (struct parametric_weights){.output_variance = self->output_variance,
                                       .input_variance = has_input ? self->input_variance : NULL,
                                       .output_covariance = has_input ? self->output_covariance : NULL,
                                       .noise_share = self->noise_share};
}

/// Real degrees of freedom of the model's standard deviations: those of all lines' variances together; of the residual
/// where it says how large the variances are.
static double degrees_of_freedom(const struct parametric_outcome *outcome)
{
    const struct parametric_model *model = &outcome->model;
    double from_residual = 2.0 * (double)model->lines - (double)model->parameters;
    bool by_residual = !(model->cost_expected > 0.0) || outcome->misfit > 1.0 || outcome->variance_dof == 0.0;
    return by_residual ? from_residual : 2.0 * outcome->variance_dof * (double)model->lines;
}

static void fill_lines(const struct parametric_outcome *outcome, struct frf *io_frf)
{
    for (size_t line = 0; line < io_frf->count; line++) {
        double std;
        double noise_std;
        double complex response = parametric_response(&outcome->model, io_frf->frequency_hz[line], &std);
        parametric_response(&outcome->noise, io_frf->frequency_hz[line], &noise_std);
        estimate_set_line(io_frf, line, response, std);
        if (io_frf->valid[line]) {
            io_frf->noise_std[line] = noise_std;
        }
    }
}

static bool set_fit_keys(const struct parametric_outcome *outcome, struct frf *io_frf)
{
    const struct parametric_model *model = &outcome->model;
    bool set;
    if (outcome->noise_cost_expected > 0.0) {
        set = estimate_set_key(io_frf, "parametric_cost", "%.5g, expected %.5g +- %.3g", outcome->noise_cost,
                               outcome->noise_cost_expected, outcome->noise_cost_std);
    } else {
        set = estimate_set_key(io_frf, "parametric_weights", "equal: nothing scatters from period to period");
    }
    if (set && outcome->misfit > 1.0) {
        set = estimate_set_key(io_frf, "parametric_warning",
                               "the residual has %.3g times the variance that scatter between periods explains: "
                               "nonlinearity, or more dynamics than the model has; std allows for it, noise_std does "
                               "not",
                               outcome->misfit);
    }
    return set && estimate_set_key(io_frf, "parametric_residual_whiteness_chance", "%.3g", model->whiteness_chance) &&
           estimate_set_key(io_frf, "parametric_why", "%s", outcome->orders.why) &&
           (outcome->pooled_lines <= 1 ||
            estimate_set_key(io_frf, "parametric_pooled_lines", "%zu", outcome->pooled_lines)) &&
           (!outcome->hint[0] || estimate_set_key(io_frf, "parametric_hint", "%s", outcome->hint));
}

/// Puts the model's response into every line of a response, all of them valid, with std and noise_std, the factor of
/// their 95 % regions (confidence_95_factor, parametric_region.h), and keys that say what the model is:
/// parametric_order, parametric_poles, parametric_cost and others (docs/files.md).
/// Errors: false if memory is short
static bool fill_frf(const struct parametric_outcome *outcome, struct frf *io_frf)
{
    const struct parametric_model *model = &outcome->model;
    const struct parametric_model *shown = parametric_shown(outcome);
    char order[parametric_text_size];
    char poles[parametric_text_size];
    char zeros[parametric_text_size];
    parametric_text_order(model, order);
    parametric_text_roots(model, true, 0.0, poles);
    parametric_text_roots(shown, false, 0.5 * model->sample_rate_hz, zeros);
    fill_lines(outcome, io_frf);
    io_frf->degrees_of_freedom = degrees_of_freedom(outcome);
    double factor =
        parametric_confidence_factor(model, io_frf->frequency_hz, io_frf->count, 0.95, io_frf->degrees_of_freedom);
    return estimate_set_key(io_frf, "confidence_95_factor", "%.6g", isfinite(factor) ? factor : 1.96) &&
           estimate_set_key(io_frf, "parametric_order", "%s", order) &&
           estimate_set_key(io_frf, "parametric_poles", "%s", poles) &&
           estimate_set_key(io_frf, "parametric_zeros", "%s", zeros) &&
           estimate_set_key(io_frf, "parametric_delay_s", "%.9g", parametric_delay_without_hold_s(shown)) &&
           (!shown->structure.delay_free ||
            estimate_set_key(io_frf, "parametric_delay_std_s", "%.3g", shown->delay_std_s)) &&
           set_fit_keys(outcome, io_frf);
}

static int write_model(const struct estimate_options *options, const struct parametric_outcome *outcome,
                       struct error *out_error)
{
    if (!options || !options->model_path) {
        return 0;
    }
    cJSON *object = parametric_outcome_json(outcome, true);
    int status = object ? json_write(options->model_path, object, out_error)
                        : error_set(out_error, error_refused, "%s: memory is short", options->model_path);
    cJSON_Delete(object);
    return status;
}

/// Identifies, writes the model where options say so, and hands it over.
static int identify(struct parametric_spectra *spectra, const struct estimate_options *options,
                    struct parametric_outcome *out_outcome, struct error *out_error)
{
    struct parametric_weights weights = parametric_spectra_weights(spectra);
    struct parametric_request request = {.domain = parametric_discrete};
    if (options) {
        request.domain = options->continuous && !options->held ? parametric_continuous : parametric_discrete;
        request.delay_free = options->delay_free;
    }
    int status = parametric_identify(&spectra->data, &weights, &request, out_outcome, out_error);
    if (!status && options && options->continuous && options->held && !out_outcome->has_plant) {
        char order[parametric_text_size];
        parametric_text_order(&out_outcome->model, order);
        status = error_set(
            out_error, error_refused,
            "%s: the input is held between samples, and the model that fits, of order %s, has no counterpart in "
            "s (a pole at a negative z, or two in one place): expected a discrete model",
            spectra->data.name, order);
    }
    return status ? status : write_model(options, out_outcome, out_error);
}

static int estimate(const struct periodic *recording, const struct estimate_options *options,
                    struct parametric_outcome *out_outcome, struct frf *out_frf, struct error *out_error)
{
    struct parametric_spectra spectra;
    int status = parametric_spectra_from_periodic(recording, 0, recording->used, &spectra, out_error);
    if (status) {
        return status;
    }
    status = identify(&spectra, options, out_outcome, out_error);
    parametric_spectra_free(&spectra);
    status = status ? status : estimate_begin(recording, "parametric", 0.0, out_frf, out_error);
    if (status) {
        return status;
    }
    out_frf->degrees_of_freedom = degrees_of_freedom(out_outcome);
    fill_lines(out_outcome, out_frf);
    status = estimate_end(recording, out_frf, out_error);
    // After estimate_end, which takes errors for circles.
    return status || fill_frf(out_outcome, out_frf) ? status : estimate_refuse_memory(out_frf, out_error);
}

/// Where the outcome goes: to the caller, or to memory of our own that out_own names.
static struct parametric_outcome *outcome_of(const struct estimate_options *options,
                                             struct parametric_outcome **out_own)
{
    bool given = options && options->parametric;
    *out_own = given ? NULL : malloc(sizeof **out_own);
    return given ? options->parametric : *out_own;
}

int frf_parametric_estimate(const struct periodic *recording, const struct estimate_options *options,
                            struct frf *out_frf, struct error *out_error)
{
    struct parametric_outcome *own;
    struct parametric_outcome *outcome = outcome_of(options, &own);
    *out_frf = (struct frf){0};
    int status = outcome ? estimate(recording, options, outcome, out_frf, out_error)
                         : error_set(out_error, error_refused, "%s: memory is short", recording->run->path);
    free(own);
    return status;
}

/// A response with the frequencies, names and keys of another.
static int begin_like(const struct frf *measured, struct frf *out_frf, struct error *out_error)
{
    int status = frf_alloc(out_frf, measured->count, out_error);
    if (status) {
        return status;
    }
    memcpy(out_frf->frequency_hz, measured->frequency_hz, measured->count * sizeof *measured->frequency_hz);
    bool set = frf_set_text(&out_frf->input, measured->input) && frf_set_text(&out_frf->output, measured->output) &&
               frf_set_text(&out_frf->units, measured->units) && frf_set_text(&out_frf->method, "parametric");
    out_frf->periods = measured->periods;
    for (size_t k = 0; k < measured->key_count && set; k++) {
        set = estimate_set_key(out_frf, measured->keys[k].key, "%s", measured->keys[k].value);
    }
    return set ? 0 : estimate_refuse_memory(out_frf, out_error);
}

int frf_parametric_fit(const struct frf *measured, const char *name, const struct estimate_options *options,
                       struct frf *out_frf, struct error *out_error)
{
    struct parametric_spectra spectra;
    struct parametric_outcome *own;
    struct parametric_outcome *outcome = outcome_of(options, &own);
    double rate_hz = strtod(estimate_key(measured, "sample_rate_hz"), NULL);
    *out_frf = (struct frf){0};
    int status = outcome ? parametric_spectra_from_frf(measured, name, rate_hz, false, &spectra, out_error)
                         : error_set(out_error, error_refused, "%s: memory is short", name);
    if (!status) {
        status = identify(&spectra, options, outcome, out_error);
        parametric_spectra_free(&spectra);
    }
    status = status ? status : begin_like(measured, out_frf, out_error);
    if (!status && !fill_frf(outcome, out_frf)) {
        status = estimate_refuse_memory(out_frf, out_error);
    }
    free(own);
    return status;
}
