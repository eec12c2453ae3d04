/* SPDX-License-Identifier: MIT */
#include "lab/design/optimal_power.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

enum {
    steps_max = 200000,
    square_max = design_optimal_parameters_max * design_optimal_parameters_max,
};

struct problem {
    size_t lines;
    size_t parameters;
    double *rows;              ///< 2 lines x parameters: real and imaginary parts of the sensitivities
    double *variance;          ///< lines: trace(M^-1 M_k)
    double factor[square_max]; ///< lower Cholesky factor of the information matrix, row after row
};

/// Lower Cholesky factor; false if a pivot has lost all its digits.
static bool factorise(struct problem *self, const double *power)
{
    const size_t m = self->parameters;
    const double lost = 64 * DBL_EPSILON;
    double *L = self->factor;
    for (size_t i = 0; i < m; i++) {
        for (size_t j = 0; j <= i; j++) {
            double sum = 0;
            for (size_t n = 0; n < 2 * self->lines; n++) {
                sum += power[n / 2] * self->rows[n * m + i] * self->rows[n * m + j];
            }
            L[i * m + j] = sum;
        }
    }
    for (size_t i = 0; i < m; i++) {
        const double whole = L[i * m + i];
        for (size_t j = 0; j <= i; j++) {
            for (size_t k = 0; k < j; k++) {
                L[i * m + j] -= L[i * m + k] * L[j * m + k];
            }
            if (j < i) {
                L[i * m + j] /= L[j * m + j];
            }
        }
        if (!(L[i * m + i] > lost * whole)) {
            return false;
        }
        L[i * m + i] = sqrt(L[i * m + i]);
    }
    return true;
}

/// Solves L x = row in place.
static void solve(const struct problem *self, double *row)
{
    const size_t m = self->parameters;
    for (size_t i = 0; i < m; i++) {
        for (size_t j = 0; j < i; j++) {
            row[i] -= self->factor[i * m + j] * row[j];
        }
        row[i] /= self->factor[i * m + i];
    }
}

/// Fills in trace(M^-1 M_k), the squares of L^-1 times the line's two rows; returns the largest.
static double find_variances(struct problem *self)
{
    double largest = 0;
    for (size_t n = 0; n < 2 * self->lines; n++) {
        double row[design_optimal_parameters_max];
        double sum = n % 2 == 0 ? 0 : self->variance[n / 2];
        for (size_t i = 0; i < self->parameters; i++) {
            row[i] = self->rows[n * self->parameters + i];
        }
        solve(self, row);
        for (size_t i = 0; i < self->parameters; i++) {
            sum += row[i] * row[i];
        }
        self->variance[n / 2] = sum;
        largest = fmax(largest, sum);
    }
    return largest;
}

/// Columns of length 1, then of information 1 under equal power: shares do not depend on the choice of parameters, the
/// digits left over do.
static bool normalise(struct problem *self, const double *equal_power)
{
    const size_t m = self->parameters;
    for (size_t i = 0; i < m; i++) {
        double largest = 0;
        for (size_t n = 0; n < 2 * self->lines; n++) {
            largest = fmax(largest, fabs(self->rows[n * m + i]));
        }
        for (size_t n = 0; largest > 0 && n < 2 * self->lines; n++) {
            self->rows[n * m + i] /= largest;
        }
    }
    if (!factorise(self, equal_power)) {
        return false;
    }
    for (size_t n = 0; n < 2 * self->lines; n++) {
        solve(self, &self->rows[n * m]);
    }
    return true;
}

static enum design_optimal_status iterate(struct problem *self, double *power, struct design_optimal_report *report)
{
    const double m = (double)self->parameters;
    for (report->steps = 0; report->steps < steps_max; report->steps++) {
        if (!factorise(self, power)) {
            return design_optimal_singular;
        }
        report->gap = find_variances(self) / m - 1;
        if (report->gap <= DESIGN_OPTIMAL_GAP) {
            return design_optimal_ok;
        }
        double sum = 0;
        for (size_t k = 0; k < self->lines; k++) {
            power[k] *= self->variance[k] / m;
            sum += power[k];
        }
        for (size_t k = 0; k < self->lines; k++) {
            power[k] /= sum; // 1 but for rounding
        }
    }
    return design_optimal_slow;
}

enum design_optimal_status design_optimal_power(size_t lines, size_t parameters, const double complex *sensitivities,
                                                double *out_power, struct design_optimal_report *out_report)
{
    struct problem self = {.lines = lines, .parameters = parameters};
    *out_report = (struct design_optimal_report){.gap = INFINITY};
    self.rows = calloc((2 * parameters + 1) * lines, sizeof *self.rows);
    if (!self.rows) {
        return design_optimal_memory;
    }
    self.variance = self.rows + 2 * lines * parameters;
    enum design_optimal_status status = design_optimal_ok;
    for (size_t k = 0; k < lines; k++) {
        out_power[k] = 1 / (double)lines;
        for (size_t i = 0; i < parameters; i++) {
            double complex value = sensitivities[k * parameters + i];
            self.rows[2 * k * parameters + i] = creal(value);
            self.rows[(2 * k + 1) * parameters + i] = cimag(value);
            if (status == design_optimal_ok && !(isfinite(creal(value)) && isfinite(cimag(value)))) {
                status = design_optimal_not_finite;
                out_report->line = k;
            }
        }
    }
    if (status == design_optimal_ok && !normalise(&self, out_power)) {
        status = design_optimal_singular;
    }
    status = status == design_optimal_ok ? iterate(&self, out_power, out_report) : status;
    free(self.rows);
    return status;
}
