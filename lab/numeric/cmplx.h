/* SPDX-License-Identifier: MIT */
/// What complex.h leaves to be wished for.
#ifndef SERVOSCOPE_NUMERIC_CMPLX_H
#define SERVOSCOPE_NUMERIC_CMPLX_H

#include <complex.h>

/* The C library may have it for another compiler only: glibc with clang. */
#ifndef CMPLX
#define CMPLX(re, im) __builtin_complex((double)(re), (double)(im))
#endif

/// |z|^2.
static inline double cmplx_power(double complex z)
{
    return creal(z) * creal(z) + cimag(z) * cimag(z);
}

#endif
