/* SPDX-License-Identifier: MIT */
#include "lab/numeric/cholesky.h"

#include <lapacke.h>
#include <math.h>

bool cholesky_solve(size_t n, double *inout_A, double *inout_x)
{
    const lapack_int order = (lapack_int)n;
    if (LAPACKE_dposv_work(LAPACK_COL_MAJOR, 'L', order, 1, inout_A, order, inout_x, order) != 0)
        return false;
    // A NaN is not above 0 nor below; not every LAPACK stops at one.
    double sum = 0.0;
    for (size_t i = 0; i < n; i++)
        sum += inout_x[i];
    return isfinite(sum);
}
