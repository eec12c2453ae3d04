/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_variance.h"

#include "lab/estimate/parametric_problem.h"
#include "lab/numeric/cmplx.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { distortion_lines = 11, window_max = 21 };

static const double enough_dof = 20.0;
static const double beyond_chance = 4.0;

/// The input's noise over its power below which it may be taken for noise of the output: the response is drawn towards
/// 0 by no larger share.
static const double clean_input = 1e-3;

/// psi^(order - 1)(x) without sign for even `order`: (order - 1)! sum_{n >= 0} (x + n)^-order, the far terms by their
/// integral.
static double polygamma(double x, double order)
{
    enum { terms = 32 };
    double sum = 0.0;
    for (int n = 0; n < terms; n++) {
        sum += pow(x + n, -order);
    }
    double end = x + terms;
    sum += pow(end, 1.0 - order) / (order - 1.0) + 0.5 * pow(end, -order) + order / 12.0 * pow(end, -order - 1.0);
    return tgamma(order) * sum;
}

/// Whether the logarithms of variances scatter within groups of `window` lines as their degrees of freedom make them.
static bool scatter_alike(const double *variance, size_t count, size_t window, double dof)
{
    double one = polygamma(dof, 2.0);
    double kurtosis = polygamma(dof, 4.0) / (one * one);
    double lines = (double)window;
    double sum = 0.0;
    double expected = 0.0;
    double scatter = 0.0;
    for (size_t first = 0; first + window <= count; first += window) {
        double mean = 0.0;
        for (size_t k = first; k < first + window; k++) {
            mean += log(variance[k]) / lines;
        }
        for (size_t k = first; k < first + window; k++) {
            sum += (log(variance[k]) - mean) * (log(variance[k]) - mean) / one;
        }
        expected += lines - 1.0;
        scatter += 2.0 * (lines - 1.0) + kurtosis * (lines - 1.0) * (lines - 1.0) / lines;
    }
    return sum <= expected + beyond_chance * sqrt(scatter); // false for a variance of 0
}

/// Whether the input's noise matters anywhere beside the output's, or is rounding.
static bool input_matters(const struct parametric_weights *self, const struct parametric_data *data)
{
    const double matters = 1e-6;
    for (size_t k = 0; k < data->count && self->input_variance; k++) {
        double complex input = parametric_input(data, k);
        double gain = input != 0.0 ? cabs(data->output[k] / input) : 0.0;
        if (gain * gain * self->input_variance[k] > matters * self->output_variance[k]) {
            return true;
        }
    }
    return false;
}

/// First line of the window around line k, which is shifted inwards at the ends.
static size_t window_start(size_t k, size_t count, size_t window)
{
    size_t half = window / 2;
    size_t first = k > half ? k - half : 0;
    return first + window > count ? count - window : first;
}

static bool average(double *values, size_t count, size_t window)
{
    double *copy = malloc(count * sizeof *copy);
    if (!copy) {
        return false;
    }
    memcpy(copy, values, count * sizeof *copy);
    for (size_t k = 0; k < count; k++) {
        size_t first = window_start(k, count, window);
        values[k] = 0.0;
        for (size_t i = first; i < first + window; i++) {
            values[k] += copy[i] / (double)window;
        }
    }
    free(copy);
    return true;
}

static bool average_complex(double complex *values, size_t count, size_t window)
{
    double complex *copy = malloc(count * sizeof *copy);
    if (!copy) {
        return false;
    }
    memcpy(copy, values, count * sizeof *copy);
    for (size_t k = 0; k < count; k++) {
        size_t first = window_start(k, count, window);
        values[k] = 0.0;
        for (size_t i = first; i < first + window; i++) {
            values[k] += copy[i] / (double)window;
        }
    }
    free(copy);
    return true;
}

/// Largest window up to `window` in which lines scatter alike in `one` and, unless it is NULL, in `other`.
static size_t find_window(const double *one, const double *other, size_t count, size_t window, double dof)
{
    while (window > 1 && (window > count / 2 || !scatter_alike(one, count, window, dof) ||
                          (other && !scatter_alike(other, count, window, dof)))) {
        window = window > 3 ? (window / 2) | 1 : 1;
    }
    return window;
}

/// Variance of Y - G U with the measured response: in a closed loop output and input share their noise, and each alone
/// has the loop's peaks. Returns false where the input's noise is too large to be taken for the output's.
static bool fill_error_variance(const struct parametric_weights *self, const struct parametric_data *data,
                                double *out_variance)
{
    for (size_t k = 0; k < data->count; k++) {
        double complex input = parametric_input(data, k);
        double power = creal(input * conj(input));
        if (!(self->input_variance[k] < clean_input * power)) {
            return false;
        }
        out_variance[k] = parametric_error_variance(data, k, data->output[k] / input);
    }
    return true;
}

