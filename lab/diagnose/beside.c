/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/beside.h"

#include "lab/numeric/vector.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Share of a column's square below which what is left of it beside others is rounding.
static const double own_least = 1e-12;

/// Takes out of a vector what the basis has of it.
static void take_out(const struct beside *self, double *io_vector)
{
    for (size_t i = 0; i < self->columns; i++) {
        const double *unit = self->basis + i * self->length;
        double along = vector_dot(self->length, unit, io_vector);
        for (size_t j = 0; j < self->length; j++)
            io_vector[j] -= along * unit[j];
    }
}

/// Adds what a column has of its own to the basis.
static void add_column(struct beside *self, const double *column)
{
    double *unit = self->basis + self->columns * self->length;
    double whole = vector_dot(self->length, column, column);
    memcpy(unit, column, self->length * sizeof *unit);
    take_out(self, unit);
    take_out(self, unit); // the first pass leaves rounding of what it takes out, which may be nearly all
    double own = vector_dot(self->length, unit, unit);
    if (!(own > own_least * whole))
        return;
    for (size_t j = 0; j < self->length; j++)
        unit[j] /= sqrt(own);
    self->columns++;
}

static bool at_wall(const struct hypothesis *h, size_t i)
{
    return !(h->x[i] > h->coordinates[i].lower && h->x[i] < h->coordinates[i].upper);
}

bool beside_init(struct beside *self, const struct fit_data *data, const struct hypothesis *hypothesis,
                 const struct fit *fit)
{
    size_t rows = data->values, n = hypothesis->count, length = rows + n;
    double weight[hypothesis_coordinates_max], centre[hypothesis_coordinates_max];
    *self = (struct beside){.rows = rows, .length = length};
    self->basis = malloc(length * n * sizeof *self->basis + 1);
    self->rest = calloc(length, sizeof *self->rest);
    self->work = malloc(2 * length * sizeof *self->work);
    double *A = malloc(rows * n * sizeof *A + 1), *column = calloc(length, sizeof *column);
    bool good = self->basis && self->rest && self->work && A && column;
    if (good) {
        fit_linear(fit, data, hypothesis, A, weight, centre);
        for (size_t j = 0; j < rows; j++)
            self->rest[j] = -fit->residual[j];
        for (size_t i = 0; i < n; i++) {
            self->rest[rows + i] = weight[i] * centre[i];
            if (at_wall(hypothesis, i))
                continue;
            memcpy(column, A + i * rows, rows * sizeof *column);
            column[rows + i] = weight[i];
            add_column(self, column);
            column[rows + i] = 0.0;
        }
        take_out(self, self->rest);
        self->cost = vector_dot(length, self->rest, self->rest);
    }
    free(A);
    free(column);
    if (!good)
        beside_free(self);
    return good;
}

void beside_free(struct beside *self)
{
    free(self->basis);
    free(self->rest);
    free(self->work);
    memset(self, 0, sizeof *self);
}

/// A column with what the coordinates can explain of it taken out; returns its square, 0 if that is rounding.
static double own_part(const struct beside *self, const double *column, double *out_own)
{
    memcpy(out_own, column, self->rows * sizeof *out_own);
    memset(out_own + self->rows, 0, (self->length - self->rows) * sizeof *out_own);
    double whole = vector_dot(self->rows, column, column);
    take_out(self, out_own);
    double own = vector_dot(self->length, out_own, out_own);
    return own > own_least * whole ? own : 0.0;
}

double beside_cost(const struct beside *self, const double *columns, size_t count, double *out_sizes)
{
    double *first = self->work, *second = first + self->length;
    double aa = own_part(self, columns, first), a = vector_dot(self->length, first, self->rest);
    out_sizes[0] = aa > 0.0 ? a / aa : 0.0;
    double gain = aa > 0.0 ? a * a / aa : 0.0;
    if (count == 2) {
        out_sizes[1] = 0.0;
        double length = own_part(self, columns + self->rows, second);
        double shared = aa > 0.0 ? vector_dot(self->length, first, second) / aa : 0.0;
        for (size_t j = 0; j < self->length; j++)
            second[j] -= shared * first[j];
        double bb = vector_dot(self->length, second, second), b = vector_dot(self->length, second, self->rest);
        if (length > 0.0 && bb > own_least * length) {
            out_sizes[1] = b / bb;
            out_sizes[0] -= shared * out_sizes[1];
            gain += b * b / bb;
        }
    }
    return self->cost - gain;
}
