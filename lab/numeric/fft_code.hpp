/* SPDX-License-Identifier: MIT */
// The same transform compiled for several instruction sets; fft.cpp chooses once, when the first plan is made.
#ifndef SERVOSCOPE_NUMERIC_FFT_CODE_HPP
#define SERVOSCOPE_NUMERIC_FFT_CODE_HPP

#include <cstddef>

/// Transforms of lengths that are multiples of four; create throws std::bad_alloc.
struct fft_code {
    void *(*create)(std::size_t length);
    void (*destroy)(void *self);
    void (*run)(const void *self, const double *in, double *out, bool swapped);
    void (*run_pair)(const void *self, const double *a, double scale_a, const double *b, double scale_b, double *out);
};

/// For every processor.
const fft_code *fft_code_portable();
/// For processors with AVX2; NULL if this build or this processor has none.
const fft_code *fft_code_avx2();

#endif
