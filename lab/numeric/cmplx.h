/* SPDX-License-Identifier: MIT */
/// CMPLX of C11 where the C library's complex.h has it for another compiler only (glibc before 2.37 with clang).
#ifndef SERVOSCOPE_NUMERIC_CMPLX_H
#define SERVOSCOPE_NUMERIC_CMPLX_H

#include <complex.h>

#ifndef CMPLX
#define CMPLX(re, im) __builtin_complex((double)(re), (double)(im))
#endif

#endif
