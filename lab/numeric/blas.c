/* SPDX-License-Identifier: MIT */
#include "lab/numeric/blas.h"

#include <stddef.h>

/// Present if the BLAS in use is OpenBLAS.
extern void openblas_set_num_threads(int threads) __attribute__((weak));

void blas_use_one_thread(void)
{
    if (openblas_set_num_threads != NULL) {
        openblas_set_num_threads(1);
    }
}
