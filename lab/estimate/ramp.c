/* SPDX-License-Identifier: MIT */
#include "lab/estimate/ramp.h"

#include "lab/numeric/cmplx.h"

#include <math.h>

static const double pi = 3.141592653589793238463;

double complex ramp_transform(size_t bin, size_t period_samples)
{
    /* 1 / (exp(-jw) - 1) = -1/2 + j/2 cot(w/2) */
    const double length = (double)period_samples;
    return CMPLX(-0.5 * length, 0.5 * length / tan(pi * (double)bin / length));
}

double ramp_slope(const double complex *spectra, size_t stride, const size_t *numbers, size_t periods,
                  size_t period_samples)
{
    double middle = 0.0;
    double product = 0.0;
    double square = 0.0;
    for (size_t p = 0; p < periods; p++) {
        middle += (double)(numbers ? numbers[p] : p) / (double)periods;
    }
    for (size_t p = 0; p < periods; p++) {
        const double distance = (double)(numbers ? numbers[p] : p) - middle;
        product += distance * creal(spectra[p * stride]) / (double)period_samples;
        square += distance * distance;
    }
    return product / square / (double)period_samples;
}
