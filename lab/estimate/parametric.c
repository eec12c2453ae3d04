/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric.h"

#include "lab/estimate/parametric_problem.h"
#include "lab/numeric/levenberg.h"
#include "lab/numeric/scaled_svd.h"
#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    iterations_max = 100,
    quick_iterations = 20,
    rounds_max = 3,
    delay_starts_max = 64,
    delay_starts_few = 8, // around a delay that is known
    delay_starts_refined = 3,
    delay_iterations = 6,
    delay_levels = 4,
};

/// A further step would change the cost by less than this share: parameters by under 1e-4 of their deviations up to
/// a hundred thousand lines.
static const double cost_tolerance = 1e-13;

/// Directions below this share of the largest singular value are not determined by the data.
static const double least_share = 1e-13;

/// Delays closer than this share of the fastest line's period lead to the same minimum.
static const double delay_spacing = 0.125;

struct attempt {
    double theta[parametric_unknowns_max];
    struct levenberg_outcome outcome;
};

static int by_cost(const void *a, const void *b)
{
    double left = ((const struct attempt *)a)->outcome.cost;
    double right = ((const struct attempt *)b)->outcome.cost;
    return (left > right) - (left < right);
}

/// Gauss-Newton steps from where the attempt is; its cost is infinite if that is nowhere.
static void refine(const struct parametric_problem *problem, size_t iterations, struct attempt *io_attempt)
{
    struct levenberg_problem minimise = {.unknowns = problem->layout.unknowns,
                                         .redundant = 1, // a factor of A, B and I together
                                         .context = problem,
                                         .evaluate = parametric_problem_evaluate};
    if (!levenberg_minimise(&minimise, iterations, cost_tolerance, io_attempt->theta, &io_attempt->outcome)) {
        io_attempt->outcome.cost = INFINITY;
    }
}

static void begin_attempt(const struct parametric_problem *problem, double delay_s, const double *weigh_by,
                          size_t iterations, struct attempt *out_attempt)
{
    out_attempt->outcome = (struct levenberg_outcome){.cost = INFINITY};
    if (isfinite(parametric_start_find(problem, delay_s, weigh_by, out_attempt->theta))) {
        refine(problem, iterations, out_attempt);
    }
}

static double delay_of(const struct parametric_problem *problem, const struct attempt *attempt)
{
    return problem->structure.delay_free ? attempt->theta[problem->layout.unknowns - 1] : problem->structure.delay_s;
}

/// Starts closer and closer around a delay: with little noise only those next to the right one lead to the minimum.
static void zoom(const struct parametric_problem *problem, double spacing_s, struct attempt *io_best)
{
    for (int level = 0; level < delay_levels; level++, spacing_s *= 0.5) {
        double centre_s = delay_of(problem, io_best);
        for (int side = -1; side <= 1; side++) {
            struct attempt attempt;
            begin_attempt(problem, centre_s + side * spacing_s, NULL, delay_iterations, &attempt);
            if (attempt.outcome.cost < io_best->outcome.cost) {
                *io_best = attempt;
            }
        }
    }
}

/// With a free delay there is a minimum about every half period of the fastest line: starts on a grid, a few steps
/// each, then the best ones to their end.
static void search_delays(const struct parametric_problem *problem, bool quick, struct attempt *out_best)
{
    const struct parametric_structure *structure = &problem->structure;
    double fastest_hz = 0.0;
    for (size_t k = 0; k < problem->data->count; k++) {
        fastest_hz = fmax(fastest_hz, problem->data->frequency_hz[k]);
    }
    double limit_s = structure->delay_limit_s > 0.0 ? structure->delay_limit_s : 4.0 / fastest_hz;
    double steps = fmin(ceil(limit_s * fastest_hz / delay_spacing), delay_starts_max - 1);
    size_t count = (size_t)steps + 1;
    struct attempt *attempts = malloc(count * sizeof *attempts);
    if (!attempts) {
        return;
    }
    for (size_t i = 0; i < count; i++) {
        double delay_s = structure->delay_s + limit_s * (double)i / fmax(steps, 1.0);
        begin_attempt(problem, delay_s, NULL, delay_iterations, &attempts[i]);
    }
    qsort(attempts, count, sizeof *attempts, by_cost);
    size_t refined = quick || count <= delay_starts_few ? 1 : delay_starts_refined;
    for (size_t i = 0; i < refined && isfinite(attempts[i].outcome.cost); i++) {
        zoom(problem, 0.5 * limit_s / fmax(steps, 1.0), &attempts[i]);
        refine(problem, iterations_max, &attempts[i]);
    }
    qsort(attempts, refined, sizeof *attempts, by_cost);
    *out_best = attempts[0];
    free(attempts);
}

