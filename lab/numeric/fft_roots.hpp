/* SPDX-License-Identifier: MIT */
// Roots of unity in the time of one multiplication: a coarse one times a fine one, each exact to the last digit, so
// that the product is to about two.
// Included by files that are compiled for several instruction sets, hence with internal linkage.
#ifndef SERVOSCOPE_NUMERIC_FFT_ROOTS_HPP
#define SERVOSCOPE_NUMERIC_FFT_ROOTS_HPP

#include <cmath>
#include <cstddef>
#include <vector>

namespace
{

/// One complex number.
struct factor {
    double re;
    double im;
};

class roots
{
  public:
    /// For w^k = exp(-2 pi i k / turn), k below turn.
    explicit roots(std::size_t turn)
    {
        const double step = 2.0 * std::acos(-1.0) / static_cast<double>(turn);
        while ((std::size_t(1) << 2 * bits_) < turn) {
            bits_++;
        }
        for (std::size_t k = 0; k < std::size_t(1) << bits_; k++) {
            fine_.push_back(at_angle(step * static_cast<double>(k)));
        }
        for (std::size_t k = 0; k < turn; k += std::size_t(1) << bits_) {
            coarse_.push_back(at_angle(step * static_cast<double>(k)));
        }
    }

    factor operator[](std::size_t k) const
    {
        const factor a = coarse_[k >> bits_];
        const factor b = fine_[k & ((std::size_t(1) << bits_) - 1)];
        return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
    }

  private:
    static factor at_angle(double angle)
    {
        return {std::cos(angle), -std::sin(angle)};
    }

    unsigned bits_ = 0;
    std::vector<factor> fine_;
    std::vector<factor> coarse_;
};

} // namespace

#endif
