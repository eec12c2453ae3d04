/* SPDX-License-Identifier: MIT */
// Transforms of any length through one of a smooth length (Bluestein, IEEE Trans. Audio Electroacoust. 18 (1970)
// 451): 2 n k = n^2 + k^2 - (k - n)^2 makes the defining sum a convolution with a chirp,
//     X_k = c_k sum_n (x_n c_n) conj(c_(k-n)),   c_n = exp(-i pi n^2 / N)
// which is a product of transforms of at least 2 N - 1 points.
#ifndef SERVOSCOPE_NUMERIC_FFT_CHIRP_HPP
#define SERVOSCOPE_NUMERIC_FFT_CHIRP_HPP

#include "lab/numeric/fft_code.hpp"
#include "lab/numeric/fft_roots.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <vector>

class chirp_transform
{
  public:
    /// `inner` >= 2 length - 1 points, a multiple of four for `code`
    chirp_transform(std::size_t length, std::size_t inner, const fft_code *code)
        : length_(length), inner_(inner), code_(code), chirp_(length), kernel_(inner), in_(inner), out_(inner)
    {
        make_chirp();
        plan_ = code_->create(inner_, 4);
        for (std::size_t n = 0; n < length_; n++) {
            in_[n] = std::conj(chirp_[n]) / static_cast<double>(inner_);
            in_[(inner_ - n) % inner_] = in_[n];
        }
        code_->run(plan_, doubles(in_), doubles(kernel_), false);
        std::fill(in_.begin(), in_.end(), 0.0);
    }
    ~chirp_transform()
    {
        code_->destroy(plan_);
    }
    chirp_transform(const chirp_transform &) = delete;
    chirp_transform &operator=(const chirp_transform &) = delete;

    /// in[n]: any function that returns the n-th number. `swapped`: real and imaginary parts change places on the way
    /// out.
    template <class Source>
    void run(const Source &in, std::complex<double> *out, bool swapped)
    {
        for (std::size_t n = 0; n < length_; n++) {
            in_[n] = product(in(n), chirp_[n]);
        }
        code_->run(plan_, doubles(in_), doubles(out_), false);
        for (std::size_t k = 0; k < inner_; k++) {
            out_[k] = product(out_[k], kernel_[k]);
        }
        code_->run(plan_, doubles(out_), doubles(in_), true);
        for (std::size_t k = 0; k < length_; k++) {
            const std::complex<double> line = product(in_[k], chirp_[k]);
            out[k] = swapped ? std::complex<double>(line.imag(), line.real()) : line;
        }
        std::fill(in_.begin() + static_cast<std::ptrdiff_t>(length_), in_.end(), 0.0);
    }

  private:
    /// The operator would look for infinities each time.
    static std::complex<double> product(const std::complex<double> &a, const std::complex<double> &b)
    {
        return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
    }

    static double *doubles(std::vector<std::complex<double>> &numbers)
    {
        return reinterpret_cast<double *>(numbers.data());
    }

    /// n^2 modulo 2 N, because large angles would lose digits.
    void make_chirp()
    {
        const roots all(2 * length_);
        std::size_t square = 0;
        for (std::size_t n = 0; n < length_; n++) {
            const factor root = all[square];
            chirp_[n] = std::complex<double>(root.re, root.im);
            square += 2 * n + 1;
            square -= square >= 2 * length_ ? 2 * length_ : 0;
        }
    }

    std::size_t length_;
    std::size_t inner_;
    const fft_code *code_;
    void *plan_ = nullptr;
    std::vector<std::complex<double>> chirp_;
    std::vector<std::complex<double>> kernel_;
    std::vector<std::complex<double>> in_; ///< zeros from length_ on
    std::vector<std::complex<double>> out_;
};

#endif