/// A cost far above what noise explains may be a local minimum: linear estimates with the weights found there lead to
/// others.
static void search_again(const struct parametric_problem *problem, struct attempt *io_best)
{
    const double gain = 1e-6;
    double plausible = parametric_plausible_cost(problem->data);
    for (int round = 0; round < rounds_max && io_best->outcome.cost > plausible; round++) {
        struct attempt next;
        begin_attempt(problem, delay_of(problem, io_best), io_best->theta, iterations_max, &next);
        if (!(next.outcome.cost < io_best->outcome.cost * (1.0 - gain))) {
            break;
        }
        *io_best = next;
    }
}

static bool search(const struct parametric_problem *problem, const struct parametric_model *start, bool quick,
                   struct attempt *out_best)
{
    size_t iterations = quick ? quick_iterations : iterations_max;
    out_best->outcome = (struct levenberg_outcome){.cost = INFINITY};
    if (start) {
        parametric_pack(start, out_best->theta);
        refine(problem, iterations, out_best);
    } else if (problem->structure.delay_free) {
        search_delays(problem, quick, out_best);
    } else {
        begin_attempt(problem, problem->structure.delay_s, NULL, iterations, out_best);
    }
    if (!start && !quick && isfinite(out_best->outcome.cost)) {
        search_again(problem, out_best);
    }
    return isfinite(out_best->outcome.cost);
}

/// Makes the denominator's constant (discrete) or highest coefficient (continuous) 1. Returns false if it is 0.
static bool normalise(const struct parametric_problem *problem, double *inout_theta)
{
    const struct parametric_layout *layout = &problem->layout;
    bool discrete = problem->structure.domain == parametric_discrete;
    double reference = inout_theta[discrete ? 0 : layout->denominators - 1];
    size_t coefficients = layout->unknowns - (problem->structure.delay_free ? 1 : 0);
    for (size_t i = 0; i < coefficients; i++) {
        inout_theta[i] /= reference;
    }
    return isfinite(1.0 / reference);
}

/// Covariance of the coefficients with the reference held at 1, from that of the redundant ones: T C T' with
/// T = 1 - theta e', e picking the reference. The delay is no coefficient: its element of theta counts as 0 in T.
static void hold_reference(const struct parametric_problem *problem, const double *theta, double *inout_covariance)
{
    size_t n = problem->layout.unknowns;
    size_t reference = problem->structure.domain == parametric_discrete ? 0 : problem->layout.denominators - 1;
    size_t coefficients = n - (problem->structure.delay_free ? 1 : 0);
    for (size_t pass = 0; pass < 2; pass++) { // rows, then columns
        size_t along = pass == 0 ? n : 1;
        size_t across = pass == 0 ? 1 : n;
        for (size_t j = 0; j < n; j++) {
            double held = inout_covariance[j * along + reference * across];
            for (size_t i = 0; i < coefficients; i++) {
                inout_covariance[j * along + i * across] -= theta[i] * held;
            }
        }
    }
}

double parametric_covariance_factor(const struct parametric_data *data, double noise_std)
{
    if (data->unit_weights) {
        return 0.5 * noise_std * noise_std;
    }
    double dof = data->variance_dof;
    // Estimated variances: their inverses are dof / (dof - 1) too large on average, and weights that scatter cost
    // (dof - 1) / (dof - 2) of the variance.
    return dof > 0.0 ? 0.5 * dof / (dof - 2.0) : 0.5;
}

static int fill_covariance(const struct parametric_problem *problem, double *theta, struct parametric_model *io_model,
                           struct error *out_error)
{
    size_t n = problem->layout.unknowns;
    struct tall_qr rows = {0};
    struct scaled_svd svd = {0};
    double *R = malloc(n * n * sizeof *R);
    bool ready = R && tall_qr_init(&rows, n) && scaled_svd_init(&svd, n);
    if (ready) {
        parametric_problem_information(problem, theta, NULL, &rows);
        ready = tall_qr_finish(&rows, R) && scaled_svd_factorise(&svd, R, n);
    }
    size_t rank = ready ? scaled_svd_rank(&svd, n - 1, least_share) : 0;
    if (rank == n - 1) {
        scaled_svd_inverse_gram(&svd, rank, io_model->covariance);
        hold_reference(problem, theta, io_model->covariance);
        io_model->condition = n > 1 ? svd.singular[0] / svd.singular[n - 2] : 1.0;
        double factor = parametric_covariance_factor(problem->data, io_model->noise_std);
        for (size_t i = 0; i < n * n; i++) {
            io_model->covariance[i] *= factor;
        }
    }
    scaled_svd_free(&svd);
    tall_qr_free(&rows);
    free(R);
    if (!ready) {
        return error_set(out_error, error_refused, "%s: the model leaves the range of numbers, or memory is short",
                         problem->data->name);
    }
    if (rank < n - 1) {
        return error_set(out_error, error_refused,
                         "%s: %zu lines determine %zu of %zu parameters of a model of order %zu over %zu: expected "
                         "lower orders, or more lines",
                         problem->data->name, problem->data->count, rank, n - 1, problem->structure.numerator_order,
                         problem->structure.denominator_order);
    }
    return 0;
}

