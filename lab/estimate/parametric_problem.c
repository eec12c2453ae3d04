/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_problem.h"

#include "lab/numeric/cmplx.h"
#include "lab/numeric/polynomial.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

struct parametric_layout parametric_layout_of(const struct parametric_structure *structure)
{
    struct parametric_layout layout = {
        .denominators = structure->denominator_order - structure->denominator_lowest + 1,
        .numerators = structure->numerator_order - structure->numerator_lowest + 1,
    };
    if (structure->transient) {
        size_t order = structure->denominator_order > structure->numerator_order ? structure->denominator_order
                                                                                 : structure->numerator_order;
        layout.transients = structure->domain == parametric_continuous ? order + 1 : order;
    }
    layout.unknowns = layout.denominators + layout.numerators + layout.transients + (structure->delay_free ? 1 : 0);
    return layout;
}

void parametric_pack(const struct parametric_model *model, double *out_theta)
{
    struct parametric_layout layout = parametric_layout_of(&model->structure);
    const size_t size = sizeof *out_theta;
    memcpy(out_theta, model->denominator + model->structure.denominator_lowest, layout.denominators * size);
    out_theta += layout.denominators;
    memcpy(out_theta, model->numerator + model->structure.numerator_lowest, layout.numerators * size);
    out_theta += layout.numerators;
    memcpy(out_theta, model->transient, layout.transients * size);
    if (model->structure.delay_free) {
        out_theta[layout.transients] = model->delay_s;
    }
}

void parametric_unpack(const double *theta, struct parametric_model *io_model)
{
    struct parametric_layout layout = parametric_layout_of(&io_model->structure);
    const size_t size = sizeof *theta;
    memcpy(io_model->denominator + io_model->structure.denominator_lowest, theta, layout.denominators * size);
    theta += layout.denominators;
    memcpy(io_model->numerator + io_model->structure.numerator_lowest, theta, layout.numerators * size);
    theta += layout.numerators;
    memcpy(io_model->transient, theta, layout.transients * size);
    io_model->delay_s = io_model->structure.delay_free ? theta[layout.transients] : io_model->structure.delay_s;
}

/// x at an angular frequency.
static double complex variable_at(const struct parametric_structure *structure, double sample_rate_hz,
                                  double scale_rad_per_s, double omega_rad_per_s)
{
    if (structure->domain == parametric_continuous) {
        return I * (omega_rad_per_s / scale_rad_per_s);
    }
    return cexp(-I * (omega_rad_per_s / sample_rate_hz));
}

static double complex power(double complex x, size_t exponent)
{
    double complex result = 1.0;
    for (; exponent > 0; exponent--) {
        result *= x;
    }
    return result;
}

/// Value of `count` coefficients from power `lowest` on; 0 if there are none.
static double complex polynomial_from(const double *coefficients, size_t count, size_t lowest, double complex x)
{
    return count > 0 ? power(x, lowest) * polynomial_value(coefficients, count - 1, x) : 0.0;
}

static double complex delay_factor(double omega_rad_per_s, double delay_s)
{
    return delay_s == 0.0 ? 1.0 : cexp(-I * (omega_rad_per_s * delay_s));
}

void parametric_line_begin(const struct parametric_model *model, double frequency_hz, struct parametric_line *out_line)
{
    double omega = two_pi * frequency_hz;
    *out_line = (struct parametric_line){
        .x = variable_at(&model->structure, model->sample_rate_hz, model->scale_rad_per_s, omega),
        .omega_rad_per_s = omega,
        .delay = delay_factor(omega, model->structure.delay_s)};
}

void parametric_line_response(const struct parametric_structure *structure, const double *theta,
                              struct parametric_line *io_line)
{
    struct parametric_layout layout = parametric_layout_of(structure);
    const double *b = theta + layout.denominators;
    const double *i = b + layout.numerators;
    double complex x = io_line->x;
    if (structure->delay_free) {
        io_line->delay = delay_factor(io_line->omega_rad_per_s, i[layout.transients]);
    }
    double complex denominator = polynomial_from(theta, layout.denominators, structure->denominator_lowest, x);
    io_line->inverse = conj(denominator) / cmplx_power(denominator);
    io_line->response =
        io_line->delay * polynomial_from(b, layout.numerators, structure->numerator_lowest, x) * io_line->inverse;
    io_line->transient = polynomial_from(i, layout.transients, 0, x) * io_line->inverse;
}

