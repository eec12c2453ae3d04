/* SPDX-License-Identifier: MIT */
// Four interleaved transforms of a quarter of the length at once, one in each lane of a vector, on KissFFT's template:
// twice as fast as one transform of the whole length with 128-bit registers, more than three times with 256-bit ones.
// Included by one source file per instruction set. Everything here has internal linkage, so that the linker cannot mix
// them; the operations and their order are the same, and so is every bit of the result.
#include "lab/numeric/fft_code.hpp"

#include <complex>
#include <cstddef>
#include <kissfft/kissfft.hh>
#include <new>
#include <vector>

namespace
{

enum { lane_count = 4 };

/// Four doubles that behave as one number, as far as KissFFT needs it.
struct lanes {
    // Said, because without AVX the compiler would settle for less, and both must agree.
    typedef double vector
        __attribute__((vector_size(lane_count * sizeof(double)), aligned(lane_count * sizeof(double))));
    vector value;

    lanes() : value{0.0, 0.0, 0.0, 0.0} {}
    lanes(double x) : value{x, x, x, x} {}
    lanes(double x0, double x1, double x2, double x3) : value{x0, x1, x2, x3} {}
    /// Not left to the compiler: so a lanes is handed over in memory, and functions compiled for other instruction sets
    /// (those of the standard headers) agree with these on how. And it is copied as one vector.
    lanes(const lanes &other) : value(other.value) {}
    lanes &operator=(const lanes &other)
    {
        value = other.value;
        return *this;
    }
    /// KissFFT asks std::acos for pi; it is the same in every lane.
    operator double() const
    {
        return value[0];
    }
    lanes operator-() const
    {
        lanes result;
        result.value = -value;
        return result;
    }
    lanes &operator+=(const lanes &other)
    {
        value += other.value;
        return *this;
    }
    lanes &operator-=(const lanes &other)
    {
        value -= other.value;
        return *this;
    }
    lanes &operator*=(const lanes &other)
    {
        value *= other.value;
        return *this;
    }
};

inline lanes operator+(const lanes &left, const lanes &right)
{
    lanes result(left);
    return result += right;
}

inline lanes operator-(const lanes &left, const lanes &right)
{
    lanes result(left);
    return result -= right;
}

inline lanes operator*(const lanes &left, const lanes &right)
{
    lanes result(left);
    return result *= right;
}

inline lanes operator*(std::size_t left, const lanes &right)
{
    return lanes(static_cast<double>(left)) *= right;
}

// Found by argument-dependent look-up when the twiddles are made; all lanes are equal there.
inline lanes exp(const lanes &x)
{
    return lanes(std::exp(static_cast<double>(x)));
}

inline lanes cos(const lanes &x)
{
    return lanes(std::cos(static_cast<double>(x)));
}

inline lanes sin(const lanes &x)
{
    return lanes(std::sin(static_cast<double>(x)));
}

/// x[4m + l] is transformed in lane l; the last butterfly puts the four together.
class lanes_transform
{
  public:
    explicit lanes_transform(std::size_t length)
        : quarter_(length / lane_count), transform_(quarter_, false), twiddles_(quarter_), in_(quarter_), out_(quarter_)
    {
        // A quarter of a turn: the cosine of one angle is the sine of another.
        const double step = 2.0 * std::acos(-1.0) / static_cast<double>(length);
        std::vector<double> sines(quarter_ + 1);
        for (std::size_t k = 0; k <= quarter_; k++) {
            sines[k] = std::sin(step * static_cast<double>(k));
        }
        for (std::size_t k = 0; k < quarter_; k++) {
            const double c1 = sines[quarter_ - k];
            const double s1 = -sines[k];
            const double c2 = c1 * c1 - s1 * s1;
            const double s2 = 2.0 * c1 * s1;
            twiddles_[k] = number(lanes(1.0, c1, c2, c2 * c1 - s2 * s1), lanes(0.0, s1, s2, c2 * s1 + s2 * c1));
        }
    }

