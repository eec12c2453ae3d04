/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_region.h"

#include "lab/estimate/parametric_problem.h"

#include <math.h>
#include <stdlib.h>

static const double two_pi = 6.283185307179586476925;

enum { angles = 32, halvings = 60 };

/// Lines beyond this number change the mean by nothing that shows.
enum { lines_enough = 400 };

struct parametric_ellipse parametric_response_ellipse(const struct parametric_model *self, double frequency_hz)
{
    double theta[parametric_unknowns_max];
    double complex gradient[parametric_unknowns_max];
    double complex output[parametric_unknowns_max];
    struct parametric_line line;
    struct parametric_ellipse ellipse = {.real = 0.0};
    parametric_pack(self, theta);
    parametric_line_begin(self, frequency_hz, &line);
    parametric_line_response(&self->structure, theta, &line);
    parametric_line_gradient(&self->structure, &line, gradient, 1.0, output);
    for (size_t i = 0; i < self->unknowns; i++) {
        double complex sum = 0.0;
        for (size_t j = 0; j < self->unknowns; j++) {
            sum += self->covariance[i * self->unknowns + j] * gradient[j];
        }
        ellipse.real += creal(gradient[i]) * creal(sum);
        ellipse.imag += cimag(gradient[i]) * cimag(sum);
        ellipse.cross += creal(gradient[i]) * cimag(sum);
    }
    return ellipse;
}

double parametric_ellipse_chance(const struct parametric_ellipse *self, double c, double dof)
{
    double total = self->real + self->imag;
    double apart = hypot(self->real - self->imag, 2.0 * self->cross);
    double sum = 0.0;
    for (int i = 0; i < angles; i++) {
        // Variance along the ellipse, from its axes (total +- apart) / 2.
        double along = 0.5 * (total + apart * cos(two_pi * (i + 0.5) / angles));
        double ratio = c * c * total / along;
        sum += along > 0.0 ? (dof > 0.0 ? exp(-0.5 * dof * log1p(ratio / dof)) : exp(-0.5 * ratio)) : 0.0;
    }
    return sum / angles;
}

static double mean_chance(const struct parametric_ellipse *ellipses, size_t count, double c, double dof)
{
    double sum = 0.0;
    for (size_t k = 0; k < count; k++) {
        sum += parametric_ellipse_chance(&ellipses[k], c, dof) / (double)count;
    }
    return sum;
}

double parametric_confidence_factor(const struct parametric_model *self, const double *frequency_hz, size_t count,
                                    double probability, double dof)
{
    size_t step = (count + lines_enough - 1) / lines_enough;
    struct parametric_ellipse *ellipses = malloc((count / step + 1) * sizeof *ellipses);
    size_t used = 0;
    double low = 0.0;
    double high = 1.0;
    for (size_t k = 0; ellipses && k < count; k += step) {
        ellipses[used] = parametric_response_ellipse(self, frequency_hz[k]);
        used += ellipses[used].real + ellipses[used].imag > 0.0;
    }
    if (used > 0 && probability > 0.0 && probability < 1.0) {
        while (mean_chance(ellipses, used, high, dof) > 1.0 - probability && high < 1e6) {
            high *= 2.0;
        }
        for (int i = 0; i < halvings; i++) {
            double middle = 0.5 * (low + high);
            bool outside = mean_chance(ellipses, used, middle, dof) > 1.0 - probability;
            low = outside ? middle : low;
            high = outside ? high : middle;
        }
    }
    free(ellipses);
    return used > 0 ? high : NAN;
}