void parametric_line_gradient(const struct parametric_structure *structure, const struct parametric_line *line,
                              double complex *out_response, double complex input, double complex *out_output)
{
    struct parametric_layout layout = parametric_layout_of(structure);
    double complex over = line->inverse;
    double complex step = over * power(line->x, structure->denominator_lowest);
    double complex output = line->response * input + line->transient;
    size_t n = 0;
    for (size_t i = 0; i < layout.denominators; i++, n++, step *= line->x) {
        out_response[n] = -line->response * step;
        out_output[n] = -output * step;
    }
    step = line->delay * over * power(line->x, structure->numerator_lowest);
    for (size_t i = 0; i < layout.numerators; i++, n++, step *= line->x) {
        out_response[n] = step;
        out_output[n] = step * input;
    }
    step = over;
    for (size_t i = 0; i < layout.transients; i++, n++, step *= line->x) {
        out_response[n] = 0.0;
        out_output[n] = step;
    }
    if (structure->delay_free) {
        out_response[n] = -I * line->omega_rad_per_s * line->response;
        out_output[n] = out_response[n] * input;
    }
}

double complex parametric_input(const struct parametric_data *data, size_t k)
{
    return data->input ? data->input[k] : 1.0;
}

double parametric_input_variance(const struct parametric_data *data, size_t k)
{
    return data->input_variance && !data->unit_weights ? data->input_variance[k] : 0.0;
}

double complex parametric_covariance(const struct parametric_data *data, size_t k)
{
    return data->output_covariance && !data->unit_weights ? data->output_covariance[k] : 0.0;
}

static double real_product(double complex a, double complex b) // Re(conj(a) b)
{
    return creal(a) * creal(b) + cimag(a) * cimag(b);
}

/// Variance of Y - G U. Input and output noise that are nearly the same may cancel; what rounding leaves of them is
/// kept above 0.
double parametric_error_variance(const struct parametric_data *data, size_t k, double complex response)
{
    const double cancelled = 1e-12;
    if (data->unit_weights) {
        return 1.0;
    }
    double apart = data->output_variance[k] + cmplx_power(response) * parametric_input_variance(data, k);
    return fmax(apart - 2.0 * real_product(response, parametric_covariance(data, k)), cancelled * apart);
}

void parametric_problem_line(const struct parametric_problem *self, const double *theta, size_t k,
                             struct parametric_line *out_line)
{
    out_line->x = self->x[k];
    out_line->omega_rad_per_s = self->omega_rad_per_s[k];
    out_line->delay = self->delay[k];
    parametric_line_response(&self->structure, theta, out_line);
    out_line->error =
        self->data->output[k] - out_line->response * parametric_input(self->data, k) - out_line->transient;
    out_line->variance = parametric_error_variance(self->data, k, out_line->response);
}

/// Rows of the real and of the imaginary part; n values and, last, the residual.
struct row_pair {
    double real[parametric_unknowns_max + 1];
    double imag[parametric_unknowns_max + 1];
};

static void add_rows(const struct row_pair *rows, struct tall_qr *io_rows)
{
    tall_qr_add(io_rows, rows->real);
    tall_qr_add(io_rows, rows->imag);
}

/// The residual is e / s, and s depends on theta too: d(e/s) = de / s - e / (2 s^3) d(s^2).
static void add_jacobian(const struct parametric_problem *self, const struct parametric_line *line, size_t k,
                         struct tall_qr *io_rows)
{
    double complex response[parametric_unknowns_max];
    double complex output[parametric_unknowns_max];
    struct row_pair rows;
    parametric_line_gradient(&self->structure, line, response, parametric_input(self->data, k), output);
    double s = sqrt(line->variance);
    double complex residual = line->error / s;
    double complex slope =
        2.0 * (line->response * parametric_input_variance(self->data, k) - parametric_covariance(self->data, k));
    for (size_t i = 0; i < self->layout.unknowns; i++) {
        double complex d = -output[i] / s - residual * (0.5 * real_product(response[i], slope) / line->variance);
        rows.real[i] = creal(d);
        rows.imag[i] = cimag(d);
    }
    rows.real[self->layout.unknowns] = creal(residual);
    rows.imag[self->layout.unknowns] = cimag(residual);
    add_rows(&rows, io_rows);
}

