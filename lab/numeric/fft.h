/* SPDX-License-Identifier: MIT */
/// Discrete Fourier transforms of the host side, double precision.
/// Composite lengths go through four transforms at once, one in each lane of a vector, multiples of four twice as fast
/// as others; lengths with a prime factor above some hundred through a convolution with a chirp, in about seven times
/// the time of a smooth one; short ones through KissFFT's template.
#ifndef SERVOSCOPE_NUMERIC_FFT_H
#define SERVOSCOPE_NUMERIC_FFT_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/// A plan for one length; not to be shared between threads while in use.
struct fft_plan;

/// Returns a plan for complex transforms of `length` >= 1 points (up to 2^32), NULL if memory is short.
struct fft_plan *fft_plan_create(size_t length);
void fft_plan_destroy(struct fft_plan *plan);

/// Y_k = sum_n x_n exp(-j 2 pi k n / N). Data are interleaved real, imaginary pairs: 2 N doubles; in != out.
void fft_forward(const struct fft_plan *plan, const double *in, double *out);
/// Two real signals in one transform: x = scale_a a + j scale_b b, without copying them together first; out as above.
void fft_forward_pair(struct fft_plan *plan, const double *a, double scale_a, const double *b, double scale_b,
                      double *out);
/// x_n = sum_k Y_k exp(+j 2 pi k n / N), not divided by N. in != out.
void fft_inverse(const struct fft_plan *plan, const double *in, double *out);

#ifdef __cplusplus
}
#endif
#endif
