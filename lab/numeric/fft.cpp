/* SPDX-License-Identifier: MIT */
#include "lab/numeric/fft.h"

#include <complex>
#include <kissfft/kissfft.hh>
#include <new>

struct fft_plan {
    explicit fft_plan(size_t length) : forward(length, false), inverse(length, true) {}
    kissfft<double> forward;
    kissfft<double> inverse;
};

// std::complex<double> is laid out as two doubles (C++11 26.4/4), so the casts below are the sanctioned ones.

struct fft_plan *fft_plan_create(size_t length)
{
    return new (std::nothrow) fft_plan(length);
}

void fft_plan_destroy(struct fft_plan *plan)
{
    delete plan;
}

void fft_forward(const struct fft_plan *plan, const double *in, double *out)
{
    plan->forward.transform(reinterpret_cast<const std::complex<double> *>(in),
                            reinterpret_cast<std::complex<double> *>(out));
}

void fft_inverse(const struct fft_plan *plan, const double *in, double *out)
{
    plan->inverse.transform(reinterpret_cast<const std::complex<double> *>(in),
                            reinterpret_cast<std::complex<double> *>(out));
}
