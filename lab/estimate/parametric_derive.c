/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_problem.h"

#include "lab/numeric/polynomial.h"

#include <math.h>
#include <stdlib.h>

static const double two_pi = 6.283185307179586476925;

/// A denominator at 0 Hz within this many of its standard deviations may be 0: no gain is given then.
static const double surely_not_zero = 3.0;

/// g' C g for a real gradient over `count` unknowns from `first` on.
static double quadratic(const struct parametric_model *model, size_t first, size_t count, const double *gradient)
{
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        for (size_t j = 0; j < count; j++) {
            sum += gradient[i] * gradient[j] * model->covariance[(first + i) * model->unknowns + first + j];
        }
    }
    return fmax(sum, 0.0);
}

/// s of a root in x, and ds/dx.
static double complex to_s(const struct parametric_model *model, double complex x, double complex *out_slope)
{
    if (model->structure.domain == parametric_continuous) {
        *out_slope = model->scale_rad_per_s;
        return model->scale_rad_per_s * x;
    }
    *out_slope = -model->sample_rate_hz / x;
    return -model->sample_rate_hz * clog(x);
}

/// One root: where it is, and its standard deviations from those of the `count` coefficients, theta's from `first` on.
/// Equation: dx = -sum_i x^i dc_i / p'(x); df = Re(conj(s) ds) / (2 pi |s|); dzeta = Re(s) Im(...) by the chain rule
static struct parametric_root describe(const struct parametric_model *model, const double *coefficients, size_t count,
                                       size_t first, double complex x)
{
    double complex slope;
    double complex s = to_s(model, x, &slope);
    double size = cabs(s);
    struct parametric_root root = {
        .s_rad_per_s = s, .frequency_hz = size / two_pi, .damping = -creal(s) / size, .pair = cimag(x) != 0.0};
    double frequency[parametric_terms_max];
    double damping[parametric_terms_max];
    double real[parametric_terms_max];
    double complex step = -slope / polynomial_slope(coefficients, count - 1, x);
    for (size_t i = 0; i < count; i++, step *= x) {
        double along = (creal(s) * creal(step) + cimag(s) * cimag(step)) / size; // change of |s|
        frequency[i] = along / two_pi;
        damping[i] = (-creal(step) + creal(s) / size * along) / size;
        real[i] = creal(step);
    }
    root.frequency_std_hz = sqrt(quadratic(model, first, count, frequency));
    root.damping_std = sqrt(quadratic(model, first, count, damping));
    root.real_std_rad_per_s = sqrt(quadratic(model, first, count, real));
    return root;
}

static int by_frequency(const void *a, const void *b)
{
    double left = ((const struct parametric_root *)a)->frequency_hz;
    double right = ((const struct parametric_root *)b)->frequency_hz;
    return (left > right) - (left < right);
}

/// Roots of one polynomial: those on or above the real axis. Powers that are absent are roots at s = 0 of a continuous
/// model and delays of a discrete one. Returns false if they are not found.
static bool list_roots(const struct parametric_model *model, const double *coefficients, size_t lowest, size_t order,
                       size_t first, struct parametric_root *out_roots, size_t *out_count)
{
    double complex x[parametric_order_max];
    size_t found = 0;
    size_t listed = 0;
    if (!polynomial_roots(coefficients + lowest, order - lowest, x, &found)) {
        return false;
    }
    for (size_t i = 0; i < lowest && model->structure.domain == parametric_continuous; i++) {
        out_roots[listed++] = (struct parametric_root){.damping = 1.0};
    }
    for (size_t i = 0; i < found; i++) {
        // Discrete: -arg x is the frequency. x below the real axis is s above it.
        double upper = model->structure.domain == parametric_discrete ? -cimag(x[i]) : cimag(x[i]);
        if (upper >= 0.0 && x[i] != 0.0) {
            out_roots[listed++] = describe(model, coefficients + lowest, order - lowest + 1, first, x[i]);
        }
    }
    qsort(out_roots, listed, sizeof *out_roots, by_frequency);
    *out_count = listed;
    return true;
}

static void fill_coefficient_std(struct parametric_model *io_model, const struct parametric_layout *layout)
{
    const struct parametric_structure *structure = &io_model->structure;
    size_t step = io_model->unknowns + 1;
    for (size_t i = 0; i < layout->denominators; i++) {
        io_model->denominator_std[structure->denominator_lowest + i] = sqrt(fmax(io_model->covariance[i * step], 0.0));
    }
    for (size_t i = 0; i < layout->numerators; i++) {
        io_model->numerator_std[structure->numerator_lowest + i] =
            sqrt(fmax(io_model->covariance[(layout->denominators + i) * step], 0.0));
    }
    if (structure->delay_free) {
        io_model->delay_std_s = sqrt(fmax(io_model->covariance[(io_model->unknowns - 1) * step], 0.0));
    }
}

static void fill_dc_gain(struct parametric_model *io_model, const struct parametric_layout *layout)
{
    const struct parametric_structure *structure = &io_model->structure;
    bool discrete = structure->domain == parametric_discrete;
    double at_zero[parametric_terms_max]; // powers of x at 0 Hz
    for (size_t i = 0; i < layout->denominators; i++) {
        at_zero[i] = discrete || structure->denominator_lowest + i == 0 ? 1.0 : 0.0;
    }
    double denominator = 0.0;
    for (size_t i = 0; i < layout->denominators; i++) {
        denominator += at_zero[i] * io_model->denominator[structure->denominator_lowest + i];
    }
    double std = sqrt(quadratic(io_model, 0, layout->denominators, at_zero));
    io_model->dc_gain_known = fabs(denominator) > surely_not_zero * std;
    if (io_model->dc_gain_known) {
        io_model->dc_gain = creal(parametric_response(io_model, 0.0, &io_model->dc_gain_std));
    }
}

/// An integrator is as likely found just right of the axis as left of it. Of a discrete pole 1/z is judged, for which
/// far outside the circle, where the logarithm bends, is near 0.
static bool surely_unstable(const struct parametric_model *model, const struct parametric_root *pole)
{
    double real = creal(pole->s_rad_per_s);
    double std = pole->real_std_rad_per_s;
    if (model->structure.domain == parametric_discrete) {
        double size = exp(-real / model->sample_rate_hz);
        std *= size / model->sample_rate_hz;
        return 1.0 - size > surely_not_zero * std;
    }
    return real > surely_not_zero * std;
}

int parametric_derive(struct parametric_model *io_model, struct error *out_error)
{
    const struct parametric_structure *structure = &io_model->structure;
    struct parametric_layout layout = parametric_layout_of(structure);
    if (!list_roots(io_model, io_model->denominator, structure->denominator_lowest, structure->denominator_order, 0,
                    io_model->poles, &io_model->pole_count) ||
        !list_roots(io_model, io_model->numerator, structure->numerator_lowest, structure->numerator_order,
                    layout.denominators, io_model->zeros, &io_model->zero_count)) {
        return error_set(out_error, error_refused,
                         "poles and zeros of a model of order %zu over %zu were not found: expected lower orders",
                         structure->numerator_order, structure->denominator_order);
    }
    fill_coefficient_std(io_model, &layout);
    fill_dc_gain(io_model, &layout);
    io_model->stable = true;
    for (size_t i = 0; i < io_model->pole_count; i++) {
        io_model->stable = io_model->stable && !surely_unstable(io_model, &io_model->poles[i]);
    }
    return 0;
}