double parametric_problem_evaluate(const void *problem, const double *theta, struct tall_qr *io_rows)
{
    const struct parametric_problem *self = problem;
    double cost = 0.0;
    for (size_t k = 0; k < self->data->count; k++) {
        struct parametric_line line;
        parametric_problem_line(self, theta, k, &line);
        cost += cmplx_power(line.error) / line.variance;
        if (io_rows) {
            add_jacobian(self, &line, k, io_rows);
        }
    }
    return cost;
}

void parametric_problem_information(const struct parametric_problem *self, const double *theta, const double *share,
                                    struct tall_qr *io_rows)
{
    for (size_t k = 0; k < self->data->count; k++) {
        struct parametric_line line;
        double complex response[parametric_unknowns_max];
        double complex output[parametric_unknowns_max];
        struct row_pair rows = {.real = {0.0}};
        parametric_problem_line(self, theta, k, &line);
        // The most likely input: what the error says about the input's noise is taken out of it.
        double complex shared =
            conj(parametric_covariance(self->data, k)) - conj(line.response) * parametric_input_variance(self->data, k);
        double complex input = parametric_input(self->data, k) - shared * line.error / line.variance;
        parametric_line_gradient(&self->structure, &line, response, input, output);
        double weight = sqrt((share ? share[k] : 1.0) / line.variance);
        for (size_t i = 0; i < self->layout.unknowns; i++) {
            rows.real[i] = creal(output[i]) * weight;
            rows.imag[i] = cimag(output[i]) * weight;
        }
        add_rows(&rows, io_rows);
    }
}

static int refuse(const struct parametric_data *data, struct error *out_error, size_t k, const char *what, double value,
                  const char *expectation)
{
    return error_set(out_error, error_refused, "%s: line %zu (%.9g Hz): %s is %g: expected %s", data->name, k + 1,
                     data->frequency_hz[k], what, value, expectation);
}

static int check_variances(const struct parametric_data *data, size_t k, struct error *out_error)
{
    double output = data->output_variance[k];
    double input = parametric_input_variance(data, k);
    double complex covariance = parametric_covariance(data, k);
    const double rounding = 1.0 + 1e-9;
    if (!(output > 0.0 && output < INFINITY) && !(output == 0.0 && input > 0.0)) {
        return refuse(data, out_error, k, "the output's variance", output,
                      "a number above 0 (a recording with scatter from period to period), or equal weights");
    }
    if (!(input >= 0.0 && input < INFINITY)) {
        return refuse(data, out_error, k, "the input's variance", input, "a finite number, not negative");
    }
    if (!(cmplx_power(covariance) <= rounding * input * output)) {
        return refuse(data, out_error, k, "|covariance| of output and input", cabs(covariance),
                      "at most the root of the product of their variances");
    }
    return 0;
}

static int check_line(const struct parametric_data *data, const struct parametric_structure *structure, size_t k,
                      struct error *out_error)
{
    double frequency_hz = data->frequency_hz[k];
    double highest = structure->domain == parametric_discrete ? 0.5 * data->sample_rate_hz : INFINITY;
    if (!(frequency_hz > 0.0 && frequency_hz < highest)) {
        return refuse(data, out_error, k, "the frequency", frequency_hz,
                      structure->domain == parametric_discrete ? "above 0 and below half the sample rate"
                                                               : "a finite number above 0");
    }
    double size = cabs(data->output[k]) + cabs(parametric_input(data, k));
    if (!isfinite(size)) {
        return refuse(data, out_error, k, "|output| + |input|", size, "finite numbers");
    }
    return data->unit_weights ? 0 : check_variances(data, k, out_error);
}

