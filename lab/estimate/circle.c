/* SPDX-License-Identifier: MIT */
#include "lab/estimate/circle.h"

#include <math.h>

struct circle circle_of_column(const double complex *values, size_t rows, size_t columns, size_t column)
{
    struct circle self = {.count = rows};
    for (size_t m = 0; m < rows; m++) {
        self.mean += values[m * columns + column];
    }
    self.mean /= (double)rows;
    for (size_t m = 0; m < rows && rows > 1; m++) {
        double complex deviation = values[m * columns + column] - self.mean;
        self.variance += creal(deviation) * creal(deviation) + cimag(deviation) * cimag(deviation);
    }
    self.variance /= rows > 1 ? (double)(rows - 1) : 1.0;
    return self;
}

double circle_chance_of_zero(const struct circle *self)
{
    double power = creal(self->mean) * creal(self->mean) + cimag(self->mean) * cimag(self->mean);
    if (!(power > 0.0)) {
        return 1.0;
    }
    if (self->count < 2 || !(self->variance > 0.0)) {
        return 0.0;
    }
    double dof = (double)(self->count - 1);
    return exp(-dof * log1p((double)self->count * power / self->variance / dof));
}

double circle_certain_ratio(double chance, size_t count)
{
    double dof = (double)count - 1.0;
    return count > 1 ? dof * expm1(-log(chance) / dof) : 0.0;
}

double circle_confidence_factor(double probability, double dof_complex)
{
    if (!(probability > 0.0 && probability < 1.0 && dof_complex > 0.0)) {
        return NAN;
    }
    return sqrt(dof_complex * expm1(-log1p(-probability) / dof_complex));
}
