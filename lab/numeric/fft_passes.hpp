/* SPDX-License-Identifier: MIT */
// Passes of a decimation in frequency, in place, on four transforms at once, one in each lane of a vector.
// A pass of radix p turns a block of n = p m numbers into p blocks of m, of which the r-th still has to be transformed
// to become the lines k = r modulo p:
//     y_r[j] = w_n^(r j) sum_q x[j + q m] w_p^(q r),   w_n = exp(-2 pi i / n)
// Included by fft_lanes.hpp. Everything here has internal linkage: see there.
#ifndef SERVOSCOPE_NUMERIC_FFT_PASSES_HPP
#define SERVOSCOPE_NUMERIC_FFT_PASSES_HPP

#include "lab/numeric/fft_code.hpp"
#include "lab/numeric/fft_roots.hpp"

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace
{

enum { lane_count = 4 };

// Alignment is said, because without AVX the compiler would settle for less, and both must agree.
typedef double vector __attribute__((vector_size(lane_count * sizeof(double)), aligned(lane_count * sizeof(double))));
typedef double anywhere __attribute__((vector_size(lane_count * sizeof(double)), aligned(sizeof(double)), may_alias));

// Clang has only the one, GCC before 12 only the other.
#ifdef __clang__
#define FFT_SHUFFLE(a, b, i0, i1, i2, i3) __builtin_shufflevector(a, b, i0, i1, i2, i3)
#else
typedef long long shuffle __attribute__((vector_size(lane_count * sizeof(double))));
#define FFT_SHUFFLE(a, b, i0, i1, i2, i3) __builtin_shuffle(a, b, shuffle{i0, i1, i2, i3})
#endif

/// a0 b0 a2 b2 and a1 b1 a3 b3
inline void interleave(const vector &a, const vector &b, vector &out_even, vector &out_odd)
{
    const vector x = a;
    const vector y = b;
    out_even = FFT_SHUFFLE(x, y, 0, 4, 2, 6);
    out_odd = FFT_SHUFFLE(x, y, 1, 5, 3, 7);
}

/// a0 a1 b0 b1 and a2 a3 b2 b3
inline void exchange_halves(const vector &a, const vector &b, vector &out_first, vector &out_second)
{
    const vector x = a;
    const vector y = b;
    out_first = FFT_SHUFFLE(x, y, 0, 1, 4, 5);
    out_second = FFT_SHUFFLE(x, y, 2, 3, 6, 7);
}

/// Rows of a square become its columns.
inline void transpose(const vector &row0, const vector &row1, const vector &row2, const vector &row3, vector *out)
{
    vector even01, odd01, even23, odd23;
    interleave(row0, row1, even01, odd01);
    interleave(row2, row3, even23, odd23);
    exchange_halves(even01, even23, out[0], out[2]);
    exchange_halves(odd01, odd23, out[1], out[3]);
}

/// Four complex numbers. Copied as vectors: left to the compiler, the copy moves in smaller pieces, and reading a
/// vector back from those stalls.
struct number {
    vector re;
    vector im;

    number() = default;
    number(const number &other) : re(other.re), im(other.im) {}
    number &operator=(const number &other)
    {
        re = other.re;
        im = other.im;
        return *this;
    }
};

/// One pass over all blocks of one length.
struct pass {
    std::size_t radix;
    std::size_t length;          ///< n, of the blocks it takes
    std::vector<factor> factors; ///< w_n^(r j) at (p - 1) j + r - 1; empty if m = 1, where all are 1
    std::vector<factor> roots;   ///< w_p^r; empty for 2 and 4
};

/// Where the first pass reads: two real signals beside each other.
struct pair_source {
    const double *a;
    double scale_a;
    const double *b;
    double scale_b;

    /// x[n] and the three after it
    void load_from(std::size_t n, number &out) const
    {
        out.re = scale_a * *reinterpret_cast<const anywhere *>(a + n);
        out.im = scale_b * *reinterpret_cast<const anywhere *>(b + n);
    }
    void load(std::size_t m, number &out) const
    {
        load_from(lane_count * m, out);
    }
};

/// Where the first pass reads: interleaved complex numbers. `swapped`: real and imaginary parts have changed places.
struct complex_source {
    const double *in;
    bool swapped;

    void load_from(std::size_t n, number &out) const
    {
        const anywhere *x = reinterpret_cast<const anywhere *>(in + 2 * n);
        // Copied first: a reference to a vector would promise more alignment than there is.
        const vector x0 = x[0];
        const vector x1 = x[1];
        vector first, second;
        exchange_halves(x0, x1, first, second);
        interleave(first, second, swapped ? out.im : out.re, swapped ? out.re : out.im);
    }
    void load(std::size_t m, number &out) const
    {
        load_from(lane_count * m, out);
    }
};

/// Where the other passes read.
struct work_source {
    const number *in;

    void load(std::size_t m, number &out) const
    {
        out = in[m];
    }
};

inline void multiply(const number &a, const number &b, number &out)
{
    const number x = a;
    const number y = b;
    out.re = x.re * y.re - x.im * y.im;
    out.im = x.re * y.im + x.im * y.re;
}

/// Four lines beside each other; `swapped` as in the source.
inline void store(const number &x, bool swapped, double *out)
{
    vector even, odd, first, second;
    interleave(swapped ? x.im : x.re, swapped ? x.re : x.im, even, odd);
    exchange_halves(even, odd, first, second);
    *reinterpret_cast<anywhere *>(out) = first;
    *reinterpret_cast<anywhere *>(out + lane_count) = second;
}

inline void turn(number &io_x, const factor &by)
{
    const vector re = io_x.re * by.re - io_x.im * by.im;
    io_x.im = io_x.re * by.im + io_x.im * by.re;
    io_x.re = re;
}

/// a + b and a - b
inline void sum_difference(const number &a, const number &b, number &out_sum, number &out_difference)
{
    const number x = a;
    const number y = b;
    out_sum.re = x.re + y.re;
    out_sum.im = x.im + y.im;
    out_difference.re = x.re - y.re;
    out_difference.im = x.im - y.im;
}

/// a - i b and a + i b
inline void turned_sum_difference(const number &a, const number &b, number &out_minus, number &out_plus)
{
    const number x = a;
    const number y = b;
    out_minus.re = x.re + y.im;
    out_minus.im = x.im - y.re;
    out_plus.re = x.re - y.im;
    out_plus.im = x.im + y.re;
}

struct butterfly2 {
    enum { radix = 2 };
    explicit butterfly2(const pass &) {}
    void operator()(number *io_x) const
    {
        sum_difference(io_x[0], io_x[1], io_x[0], io_x[1]);
    }
};

struct butterfly3 {
    enum { radix = 3 };
    explicit butterfly3(const pass &step) : sine(-step.roots[1].im) {}
    void operator()(number *io_x) const
    {
        number sum, difference, middle;
        sum_difference(io_x[1], io_x[2], sum, difference);
        middle.re = io_x[0].re - 0.5 * sum.re;
        middle.im = io_x[0].im - 0.5 * sum.im;
        difference.re *= sine;
        difference.im *= sine;
        io_x[0].re += sum.re;
        io_x[0].im += sum.im;
        turned_sum_difference(middle, difference, io_x[1], io_x[2]);
    }
    double sine;
};

struct butterfly4 {
    enum { radix = 4 };
    butterfly4() = default;
    explicit butterfly4(const pass &) {}
    void operator()(number *io_x) const
    {
        number even, odd, even_difference, odd_difference;
        sum_difference(io_x[0], io_x[2], even, even_difference);
        sum_difference(io_x[1], io_x[3], odd, odd_difference);
        sum_difference(even, odd, io_x[0], io_x[2]);
        turned_sum_difference(even_difference, odd_difference, io_x[1], io_x[3]);
    }
};

struct butterfly5 {
    enum { radix = 5 };
    explicit butterfly5(const pass &step)
        : cosine1(step.roots[1].re), sine1(-step.roots[1].im), cosine2(step.roots[2].re), sine2(-step.roots[2].im)
    {
    }
    void operator()(number *io_x) const
    {
        number sum1, sum2, difference1, difference2, even, odd;
        sum_difference(io_x[1], io_x[4], sum1, difference1);
        sum_difference(io_x[2], io_x[3], sum2, difference2);
        even.re = io_x[0].re + cosine1 * sum1.re + cosine2 * sum2.re;
        even.im = io_x[0].im + cosine1 * sum1.im + cosine2 * sum2.im;
        odd.re = sine1 * difference1.re + sine2 * difference2.re;
        odd.im = sine1 * difference1.im + sine2 * difference2.im;
        turned_sum_difference(even, odd, io_x[1], io_x[4]);
        even.re = io_x[0].re + cosine2 * sum1.re + cosine1 * sum2.re;
        even.im = io_x[0].im + cosine2 * sum1.im + cosine1 * sum2.im;
        odd.re = sine2 * difference1.re - sine1 * difference2.re;
        odd.im = sine2 * difference1.im - sine1 * difference2.im;
        turned_sum_difference(even, odd, io_x[2], io_x[3]);
        io_x[0].re += sum1.re + sum2.re;
        io_x[0].im += sum1.im + sum2.im;
    }
    double cosine1, sine1, cosine2, sine2;
};

/// One pass of a known radix over `count` blocks, one after the other.
template <class Butterfly, class Source>
inline void run_known(const pass &step, const Source &source, std::size_t count, number *out)
{
    enum { radix = Butterfly::radix };
    const Butterfly butterfly(step);
    const std::size_t m = step.length / radix;
    number x[radix];
    for (std::size_t block = 0; block < count * step.length; block += step.length) {
        const factor *factors = step.factors.data();
        for (std::size_t j = block; j < block + m; j++) {
            for (std::size_t q = 0; q < radix; q++) {
                source.load(j + q * m, x[q]);
            }
            butterfly(x);
            out[j] = x[0];
            for (std::size_t r = 1; r < radix; r++) {
                if (m > 1) {
                    turn(x[r], *factors++);
                }
                out[j + r * m] = x[r];
            }
        }
    }
}

/// Any odd radix: half the multiplications of the defining sum, because w^(q r) and w^((p - q) r) are conjugate.

template <class Source>
inline void run_any(const pass &step, const Source &source, std::size_t count, number *out)
{
    const std::size_t radix = step.radix;
    const std::size_t m = step.length / radix;
    number sums[fft_largest_radix / 2 + 1];
    number differences[fft_largest_radix / 2 + 1];
    for (std::size_t block = 0; block < count * step.length; block += step.length) {
        const factor *factors = step.factors.data();
        for (std::size_t j = block; j<block + m; j++, factors += m> 1 ? radix - 1 : 0) {
            number x0;
            source.load(j, x0);
            number total = x0;
            for (std::size_t q = 1; q <= radix / 2; q++) {
                number a, b;
                source.load(j + q * m, a);
                source.load(j + (radix - q) * m, b);
                sum_difference(a, b, sums[q], differences[q]);
                total.re += sums[q].re;
                total.im += sums[q].im;
            }
            out[j] = total;
            for (std::size_t r = 1; r <= radix / 2; r++) {
                number even = x0;
                number odd;
                odd.re = odd.im = vector{0.0, 0.0, 0.0, 0.0};
                std::size_t turns = 0;
                for (std::size_t q = 1; q <= radix / 2; q++) {
                    turns += r;
                    turns -= turns >= radix ? radix : 0;
                    const factor root = step.roots[turns];
                    even.re += root.re * sums[q].re;
                    even.im += root.re * sums[q].im;
                    odd.re -= root.im * differences[q].re;
                    odd.im -= root.im * differences[q].im;
                }
                turned_sum_difference(even, odd, even, odd);
                if (m > 1) {
                    turn(even, factors[r - 1]);
                    turn(odd, factors[radix - r - 1]);
                }
                out[j + r * m] = even;
                out[j + (radix - r) * m] = odd;
            }
        }
    }
}

template <class Source>
inline void run_pass(const pass &step, const Source &source, std::size_t count, number *out)
{
    switch (step.radix) {
    case 2:
        run_known<butterfly2>(step, source, count, out);
        break;
    case 3:
        run_known<butterfly3>(step, source, count, out);
        break;
    case 4:
        run_known<butterfly4>(step, source, count, out);
        break;
    case 5:
        run_known<butterfly5>(step, source, count, out);
        break;
    default:
        run_any(step, source, count, out);
        break;
    }
}

/// Transforms of one length in all lanes.
class lane_passes
{
  public:
    /// `turns` are the roots of a multiple of the length.
    lane_passes(std::size_t length, const roots &turns, std::size_t multiple) : length_(length), order_(length)
    {
        static const std::size_t preferred[] = {4, 2, 5, 3};
        std::size_t rest = length_;
        for (std::size_t radix : preferred) {
            for (; rest % radix == 0; rest /= radix) {
                add_pass(radix, rest, turns, multiple);
            }
        }
        for (std::size_t radix = 7; rest > 1; radix += 2) {
            for (; rest % radix == 0; rest /= radix) {
                add_pass(radix, rest, turns, multiple);
            }
        }
        make_order();
    }

    /// From a source to `out`, where line k comes to lie at order(k).
    template <class Source>
    void run(const Source &source, number *out) const
    {
        const pass &first = passes_[0];
        const std::size_t m = first.length / first.radix;
        run_pass(first, source, 1, out);
        for (std::size_t start = 0; start < first.length; start += m) {
            descend(1, out + start);
        }
    }

    /// The same in place.
    void run(number *io_numbers) const
    {
        descend(0, io_numbers);
    }

    std::size_t order(std::size_t k) const
    {
        return order_[k].index;
    }

  private:
    /// Blocks up to this many numbers are finished before the next is begun: half of a first cache of 32 KiB.
    enum { cached_numbers = 256 };

    struct position {
        std::uint32_t index;
    };

    void add_pass(std::size_t radix, std::size_t length, const roots &turns, std::size_t multiple)
    {
        const std::size_t m = length / radix;
        const std::size_t stride = multiple * (length_ / length);
        pass step = {radix, length, {}, {}};
        if (m > 1) {
            step.factors.reserve((radix - 1) * m);
            for (std::size_t turn = 0; turn < stride * m; turn += stride) {
                for (std::size_t r = 1; r < radix; r++) {
                    step.factors.push_back(turns[turn * r]);
                }
            }
        }
        for (std::size_t r = 0; r < radix && radix != 2 && radix != 4; r++) {
            step.roots.push_back(turns[stride * m * r]);
        }
        passes_.push_back(std::move(step));
    }

    /// A block of n has its line k = r + p k' where its r-th block of m has its line k'.
    void make_order()
    {
        for (std::size_t s = passes_.size(); s-- > 0;) {
            const std::size_t radix = passes_[s].radix;
            const std::size_t m = passes_[s].length / radix;
            for (std::size_t k = m; k-- > 0;) {
                const std::uint32_t inner = order_[k].index;
                for (std::size_t r = 0; r < radix; r++) {
                    order_[radix * k + r].index = static_cast<std::uint32_t>(r * m) + inner;
                }
            }
        }
    }

    /// The passes from `first` on over one block.
    void descend(std::size_t first, number *block) const
    {
        if (first == passes_.size()) {
            return;
        }
        const std::size_t length = passes_[first].length;
        if (length <= cached_numbers) {
            for (std::size_t s = first; s < passes_.size(); s++) {
                run_pass(passes_[s], work_source{block}, length / passes_[s].length, block);
            }
            return;
        }
        const std::size_t m = length / passes_[first].radix;
        run_pass(passes_[first], work_source{block}, 1, block);
        for (std::size_t start = 0; start < length; start += m) {
            descend(first + 1, block + start);
        }
    }

    std::size_t length_;
    std::vector<pass> passes_;
    std::vector<position> order_;
};

} // namespace

#endif
