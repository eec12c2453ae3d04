/* SPDX-License-Identifier: MIT */
/// A second copy of a function for processors with AVX2, chosen by the loader; its results are the same to the last
/// bit.
#ifndef SERVOSCOPE_NUMERIC_CLONES_H
#define SERVOSCOPE_NUMERIC_CLONES_H

/* For __GLIBC__: other C libraries cannot choose while loading, and sanitizers are not ready by then. */
#include <stddef.h>
#include <stdlib.h>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && defined(__GLIBC__) &&                           \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
/// In front of a function of long loops over arrays.
#define CLONED_FOR_AVX2 __attribute__((target_clones("avx2", "default")))
#else
#define CLONED_FOR_AVX2
#endif

#endif
