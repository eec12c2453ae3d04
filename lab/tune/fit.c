/* SPDX-License-Identifier: MIT */
#include "lab/tune/fit.h"

#include "lab/numeric/cmplx.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/// The stretch of the axis that a line stands for; the ends are as wide as their neighbour's distance.
static double width_hz(const struct tune_plant *plant, size_t k)
{
    const double *f = plant->frequency_hz;
    const size_t last = plant->count - 1;
    const double below = k > 0 ? f[k] - f[k - 1] : f[1] - f[0];
    const double above = k < last ? f[k + 1] - f[k] : f[last] - f[last - 1];
    return 0.5 * (below + above);
}

static void fill_in(struct tune_problem *self, const struct tune_plant *plant, const struct tune_controller *controller,
                    const struct tune_reference *reference, enum tune_weighting weighting)
{
    double sum = 0.0;
    for (size_t k = 0; k < self->lines; k++) {
        const double f = plant->frequency_hz[k];
        const double power = width_hz(plant, k) / (weighting == tune_weighting_log ? f : 1.0);
        self->weight[k] = sqrt(power);
        sum += power;
        self->variance[k] = plant->std[k] * plant->std[k];
        self->reference[k] = tune_reference_at(reference, f);
        for (size_t i = 0; i < self->gains; i++) {
            self->term[i * self->lines + k] = tune_controller_term(controller, i, plant->delay[k]);
        }
    }
    for (size_t k = 0; k < self->lines; k++) {
        self->weight[k] /= sqrt(sum);
    }
}

bool tune_problem_init(struct tune_problem *self, const struct tune_plant *plant,
                       const struct tune_controller *controller, const struct tune_reference *reference,
                       enum tune_weighting weighting)
{
    const size_t lines = plant->count, gains = controller->structure->gains;
    *self = (struct tune_problem){
        .lines = lines,
        .gains = gains,
        .weight = calloc(lines, sizeof *self->weight),
        .reference = calloc(lines, sizeof *self->reference),
        .term = calloc(lines * gains, sizeof *self->term),
        .variance = calloc(lines, sizeof *self->variance),
    };
    if (!self->weight || !self->reference || !self->term || !self->variance) {
        tune_problem_free(self);
        return false;
    }
    fill_in(self, plant, controller, reference, weighting);
    return true;
}

void tune_problem_free(struct tune_problem *self)
{
    free(self->weight);
    free(self->reference);
    free(self->term);
    free(self->variance);
    *self = (struct tune_problem){0};
}

static double complex loop_at(const struct tune_problem *self, const double complex *response, const double *gain,
                              size_t k)
{
    double complex sum = 0.0;
    for (size_t i = 0; i < self->gains; i++) {
        sum += gain[i] * self->term[i * self->lines + k];
    }
    return sum * response[k];
}

/// A loop's distance from -1 is far from the ends of what a double holds, which complex.h's division looks out for.
static double complex reciprocal(double complex z)
{
    const double square = creal(z) * creal(z) + cimag(z) * cimag(z);
    return CMPLX(creal(z) / square, -cimag(z) / square);
}

double tune_fit_cost(const struct tune_problem *self, const double complex *response, const double *gain)
{
    double sum = 0.0;
    for (size_t k = 0; k < self->lines; k++) {
        const double complex loop = loop_at(self, response, gain, k);
        const double error = self->weight[k] * cabs(self->reference[k] - loop * reciprocal(1.0 + loop));
        sum += error * error;
    }
    return sum;
}

/// Normal equations of the weighted problem: minimise target_square - 2 g'b + g'H g.
struct normal {
    double H[tune_gains_max][tune_gains_max], b[tune_gains_max];
    double noise[tune_gains_max][tune_gains_max]; ///< what noise on the response is expected to add to H
};

static double real_product(double complex a, double complex b)
{
    return creal(a) * creal(b) + cimag(a) * cimag(b);
}

/// `gain` NULL: the weight is 1 - M, else 1/(1 + L) with these gains.
static void collect(const struct tune_problem *self, const double complex *response, const double *gain,
                    struct normal *out)
{
    memset(out, 0, sizeof *out);
    for (size_t k = 0; k < self->lines; k++) {
        const double complex rest = 1.0 - self->reference[k];
        const double complex factor =
            self->weight[k] * (gain ? reciprocal(1.0 + loop_at(self, response, gain, k)) : rest);
        double complex column[tune_gains_max];
        for (size_t i = 0; i < self->gains; i++) {
            column[i] = factor * rest * self->term[i * self->lines + k];
            out->b[i] += real_product(column[i] * response[k], factor * self->reference[k]);
            for (size_t j = 0; j <= i; j++) {
                const double product = real_product(column[i], column[j]);
                out->noise[i][j] += self->variance[k] * product;
                out->H[i][j] += real_product(response[k], response[k]) * product;
            }
        }
    }
}