    /// `swapped`: real and imaginary parts change places in and out, which makes the inverse transform.
    void run(const double *in, double *out, bool swapped) const
    {
        vector *filled = reinterpret_cast<vector *>(in_.data());
        for (std::size_t m = 0; m < quarter_; m++) {
            const double *x = in + 2 * lane_count * m;
            filled[2 * m + swapped] = vector{x[0], x[2], x[4], x[6]};
            filled[2 * m + !swapped] = vector{x[1], x[3], x[5], x[7]};
        }
        finish(out, swapped);
    }

    /// a scaled by `scale_a` is the real part of what is transformed, b the imaginary one.
    void run_pair(const double *a, double scale_a, const double *b, double scale_b, double *out) const
    {
        vector *filled = reinterpret_cast<vector *>(in_.data());
        for (std::size_t m = 0; m < quarter_; m++) {
            const double *x = a + lane_count * m;
            const double *y = b + lane_count * m;
            filled[2 * m] = scale_a * vector{x[0], x[1], x[2], x[3]};
            filled[2 * m + 1] = scale_b * vector{y[0], y[1], y[2], y[3]};
        }
        finish(out, false);
    }

  private:
    typedef lanes::vector vector;
    typedef std::complex<lanes> number;

    void finish(double *out, bool swapped) const
    {
        transform_.transform(in_.data(), out_.data());
        // As vectors, not as complex numbers: their copies move in smaller pieces, and reading those back stalls.
        const vector *values = reinterpret_cast<const vector *>(out_.data());
        const vector *factors = reinterpret_cast<const vector *>(twiddles_.data());
        for (std::size_t k = 0; k < quarter_; k++) {
            const vector re = values[2 * k] * factors[2 * k] - values[2 * k + 1] * factors[2 * k + 1];
            const vector im = values[2 * k] * factors[2 * k + 1] + values[2 * k + 1] * factors[2 * k];
            butterfly(re, im, out + 2 * k + swapped, out + 2 * k + !swapped);
        }
    }

    /// X[k + jN/4] = sum_l (-i)^(lj) a_l
    void butterfly(const vector &re, const vector &im, double *out_re, double *out_im) const
    {
        const std::size_t step = 2 * quarter_;
        const double even_re = re[0] + re[2];
        const double even_im = im[0] + im[2];
        const double odd_re = re[1] + re[3];
        const double odd_im = im[1] + im[3];
        const double minus_re = re[0] - re[2];
        const double minus_im = im[0] - im[2];
        const double turned_re = im[1] - im[3];
        const double turned_im = re[3] - re[1];
        out_re[0] = even_re + odd_re;
        out_im[0] = even_im + odd_im;
        out_re[step] = minus_re + turned_re;
        out_im[step] = minus_im + turned_im;
        out_re[2 * step] = even_re - odd_re;
        out_im[2 * step] = even_im - odd_im;
        out_re[3 * step] = minus_re - turned_re;
        out_im[3 * step] = minus_im - turned_im;
    }

    std::size_t quarter_;
    kissfft<lanes> transform_;
    std::vector<number> twiddles_;
    mutable std::vector<number> in_;
    mutable std::vector<number> out_;
};

void *create_lanes(std::size_t length)
{
    return new lanes_transform(length);
}

void destroy_lanes(void *self)
{
    delete static_cast<lanes_transform *>(self);
}

void run_lanes(const void *self, const double *in, double *out, bool swapped)
{
    static_cast<const lanes_transform *>(self)->run(in, out, swapped);
}

void run_lanes_pair(const void *self, const double *a, double scale_a, const double *b, double scale_b, double *out)
{
    static_cast<const lanes_transform *>(self)->run_pair(a, scale_a, b, scale_b, out);
}

const fft_code lanes_code = {create_lanes, destroy_lanes, run_lanes, run_lanes_pair};

} // namespace
