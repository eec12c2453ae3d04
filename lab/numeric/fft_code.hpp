/* SPDX-License-Identifier: MIT */
// The same transform compiled for several instruction sets; fft.cpp chooses once, when the first plan is made.
#ifndef SERVOSCOPE_NUMERIC_FFT_CODE_HPP
#define SERVOSCOPE_NUMERIC_FFT_CODE_HPP

#include <cstddef>

/// Prime factors up to this have butterflies of their own.
enum { fft_largest_radix = 127 };
/// Transforms of lengths that are not multiples of four are split into so many.
enum { fft_largest_split = 25 };

/// `length` is a multiple of `split`, which is 4, or odd from 3 to fft_largest_split; what remains is at least 8 and
/// has no prime factor above fft_largest_radix. create throws std::bad_alloc.
struct fft_code {
    void *(*create)(std::size_t length, std::size_t split);
    void (*destroy)(void *self);
    void (*run)(const void *self, const double *in, double *out, bool swapped);
    void (*run_pair)(const void *self, const double *a, double scale_a, const double *b, double scale_b, double *out);
};

/// For every processor.
const fft_code *fft_code_portable();
/// For processors with AVX2; NULL if this build or this processor has none.
const fft_code *fft_code_avx2();

#endif