/// Pools the noise of output and input together. Returns the window, 1: not done.
static size_t pool_errors(const struct parametric_weights *self, const struct parametric_data *data, size_t window)
{
    size_t count = data->count;
    double *variance = malloc(count * sizeof *variance);
    size_t found = 1;
    if (variance && fill_error_variance(self, data, variance)) {
        found = find_window(variance, NULL, count, window, data->variance_dof);
        found = found > 1 && average(variance, count, found) ? found : 1;
    }
    for (size_t k = 0; k < count && found > 1; k++) {
        self->output_variance[k] = variance[k];
        self->input_variance[k] = 0.0;
        if (self->output_covariance) {
            self->output_covariance[k] = 0.0;
        }
    }
    free(variance);
    return found;
}

/// Pools how many times their noise the variances are, where noise is known apart: that of few realisations. Returns
/// the window, 1: not done.
static size_t pool_ratios(const struct parametric_weights *self, const struct parametric_data *data, size_t window)
{
    size_t count = data->count;
    double *ratio = malloc(count * sizeof *ratio);
    bool apart = false;
    size_t found = 1;
    for (size_t k = 0; k < count && ratio; k++) {
        apart = apart || self->noise_share[k] != 1.0;
        ratio[k] = 1.0 / self->noise_share[k];
    }
    if (ratio && apart) {
        found = find_window(ratio, NULL, count, window, data->variance_dof);
        found = found > 1 && average(ratio, count, found) ? found : 1;
    }
    for (size_t k = 0; k < count && found > 1; k++) {
        double noise = self->output_variance[k] * self->noise_share[k];
        self->output_variance[k] = noise * ratio[k];
        self->noise_share[k] = fmin(1.0, 1.0 / ratio[k]);
    }
    free(ratio);
    return found;
}

/// Pools the noise of output and input each by itself. An input whose noise does not matter has no say in whether, but
/// is pooled too: a covariance of one line beside variances of many could be larger than these allow. Returns the
/// window, 1: not done.
static size_t pool_each(const struct parametric_weights *self, const struct parametric_data *data, bool input,
                        size_t window)
{
    size_t count = data->count;
    window = find_window(self->output_variance, input ? self->input_variance : NULL, count, window, data->variance_dof);
    bool done = window > 1 && average(self->output_variance, count, window) &&
                (!self->input_variance || average(self->input_variance, count, window)) &&
                (!self->output_covariance || average_complex(self->output_covariance, count, window));
    return done ? window : 1;
}

size_t parametric_weights_pool(const struct parametric_weights *self, struct parametric_data *io_data)
{
    double dof = io_data->variance_dof;
    if (!(dof > 0.0 && dof < enough_dof) || io_data->unit_weights) {
        return 1;
    }
    bool input = input_matters(self, io_data);
    size_t window = (size_t)ceil(enough_dof / dof) | 1;
    window = window > window_max ? window_max : window;
    size_t pooled = pool_each(self, io_data, input, window);
    if (pooled == 1 && input) {
        pooled = pool_errors(self, io_data, window);
    } else if (pooled == 1 && self->noise_share) {
        pooled = pool_ratios(self, io_data, window);
    }
    io_data->variance_dof = dof * (double)pooled;
    return pooled;
}

bool parametric_weights_add_distortion(const struct parametric_weights *self, const struct parametric_model *model,
                                       struct parametric_data *io_data)
{
    size_t count = io_data->count;
    size_t window = count < distortion_lines ? count : distortion_lines;
    double complex *residual = malloc(count * sizeof *residual);
    double *excess = malloc(count * sizeof *excess);
    bool ready = residual && excess;
    double freedom = 2.0 * (double)count / (2.0 * (double)count - (double)model->parameters);
    if (ready) {
        parametric_residual(model, io_data, residual);
        for (size_t k = 0; k < count; k++) {
            double complex response = parametric_response(model, io_data->frequency_hz[k], NULL);
            excess[k] = (freedom * cmplx_power(residual[k]) - 1.0) * parametric_error_variance(io_data, k, response);
        }
        ready = average(excess, count, window);
    }
    for (size_t k = 0; ready && k < count; k++) {
        double complex response = parametric_response(model, io_data->frequency_hz[k], NULL);
        double noise = parametric_error_variance(io_data, k, response);
        double distortion = fmax(excess[k], 0.0);
        self->output_variance[k] += distortion;
        self->noise_share[k] *= noise / (noise + distortion);
    }
    if (ready) {
        io_data->variance_dof = (double)window;
    }
    free(residual);
    free(excess);
    return ready;
}
