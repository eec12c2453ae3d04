/* SPDX-License-Identifier: MIT */
#include "lab/numeric/vector.h"

#include "lab/numeric/clones.h"

#include <math.h>

enum { sums = 8 };

static double sum_of_sums(const double partial[sums])
{
    double sum = 0.0;
    for (size_t i = 0; i < sums; i++) {
        sum += partial[i];
    }
    return sum;
}

CLONED_FOR_AVX2 double vector_dot(size_t count, const double *a, const double *b)
{
    double partial[sums] = {0.0};
    size_t n = 0;
    for (; n + sums <= count; n += sums) {
        for (size_t i = 0; i < sums; i++) {
            partial[i] += a[n + i] * b[n + i];
        }
    }
    for (; n < count; n++) {
        partial[0] += a[n] * b[n];
    }
    return sum_of_sums(partial);
}

CLONED_FOR_AVX2 double vector_sum(size_t count, const double *a)
{
    double partial[sums] = {0.0};
    size_t n = 0;
    for (; n + sums <= count; n += sums) {
        for (size_t i = 0; i < sums; i++) {
            partial[i] += a[n + i];
        }
    }
    for (; n < count; n++) {
        partial[0] += a[n];
    }
    return sum_of_sums(partial);
}

CLONED_FOR_AVX2 double vector_power(size_t count, const double *a)
{
    double partial[sums] = {0.0};
    size_t n = 0;
    for (; n + sums <= count; n += sums) {
        for (size_t i = 0; i < sums; i++) {
            partial[i] += a[n + i] * a[n + i];
        }
    }
    for (; n < count; n++) {
        partial[0] += a[n] * a[n];
    }
    return sum_of_sums(partial);
}

double vector_length(size_t count, const double *x)
{
    return sqrt(vector_dot(count, x, x));
}
