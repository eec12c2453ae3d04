/* SPDX-License-Identifier: MIT */
#include "lab/numeric/vector.h"

#include <math.h>

double vector_dot(size_t count, const double *a, const double *b)
{
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

double vector_length(size_t count, const double *x)
{
    return sqrt(vector_dot(count, x, x));
}
