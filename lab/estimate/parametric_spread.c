/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_problem.h"
#include "lab/numeric/polynomial.h"
#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdlib.h>

/// Poles and zeros are told apart if chance alone puts them as far from each other more seldom.
static const double chance_of_one_place = 0.01;

static void scale_roots(struct parametric_root *io_roots, size_t count, double factor)
{
    for (size_t i = 0; i < count; i++) {
        io_roots[i].frequency_std_hz *= factor;
        io_roots[i].damping_std *= factor;
        io_roots[i].real_std_rad_per_s *= factor;
    }
}

void parametric_inflate(struct parametric_model *io_model, double factor)
{
    double root = sqrt(factor);
    for (size_t i = 0; i < io_model->unknowns * io_model->unknowns; i++) {
        io_model->covariance[i] *= factor;
    }
    for (size_t i = 0; i < parametric_terms_max; i++) {
        io_model->numerator_std[i] *= root;
        io_model->denominator_std[i] *= root;
    }
    scale_roots(io_model->poles, io_model->pole_count, root);
    scale_roots(io_model->zeros, io_model->zero_count, root);
    io_model->delay_std_s *= root;
    io_model->dc_gain_std *= root;
}

/// ds/dtheta of a root of A or B; powers of s that are absent have none.
static void root_gradient(const struct parametric_model *model, bool pole, double complex s,
                          double complex out_gradient[parametric_unknowns_max])
{
    const struct parametric_structure *structure = &model->structure;
    struct parametric_layout layout = parametric_layout_of(structure);
    bool discrete = structure->domain == parametric_discrete;
    double complex x = discrete ? cexp(-s / model->sample_rate_hz) : s / model->scale_rad_per_s;
    double complex slope = discrete ? -model->sample_rate_hz / x : model->scale_rad_per_s;
    const double *coefficients =
        pole ? model->denominator + structure->denominator_lowest : model->numerator + structure->numerator_lowest;
    size_t count = pole ? layout.denominators : layout.numerators;
    size_t first = pole ? 0 : layout.denominators;
    for (size_t i = 0; i < model->unknowns; i++) {
        out_gradient[i] = 0.0;
    }
    double complex step = -slope / polynomial_slope(coefficients, count - 1, x);
    for (size_t i = 0; i < count && s != 0.0; i++, step *= x) {
        out_gradient[first + i] = step;
    }
}

/// Farther apart than this share of the larger one they are two things, however little is known of one of them.
static const double one_place = 0.3;

/// Chance that a pole and a zero that are one and the same are found as far apart; 0 if they cannot be.
static double chance_of_distance(const struct parametric_model *model, const struct parametric_root *pole,
                                 const struct parametric_root *zero)
{
    double complex d = pole->s_rad_per_s - zero->s_rad_per_s;
    if (pole->pair != zero->pair || cabs(d) > one_place * fmax(cabs(pole->s_rad_per_s), cabs(zero->s_rad_per_s))) {
        return 0.0;
    }
    double complex of_pole[parametric_unknowns_max];
    double complex of_zero[parametric_unknowns_max];
    double real = 0.0;
    double imag = 0.0;
    double cross = 0.0;
    root_gradient(model, true, pole->s_rad_per_s, of_pole);
    root_gradient(model, false, zero->s_rad_per_s, of_zero);
    for (size_t i = 0; i < model->unknowns; i++) {
        double complex left = of_pole[i] - of_zero[i];
        for (size_t j = 0; j < model->unknowns; j++) {
            double complex right = of_pole[j] - of_zero[j];
            double c = model->covariance[i * model->unknowns + j];
            real += c * creal(left) * creal(right);
            imag += c * cimag(left) * cimag(right);
            cross += c * creal(left) * cimag(right);
        }
    }
    if (!pole->pair) {
        // A pole that the zero drags along with it, wherever that may be, is as good as on it.
        double alone = fmax(pole->real_std_rad_per_s, zero->real_std_rad_per_s);
        real = fmax(real, alone * alone);
        return real > 0.0 ? statistics_chi2_tail(creal(d) * creal(d) / real, 1.0) : 0.0;
    }
    double determinant = real * imag - cross * cross;
    double distance = imag * creal(d) * creal(d) - 2.0 * cross * creal(d) * cimag(d) + real * cimag(d) * cimag(d);
    return determinant > 0.0 ? statistics_chi2_tail(distance / determinant, 2.0) : 0.0;
}

bool parametric_mark_cancelling(struct parametric_model *io_model)
{
    bool any = false;
    for (size_t i = 0; i < io_model->zero_count; i++) {
        io_model->zeros[i].cancels = false;
    }
    for (size_t i = 0; i < io_model->pole_count; i++) {
        struct parametric_root *pole = &io_model->poles[i];
        struct parametric_root *best = NULL;
        double chance = chance_of_one_place;
        for (size_t j = 0; j < io_model->zero_count; j++) {
            struct parametric_root *zero = &io_model->zeros[j];
            double at_zero = zero->cancels ? 0.0 : chance_of_distance(io_model, pole, zero);
            if (at_zero > chance) {
                chance = at_zero;
                best = zero;
            }
        }
        pole->cancels = best != NULL;
        if (best) {
            best->cancels = true;
            any = true;
        }
    }
    return any;
}

/// Adds R'R to a Gram matrix of n x n.
static void add_gram(const double *R, size_t n, double *io_gram)
{
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            for (size_t k = 0; k <= (i < j ? i : j); k++) {
                io_gram[i * n + j] += R[i * n + k] * R[j * n + k];
            }
        }
    }
}

/// C M C / f
static void sandwich(const struct parametric_model *self, const double *M, double factor, double *out_covariance)
{
    size_t n = self->unknowns;
    for (size_t i = 0; i < n; i++) {
        double product[parametric_unknowns_max] = {0.0};
        for (size_t j = 0; j < n; j++) {
            for (size_t k = 0; k < n; k++) {
                product[j] += self->covariance[i * n + k] * M[k * n + j] / factor;
            }
        }
        for (size_t l = 0; l < n; l++) {
            out_covariance[i * n + l] = 0.0;
            for (size_t j = 0; j < n; j++) {
                out_covariance[i * n + l] += product[j] * self->covariance[j * n + l];
            }
        }
    }
}

int parametric_noise_bound(const struct parametric_data *data, const double *noise_share,
                           const struct parametric_model *self, struct parametric_model *out_model,
                           struct error *out_error)
{
    struct parametric_problem problem;
    struct tall_qr rows = {0};
    double theta[parametric_unknowns_max];
    size_t n = self->unknowns;
    struct parametric_model noise = *self;
    int status = parametric_problem_init(data, &self->structure, self->scale_rad_per_s, &problem, out_error);
    if (status) {
        return status;
    }
    double *work = calloc(2 * n * n, sizeof *work);
    bool ready = work && tall_qr_init(&rows, n);
    if (ready) {
        parametric_pack(self, theta);
        parametric_problem_information(&problem, theta, noise_share, &rows);
        ready = tall_qr_finish(&rows, work);
    }
    if (ready) {
        add_gram(work, n, work + n * n);
        sandwich(self, work + n * n, parametric_covariance_factor(data, self->noise_std), noise.covariance);
        ready = parametric_derive(&noise, NULL) == 0;
    }
    tall_qr_free(&rows);
    free(work);
    parametric_problem_free(&problem);
    if (!ready) {
        return error_set(out_error, error_refused, "%s: memory is short, or a model leaves the range of numbers",
                         data->name);
    }
    *out_model = noise;
    return 0;
}