static int check_structure(const struct parametric_data *data, const struct parametric_structure *structure,
                           struct error *out_error)
{
    if (structure->numerator_order > parametric_order_max || structure->denominator_order > parametric_order_max) {
        return error_set(out_error, error_refused, "%s: orders %zu over %zu: expected at most %d", data->name,
                         structure->numerator_order, structure->denominator_order, parametric_order_max);
    }
    if (structure->numerator_lowest > structure->numerator_order ||
        structure->denominator_lowest > structure->denominator_order ||
        (structure->domain == parametric_discrete && structure->denominator_lowest > 0)) {
        return error_set(out_error, error_refused,
                         "%s: lowest powers %zu over %zu: expected at most the orders %zu over %zu, and a constant in "
                         "a discrete denominator",
                         data->name, structure->numerator_lowest, structure->denominator_lowest,
                         structure->numerator_order, structure->denominator_order);
    }
    if (!isfinite(structure->delay_s) || !(structure->delay_limit_s >= 0.0 && structure->delay_limit_s < INFINITY)) {
        return error_set(out_error, error_refused, "%s: delay %g s, searched for over %g s: expected finite numbers",
                         data->name, structure->delay_s, structure->delay_limit_s);
    }
    if (structure->domain == parametric_discrete && !(data->sample_rate_hz > 0.0 && data->sample_rate_hz < INFINITY)) {
        return error_set(out_error, error_refused, "%s: sample rate %g Hz: expected one above 0 for a discrete model",
                         data->name, data->sample_rate_hz);
    }
    if (structure->transient && !data->input) {
        return error_set(
            out_error, error_refused,
            "%s: a frequency response has no transient left to estimate: expected the spectra of input and "
            "output",
            data->name);
    }
    return 0;
}

static int check(const struct parametric_data *data, const struct parametric_structure *structure,
                 struct error *out_error)
{
    int status = check_structure(data, structure, out_error);
    if (status) {
        return status;
    }
    size_t parameters = parametric_layout_of(structure).unknowns - 1;
    if (!(2 * data->count > parameters)) {
        return error_set(out_error, error_refused,
                         "%s: %zu lines for a model of order %zu over %zu with %zu parameters: expected at least %zu "
                         "lines, or lower orders",
                         data->name, data->count, structure->numerator_order, structure->denominator_order, parameters,
                         parameters / 2 + 1);
    }
    if (!data->unit_weights && !data->output_variance) {
        return error_set(out_error, error_refused,
                         "%s: no standard deviations to weigh %zu lines by: expected those of a periodic measurement, "
                         "or equal weights",
                         data->name, data->count);
    }
    if (!data->unit_weights && data->variance_dof != 0.0 && !(data->variance_dof > 2.0)) {
        return error_set(
            out_error, error_refused,
            "%s: variances from %g complex degrees of freedom: expected more than 2 (4 periods or realisations, or "
            "lines that scatter like their neighbours)",
            data->name, data->variance_dof);
    }
    for (size_t k = 0; k < data->count && !status; k++) {
        status = check_line(data, structure, k, out_error);
    }
    return status;
}

/// Powers of s stay near 1 over the band if s is in units of the middle frequency.
static double middle_rad_per_s(const struct parametric_data *data)
{
    double low = data->frequency_hz[0];
    double high = low;
    for (size_t k = 0; k < data->count; k++) {
        low = fmin(low, data->frequency_hz[k]);
        high = fmax(high, data->frequency_hz[k]);
    }
    return two_pi * 0.5 * (low + high);
}

int parametric_problem_init(const struct parametric_data *data, const struct parametric_structure *structure,
                            double scale_rad_per_s, struct parametric_problem *out_self, struct error *out_error)
{
    *out_self = (struct parametric_problem){.data = data, .structure = *structure};
    int status = check(data, structure, out_error);
    if (status) {
        return status;
    }
    out_self->layout = parametric_layout_of(structure);
    out_self->scale_rad_per_s = scale_rad_per_s > 0.0 ? scale_rad_per_s : middle_rad_per_s(data);
    out_self->x = malloc(data->count * sizeof *out_self->x);
    out_self->omega_rad_per_s = malloc(data->count * sizeof *out_self->omega_rad_per_s);
    out_self->delay = malloc(data->count * sizeof *out_self->delay);
    if (!out_self->x || !out_self->omega_rad_per_s || !out_self->delay) {
        parametric_problem_free(out_self);
        return error_set(out_error, error_refused, "%s: not enough memory for %zu lines", data->name, data->count);
    }
    for (size_t k = 0; k < data->count; k++) {
        double omega = two_pi * data->frequency_hz[k];
        out_self->omega_rad_per_s[k] = omega;
        out_self->delay[k] = delay_factor(omega, structure->delay_s);
        out_self->x[k] = variable_at(structure, data->sample_rate_hz, out_self->scale_rad_per_s, omega);
    }
    return 0;
}

void parametric_problem_free(struct parametric_problem *self)
{
    free(self->x);
    free(self->omega_rad_per_s);
    free(self->delay);
    self->x = NULL;
    self->delay = NULL;
    self->omega_rad_per_s = NULL;
}
