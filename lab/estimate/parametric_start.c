/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_problem.h"

#include "lab/numeric/cmplx.h"
#include "lab/numeric/scaled_svd.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { iterations_max = 20, idle_max = 3 };

/// Once an iteration gains less than this share of the cost, Gauss-Newton steps gain more.
static const double worth_while = 0.02;

/// Linear problem W (A Y - D B U - I) = 0 in the order I, B, A: noise-free columns first.
struct start {
    const struct parametric_problem *problem;
    double complex *delay; ///< per line
    double *weight;        ///< per line
    size_t n;
    size_t exact; ///< leading columns without noise
    struct tall_qr rows;
    struct scaled_svd svd;
    double *R;      ///< n x n
    double *noise;  ///< n x n: Gram matrix of the noise in the columns, then its Cholesky factor
    double *square; ///< n x n, scratch
    double *vector; ///< n, in the order of the columns
};

/// First weights: the variance at the measured response, and A = 1.
static void weigh_by_data(struct start *self)
{
    const struct parametric_data *data = self->problem->data;
    for (size_t k = 0; k < data->count; k++) {
        double complex input = parametric_input(data, k);
        double complex response = input != 0.0 ? data->output[k] / input : 0.0;
        double weight = 1.0 / sqrt(parametric_error_variance(data, k, response));
        self->weight[k] = isfinite(weight) ? weight : 0.0;
    }
}

/// Weights from the last theta; returns its cost.
static double weigh_by_model(struct start *self, const double *theta)
{
    double cost = 0.0;
    for (size_t k = 0; k < self->problem->data->count; k++) {
        struct parametric_line line;
        parametric_problem_line(self->problem, theta, k, &line);
        cost += cmplx_power(line.error) / line.variance;
        double weight = cabs(line.inverse) / sqrt(line.variance);
        self->weight[k] = isfinite(weight) ? weight : 0.0;
    }
    return cost;
}

/// Puts factor x^lowest, factor x^(lowest + 1), ... into a pair of rows.
static size_t put_powers(double complex factor, double complex x, size_t lowest, size_t count, double *out_real,
                         double *out_imag)
{
    for (; lowest > 0; lowest--) {
        factor *= x;
    }
    for (size_t i = 0; i < count; i++, factor *= x) {
        out_real[i] = creal(factor);
        out_imag[i] = cimag(factor);
    }
    return count;
}

/// Columns I, B, A of one line for given factors of each.
static void fill_rows(const struct parametric_problem *problem, double complex x, double complex transient,
                      double complex input, double complex output, double *out_real, double *out_imag)
{
    const struct parametric_layout *layout = &problem->layout;
    size_t n = put_powers(transient, x, 0, layout->transients, out_real, out_imag);
    n += put_powers(input, x, problem->structure.numerator_lowest, layout->numerators, out_real + n, out_imag + n);
    put_powers(output, x, problem->structure.denominator_lowest, layout->denominators, out_real + n, out_imag + n);
}

/// Adds Re(conj(p_i) p_j) of the noisy columns' factors p for one noise that enters input and output so.
static void add_products(struct start *self, double complex x, double complex input, double complex output)
{
    double real[parametric_unknowns_max];
    double imag[parametric_unknowns_max];
    fill_rows(self->problem, x, 0.0, input, output, real, imag);
    for (size_t i = self->exact; i < self->n; i++) {
        for (size_t j = self->exact; j <= i; j++) {
            self->noise[i * self->n + j] += real[i] * real[j] + imag[i] * imag[j];
        }
    }
}

/// Adds E of the products of the columns' noises. With dY = a + c dU, a and dU independent, c = cov / var U, these are
/// the products of two rows of independent unit noises.
static void add_noise(struct start *self, size_t k)
{
    const struct parametric_problem *problem = self->problem;
    const struct parametric_data *data = problem->data;
    double input_variance = parametric_input_variance(data, k);
    double complex shared = input_variance > 0.0 ? parametric_covariance(data, k) / sqrt(input_variance) : 0.0;
    double output_variance = data->unit_weights ? 1.0 : data->output_variance[k];
    double alone = sqrt(fmax(output_variance - cmplx_power(shared), 0.0)) * self->weight[k];
    double complex along = -self->delay[k] * sqrt(input_variance) * self->weight[k];
    add_products(self, problem->x[k], 0.0, alone);
    if (input_variance > 0.0) {
        add_products(self, problem->x[k], along, shared * self->weight[k]);
    }
}

static bool factorise(struct start *self)
{
    const struct parametric_problem *problem = self->problem;
    double real[parametric_unknowns_max];
    double imag[parametric_unknowns_max];
    tall_qr_reset(&self->rows);
    memset(self->noise, 0, self->n * self->n * sizeof *self->noise);
    for (size_t k = 0; k < problem->data->count; k++) {
        double weight = self->weight[k];
        double complex input = -self->delay[k] * parametric_input(problem->data, k) * weight;
        fill_rows(problem, problem->x[k], -weight, input, problem->data->output[k] * weight, real, imag);
        tall_qr_add(&self->rows, real);
        tall_qr_add(&self->rows, imag);
        add_noise(self, k);
    }
    return tall_qr_finish(&self->rows, self->R);
}