/// Mean and variance of |residual|^2 ~ F(2, 2 dof), exponential without limit: dof / (dof - 1) and
/// dof^3 / ((dof - 1)^2 (dof - 2)).
static void residual_moments(const struct parametric_data *data, double *out_mean, double *out_variance)
{
    double dof = data->variance_dof;
    *out_mean = dof > 0.0 ? dof / (dof - 1.0) : 1.0;
    *out_variance = dof > 0.0 ? *out_mean * *out_mean * dof / (dof - 2.0) : 1.0;
}

double parametric_plausible_cost(const struct parametric_data *data)
{
    double mean;
    double variance;
    double lines = (double)data->count;
    residual_moments(data, &mean, &variance);
    return data->unit_weights ? 0.0 : mean * lines + 4.0 * sqrt(variance * lines);
}

static void fill_cost(const struct parametric_data *data, struct parametric_model *io_model)
{
    double freedom = (double)data->count - 0.5 * (double)io_model->parameters;
    double mean;
    double variance;
    residual_moments(data, &mean, &variance);
    if (data->unit_weights) {
        io_model->noise_std = sqrt(io_model->cost / freedom);
        return;
    }
    io_model->cost_expected = mean * freedom;
    io_model->cost_std = sqrt(variance * freedom);
}

/// Autocorrelation r_l of the residual over lines: (count - l) |r_l|^2 / (mean power)^2 ~ exponential for white noise.
/// Seen from the input: its phases, which may be random, would make the residual of a wrong response white.
static int fill_whiteness(const struct parametric_data *data, struct parametric_model *io_model,
                          struct error *out_error)
{
    double complex *residual = malloc(data->count * sizeof *residual);
    if (!residual) {
        return error_set(out_error, error_refused, "%s: not enough memory for %zu lines", data->name, data->count);
    }
    parametric_residual(io_model, data, residual);
    size_t lags = data->count / 4 < 20 ? data->count / 4 : 20;
    double power = 0.0;
    for (size_t k = 0; k < data->count; k++) {
        double complex input = parametric_input(data, k);
        residual[k] *= input != 0.0 ? conj(input) / cabs(input) : 1.0;
        power += creal(residual[k] * conj(residual[k])) / (double)data->count;
    }
    double sum = 0.0;
    io_model->residual_correlation = 0.0;
    for (size_t lag = 1; lag <= lags && power > 0.0; lag++) {
        double complex product = 0.0;
        for (size_t k = lag; k < data->count; k++) {
            product += residual[k] * conj(residual[k - lag]);
        }
        double pairs = (double)(data->count - lag);
        double correlation = cabs(product) / pairs / power;
        io_model->residual_correlation = fmax(io_model->residual_correlation, correlation);
        sum += pairs * correlation * correlation;
    }
    io_model->whiteness_chance = lags > 0 ? statistics_chi2_tail(2.0 * sum, 2.0 * (double)lags) : 1.0;
    free(residual);
    return 0;
}

static int complete(const struct parametric_problem *problem, double *theta, struct parametric_model *io_model,
                    struct error *out_error)
{
    const struct parametric_data *data = problem->data;
    if (!normalise(problem, theta)) {
        return error_set(out_error, error_refused,
                         "%s: the denominator's %s coefficient is 0 in a model of order %zu over %zu: expected lower "
                         "orders",
                         data->name, problem->structure.domain == parametric_discrete ? "constant" : "highest",
                         problem->structure.numerator_order, problem->structure.denominator_order);
    }
    parametric_unpack(theta, io_model);
    fill_cost(data, io_model);
    int status = fill_covariance(problem, theta, io_model, out_error);
    if (!status) {
        status = fill_whiteness(data, io_model, out_error);
    }
    return status ? status : parametric_derive(io_model, out_error);
}

static struct parametric_model begin_model(const struct parametric_problem *problem)
{
    return (struct parametric_model){.structure = problem->structure,
                                     .sample_rate_hz = problem->data->sample_rate_hz,
                                     .scale_rad_per_s = problem->scale_rad_per_s,
                                     .lines = problem->data->count,
                                     .unknowns = problem->layout.unknowns,
                                     .parameters = problem->layout.unknowns - 1};
}

