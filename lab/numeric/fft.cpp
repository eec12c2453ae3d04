/* SPDX-License-Identifier: MIT */
#include "lab/numeric/fft.h"

#include "lab/numeric/fft_code.hpp"

#include <complex>
#include <kissfft/kissfft.hh>
#include <memory>
#include <new>
#include <vector>

static const fft_code *best_code()
{
    static const fft_code *const code = fft_code_avx2() ? fft_code_avx2() : fft_code_portable();
    return code;
}

struct fft_plan {
    explicit fft_plan(size_t points) : length(points)
    {
        // A short transform gains nothing from lanes, and one whose length is no multiple of four has no quarters.
        const size_t shortest_with_lanes = 32;
        if (length % 4 == 0 && length >= shortest_with_lanes) {
            quarters = code->create(length);
        } else {
            forward.reset(new kissfft<double>(length, false));
            inverse.reset(new kissfft<double>(length, true));
        }
    }
    ~fft_plan()
    {
        if (quarters) {
            code->destroy(quarters);
        }
    }
    fft_plan(const fft_plan &) = delete;
    fft_plan &operator=(const fft_plan &) = delete;

    size_t length;
    const fft_code *code = best_code();
    void *quarters = nullptr; ///< NULL: forward and inverse are there instead
    std::unique_ptr<kissfft<double>> forward;
    std::unique_ptr<kissfft<double>> inverse;
    std::vector<std::complex<double>> pair; ///< of fft_forward_pair without quarters
};

// std::complex<double> is laid out as two doubles (C++11 26.4/4), so the casts below are the sanctioned ones.

static const std::complex<double> *complex_of(const double *data)
{
    return reinterpret_cast<const std::complex<double> *>(data);
}

static std::complex<double> *complex_of(double *data)
{
    return reinterpret_cast<std::complex<double> *>(data);
}

struct fft_plan *fft_plan_create(size_t length)
{
    try {
        return new fft_plan(length);
    } catch (const std::bad_alloc &) {
        return nullptr;
    }
}

void fft_plan_destroy(struct fft_plan *plan)
{
    delete plan;
}

void fft_forward(const struct fft_plan *plan, const double *in, double *out)
{
    if (plan->quarters) {
        plan->code->run(plan->quarters, in, out, false);
    } else {
        plan->forward->transform(complex_of(in), complex_of(out));
    }
}

void fft_inverse(const struct fft_plan *plan, const double *in, double *out)
{
    if (plan->quarters) {
        plan->code->run(plan->quarters, in, out, true);
    } else {
        plan->inverse->transform(complex_of(in), complex_of(out));
    }
}

bool fft_forward_pair(struct fft_plan *plan, const double *a, double scale_a, const double *b, double scale_b,
                      double *out)
{
    if (plan->quarters) {
        plan->code->run_pair(plan->quarters, a, scale_a, b, scale_b, out);
        return true;
    }
    try {
        plan->pair.resize(plan->length);
    } catch (const std::bad_alloc &) {
        return false;
    }
    for (size_t n = 0; n < plan->length; n++) {
        plan->pair[n] = std::complex<double>(scale_a * a[n], scale_b * b[n]);
    }
    plan->forward->transform(plan->pair.data(), complex_of(out));
    return true;
}