/// The vector that R makes least of for a given size of its noise: smallest generalised singular value. Returns false
/// if the noise has no full rank.
static bool solve_noise(struct start *self)
{
    lapack_int n = (lapack_int)self->n;
    lapack_int exact = (lapack_int)self->exact;
    lapack_int noisy = n - exact;
    size_t corner = self->exact * self->n + self->exact;
    double *cholesky = self->noise + corner; // element (j, i), j <= i, of the upper factor at [i n + j]
    double *left = self->square;
    double *singular = self->vector;
    if (LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'U', noisy, cholesky, n) != 0) {
        return false;
    }
    for (lapack_int i = 0; i < noisy; i++) { // transpose of R's last corner
        for (lapack_int j = 0; j < noisy; j++) {
            left[i * noisy + j] = self->R[corner + (size_t)(j * n + i)];
        }
    }
    if (LAPACKE_dtrtrs(LAPACK_COL_MAJOR, 'U', 'T', 'N', noisy, noisy, cholesky, n, left, noisy) != 0 ||
        LAPACKE_dgesdd(LAPACK_COL_MAJOR, 'O', noisy, noisy, left, noisy, singular, NULL, noisy, self->svd.Vt, noisy)) {
        return false;
    }
    double *tail = self->vector + exact;
    memcpy(tail, left + (noisy - 1) * noisy, (size_t)noisy * sizeof *tail);
    if (LAPACKE_dtrtrs(LAPACK_COL_MAJOR, 'U', 'N', 'N', noisy, 1, cholesky, n, tail, noisy) != 0) {
        return false;
    }
    for (lapack_int i = 0; i < exact; i++) {
        self->vector[i] = 0.0;
        for (lapack_int j = 0; j < noisy; j++) {
            self->vector[i] -= self->R[(exact + j) * n + i] * tail[j];
        }
    }
    return exact == 0 || LAPACKE_dtrtrs(LAPACK_COL_MAJOR, 'U', 'N', 'N', exact, 1, self->R, n, self->vector, n) == 0;
}

/// One linear estimate with the present weights.
static bool solve(struct start *self, double delay_s, double *out_theta)
{
    const struct parametric_layout *layout = &self->problem->layout;
    if (!factorise(self)) {
        return false;
    }
    if (!solve_noise(self)) {
        if (!scaled_svd_factorise(&self->svd, self->R, self->n)) {
            return false;
        }
        scaled_svd_null_vector(&self->svd, self->vector);
    }
    const double *transient = self->vector;
    const double *numerator = transient + layout->transients;
    const double *denominator = numerator + layout->numerators;
    memcpy(out_theta, denominator, layout->denominators * sizeof *out_theta);
    memcpy(out_theta + layout->denominators, numerator, layout->numerators * sizeof *out_theta);
    memcpy(out_theta + layout->denominators + layout->numerators, transient, layout->transients * sizeof *out_theta);
    if (self->problem->structure.delay_free) {
        out_theta[layout->unknowns - 1] = delay_s;
    }
    return true;
}

static double iterate(struct start *self, double delay_s, const double *weigh_by, double *out_theta)
{
    double theta[parametric_unknowns_max];
    double best = INFINITY;
    if (weigh_by) {
        weigh_by_model(self, weigh_by);
    } else {
        weigh_by_data(self);
    }
    double plausible = parametric_plausible_cost(self->problem->data);
    int idle = 0;
    for (int i = 0; i < iterations_max && idle < (best > plausible ? idle_max : 1); i++) {
        if (!solve(self, delay_s, theta)) {
            break;
        }
        double cost = weigh_by_model(self, theta);
        idle = cost < (1.0 - worth_while) * best ? 0 : idle + 1;
        if (cost < best) {
            best = cost;
            memcpy(out_theta, theta, self->problem->layout.unknowns * sizeof *out_theta);
        }
    }
    return best;
}

static bool input_is_exact(const struct parametric_data *data)
{
    bool exact = true;
    for (size_t k = 0; k < data->count; k++) {
        exact = exact && parametric_input_variance(data, k) == 0.0;
    }
    return exact;
}

double parametric_start_find(const struct parametric_problem *self, double delay_s, const double *weigh_by,
                             double *out_theta)
{
    size_t count = self->data->count;
    size_t n = self->layout.unknowns - (self->structure.delay_free ? 1 : 0);
    struct start start = {.problem = self, .n = n, .exact = self->layout.transients};
    if (input_is_exact(self->data)) {
        start.exact += self->layout.numerators;
    }
    double *work = malloc((3 * n * n + n + count) * sizeof *work);
    start.delay = malloc(count * sizeof *start.delay);
    double best = INFINITY;
    if (work && start.delay && tall_qr_init(&start.rows, n) && scaled_svd_init(&start.svd, n)) {
        start.R = work;
        start.noise = start.R + n * n;
        start.square = start.noise + n * n;
        start.vector = start.square + n * n;
        start.weight = start.vector + n;
        for (size_t k = 0; k < count; k++) {
            start.delay[k] = cexp(-I * (self->omega_rad_per_s[k] * delay_s));
        }
        best = iterate(&start, delay_s, weigh_by, out_theta);
    }
    scaled_svd_free(&start.svd);
    tall_qr_free(&start.rows);
    free(start.delay);
    free(work);
    return best;
}
