/* SPDX-License-Identifier: MIT */
/// The floating-point type of everything in lib/ outside the integer sample path; SERVOSCOPE_REAL_BITS says which.
#ifndef SERVOSCOPE_CORE_REAL_H
#define SERVOSCOPE_CORE_REAL_H

#include "core/config.h"

#include <float.h>

#if SERVOSCOPE_REAL_BITS == 64
typedef double core_real;
#define CORE_REAL_MAX DBL_MAX
#else
typedef float core_real;
#define CORE_REAL_MAX FLT_MAX
#endif

#endif