/// Solves with the gains of `support` (a bit each), the others 0, and returns whether the columns are independent.
/// Columns are scaled to length 1: the square of a pivot is what a column has of its own, apart from those before it.
static bool solve_support(const struct normal *normal, size_t gains, unsigned support, bool compensate,
                          double *out_gain)
{
    const double own_least = 1e-13;
    double H[tune_gains_max * tune_gains_max], b[tune_gains_max], length[tune_gains_max];
    size_t index[tune_gains_max], n = 0;
    for (size_t i = 0; i < gains; i++) {
        out_gain[i] = 0.0;
        if (support >> i & 1U) {
            length[n] = sqrt(normal->H[i][i]);
            b[n] = normal->b[i] / length[n];
            index[n++] = i;
        }
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            const double noise = compensate ? normal->noise[index[i]][index[j]] : 0.0;
            H[j * n + i] = (normal->H[index[i]][index[j]] - noise) / (length[i] * length[j]);
        }
    }
    const lapack_int order = (lapack_int)n;
    if (n > 0 && LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', order, 1, H, order, b, order) != 0) {
        return false;
    }
    for (size_t i = 0; i < n; i++) {
        if (!(H[i * n + i] * H[i * n + i] > own_least)) {
            return false;
        }
        out_gain[index[i]] = b[i] / length[i];
    }
    return true;
}

static bool none_negative(size_t gains, const double *gain)
{
    for (size_t i = 0; i < gains; i++) {
        if (!(gain[i] >= 0.0)) {
            return false;
        }
    }
    return true;
}

/// What the sum of squares rises by above its target's own.
static double value_at(const struct normal *normal, size_t gains, bool compensate, const double *gain)
{
    double sum = 0.0;
    for (size_t i = 0; i < gains; i++) {
        sum -= 2.0 * gain[i] * normal->b[i];
        for (size_t j = 0; j <= i; j++) {
            const double h = normal->H[i][j] - (compensate ? normal->noise[i][j] : 0.0);
            sum += (i == j ? 1.0 : 2.0) * gain[i] * gain[j] * h;
        }
    }
    return sum;
}

/// Least squares over gains >= 0. With at most three of them every active set can be tried: the best of the solutions
/// that are not negative is the minimum. All of them free is the minimum at once, if it is not negative.
static bool solve(const struct normal *normal, size_t gains, bool compensate, double *out_gain)
{
    const unsigned all = (1U << gains) - 1U;
    if (!solve_support(normal, gains, all, compensate, out_gain)) {
        return false;
    }
    if (none_negative(gains, out_gain)) {
        return true;
    }
    double least = INFINITY;
    for (unsigned support = 0; support < all; support++) {
        double gain[tune_gains_max];
        if (solve_support(normal, gains, support, compensate, gain) && none_negative(gains, gain) &&
            value_at(normal, gains, compensate, gain) < least) {
            least = value_at(normal, gains, compensate, gain);
            memcpy(out_gain, gain, gains * sizeof *gain);
        }
    }
    return true;
}

/// Where noise makes up more than half of a column its expected share is no longer a small correction, and is left in.
static bool is_small(const struct normal *normal, size_t gains)
{
    for (size_t i = 0; i < gains; i++) {
        if (!(normal->noise[i][i] <= 0.5 * normal->H[i][i])) {
            return false;
        }
    }
    return true;
}

static bool fit(const struct tune_problem *self, const double complex *response, const double *before, double *out_gain)
{
    struct normal normal;
    collect(self, response, before, &normal);
    return (is_small(&normal, self->gains) && solve(&normal, self->gains, true, out_gain)) ||
           solve(&normal, self->gains, false, out_gain);
}

bool tune_fit_linear(const struct tune_problem *self, const double complex *response, double *out_gain)
{
    return fit(self, response, NULL, out_gain);
}

bool tune_fit_reweighted(const struct tune_problem *self, const double complex *response, double *io_gain)
{
    const double settled = 1e-12; // relative: what further iterations would still change is lost in rounding
    bool moves = true;
    for (int iteration = 0; iteration < tune_iterations && moves; iteration++) {
        double before[tune_gains_max];
        memcpy(before, io_gain, self->gains * sizeof *before);
        if (!fit(self, response, before, io_gain)) {
            return false;
        }
        moves = false;
        for (size_t i = 0; i < self->gains; i++) {
            moves = moves || !(fabs(io_gain[i] - before[i]) <= settled * fabs(io_gain[i]));
        }
    }
    return true;
}