static int fit(const struct parametric_data *data, const struct parametric_structure *structure,
               const struct parametric_model *start, bool quick, struct parametric_model *out_model,
               struct error *out_error)
{
    struct parametric_problem problem;
    double scale = start ? start->scale_rad_per_s : 0.0;
    int status = parametric_problem_init(data, structure, scale, &problem, out_error);
    struct attempt best;
    struct parametric_model model = {0};
    if (!status) {
        model = begin_model(&problem);
        if (search(&problem, start, quick, &best)) {
            model.cost = best.outcome.cost;
            model.iterations = best.outcome.iterations;
            model.converged = best.outcome.converged;
            status = complete(&problem, best.theta, &model, out_error);
        } else {
            status =
                error_set(out_error, error_refused,
                          "%s: no model of order %zu over %zu was found for %zu lines: expected a response that is "
                          "not 0, and enough memory",
                          data->name, structure->numerator_order, structure->denominator_order, data->count);
        }
        parametric_problem_free(&problem);
    }
    if (status) {
        model = (struct parametric_model){0};
    }
    *out_model = model;
    return status;
}

int parametric_fit(const struct parametric_data *data, const struct parametric_structure *structure,
                   const struct parametric_model *start, struct parametric_model *out_model, struct error *out_error)
{
    return fit(data, structure, start, false, out_model, out_error);
}

int parametric_fit_quickly(const struct parametric_data *data, const struct parametric_structure *structure,
                           struct parametric_model *out_model, struct error *out_error)
{
    return fit(data, structure, NULL, true, out_model, out_error);
}

int parametric_bound(const struct parametric_data *data, struct parametric_model *io_model, struct error *out_error)
{
    struct parametric_problem problem;
    int status = parametric_problem_init(data, &io_model->structure, io_model->scale_rad_per_s, &problem, out_error);
    if (status) {
        return status;
    }
    double theta[parametric_unknowns_max];
    parametric_pack(io_model, theta);
    struct parametric_model model = begin_model(&problem);
    model.noise_std = io_model->noise_std;
    status = normalise(&problem, theta)
                 ? 0
                 : error_set(out_error, error_refused, "%s: the model's denominator is 0", data->name);
    parametric_unpack(theta, &model);
    if (!status) {
        status = fill_covariance(&problem, theta, &model, out_error);
    }
    if (!status) {
        status = parametric_derive(&model, out_error);
    }
    parametric_problem_free(&problem);
    if (!status) {
        *io_model = model;
    }
    return status;
}

double parametric_misfit(const struct parametric_model *self)
{
    const double chance = 4.0;
    bool beyond = self->cost_expected > 0.0 && self->cost > self->cost_expected + chance * self->cost_std;
    return beyond ? self->cost / self->cost_expected : 1.0;
}

double complex parametric_response(const struct parametric_model *self, double frequency_hz, double *out_std)
{
    double theta[parametric_unknowns_max];
    struct parametric_line line;
    parametric_pack(self, theta);
    parametric_line_begin(self, frequency_hz, &line);
    parametric_line_response(&self->structure, theta, &line);
    if (out_std) {
        double complex gradient[parametric_unknowns_max];
        double complex output[parametric_unknowns_max];
        parametric_line_gradient(&self->structure, &line, gradient, 1.0, output);
        double variance = 0.0;
        for (size_t i = 0; i < self->unknowns; i++) {
            double complex sum = 0.0;
            for (size_t j = 0; j < self->unknowns; j++) {
                sum += self->covariance[i * self->unknowns + j] * gradient[j];
            }
            variance += creal(conj(gradient[i]) * sum);
        }
        *out_std = sqrt(fmax(variance, 0.0));
    }
    return line.response;
}

/// Residual of line k, without the transient where the data do not have the model's.
static double complex residual_of(const struct parametric_model *self, const double *theta,
                                  const struct parametric_data *data, size_t k, bool transient)
{
    struct parametric_line line;
    parametric_line_begin(self, data->frequency_hz[k], &line);
    parametric_line_response(&self->structure, theta, &line);
    double complex error = data->output[k] - line.response * parametric_input(data, k);
    if (transient) {
        error -= line.transient;
    }
    return error / sqrt(parametric_error_variance(data, k, line.response));
}

double parametric_cost(const struct parametric_model *self, const struct parametric_data *data, bool transient)
{
    double theta[parametric_unknowns_max];
    double cost = 0.0;
    parametric_pack(self, theta);
    for (size_t k = 0; k < data->count; k++) {
        double complex residual = residual_of(self, theta, data, k, transient);
        cost += creal(residual * conj(residual));
    }
    return cost;
}

void parametric_residual(const struct parametric_model *self, const struct parametric_data *data,
                         double complex *out_residual)
{
    double theta[parametric_unknowns_max];
    parametric_pack(self, theta);
    for (size_t k = 0; k < data->count; k++) {
        out_residual[k] = residual_of(self, theta, data, k, true);
        if (data->unit_weights && self->noise_std > 0.0) {
            out_residual[k] /= self->noise_std;
        }
    }
}
