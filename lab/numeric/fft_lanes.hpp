/* SPDX-License-Identifier: MIT */
// Transforms with a vector's four lanes.
// Included by one source file per instruction set. Everything here has internal linkage, so that the linker cannot mix
// them, and no template of the standard library is used on a type that others use; the operations and their order are
// the same, and so is every bit of the result.
#include "lab/numeric/fft_code.hpp"
#include "lab/numeric/fft_passes.hpp"

#include <cmath>
#include <cstddef>
#include <new>
#include <vector>

namespace
{

struct part {
    double value;
};

struct transform {
    transform() = default;
    transform(const transform &) = delete;
    transform &operator=(const transform &) = delete;
    virtual ~transform() = default;
    virtual void run(const complex_source &source, double *out) const = 0;
    virtual void run(const pair_source &source, double *out) const = 0;
};

/// Multiples of four: four interleaved transforms of a quarter of the length at once, x[4m + l] in lane l; a last
/// butterfly puts the four together.
class quarters_transform final : public transform
{
  public:
    explicit quarters_transform(std::size_t length) : quarters_transform(length, roots(length)) {}

    void run(const complex_source &source, double *out) const override
    {
        passes_.run(source, work_.data());
        finish(out, source.swapped);
    }

    void run(const pair_source &source, double *out) const override
    {
        passes_.run(source, work_.data());
        finish(out, false);
    }

  private:
    quarters_transform(std::size_t length, const roots &turns)
        : quarter_(length / lane_count), passes_(quarter_, turns, lane_count), turns_(2 * quarter_), work_(quarter_)
    {
        for (std::size_t k = 0; k < quarter_; k++) {
            const factor root = turns[k];
            turns_[k].value = root.re;
            turns_[quarter_ + k].value = root.im;
        }
    }

    /// X[k + jN/4] = sum_l (-i)^(lj) w_N^(lk) Y_l[k], four lines k at a time; the last four may overlap those before.
    void finish(double *out, bool swapped) const
    {
        for (std::size_t k = 0; k < quarter_; k += lane_count) {
            finish_four(k + lane_count <= quarter_ ? k : quarter_ - lane_count, out, swapped);
        }
    }

    void finish_four(std::size_t k, double *out, bool swapped) const
    {
        const number &row0 = work_[passes_.order(k)];
        const number &row1 = work_[passes_.order(k + 1)];
        const number &row2 = work_[passes_.order(k + 2)];
        const number &row3 = work_[passes_.order(k + 3)];
        number x[lane_count];
        number once, twice, thrice;
        once.re = *reinterpret_cast<const anywhere *>(&turns_[k]);
        once.im = *reinterpret_cast<const anywhere *>(&turns_[quarter_ + k]);
        multiply(once, once, twice);
        multiply(twice, once, thrice);
        vector re[lane_count];
        vector im[lane_count];
        transpose(row0.re, row1.re, row2.re, row3.re, re);
        transpose(row0.im, row1.im, row2.im, row3.im, im);
        for (std::size_t l = 0; l < lane_count; l++) {
            x[l].re = re[l];
            x[l].im = im[l];
        }
        multiply(x[1], once, x[1]);
        multiply(x[2], twice, x[2]);
        multiply(x[3], thrice, x[3]);
        butterfly4()(x);
        for (std::size_t j = 0; j < lane_count; j++) {
            store(x[j], swapped, out + 2 * (k + j * quarter_));
        }
    }

    std::size_t quarter_;
    lane_passes passes_;
    std::vector<part> turns_; ///< real parts of w_N^k, then imaginary ones
    mutable std::vector<number> work_;
};

/// Multiples m p of an odd p: a first pass of radix p makes p transforms of m points, of which four at a time have a
/// lane each. A few lanes stay without one.
class split_transform final : public transform
{
  public:
    split_transform(std::size_t length, std::size_t radix) : split_transform(length, radix, roots(length)) {}

    void run(const complex_source &source, double *out) const override
    {
        run_any_source(source, out, source.swapped);
    }

    void run(const pair_source &source, double *out) const override
    {
        run_any_source(source, out, false);
    }

  private:
    split_transform(std::size_t length, std::size_t radix, const roots &turns)
        : radix_(radix), groups_((radix + lane_count - 1) / lane_count), m_(length / radix), passes_(m_, turns, radix),
          turns_(2 * length), work_(groups_ * m_)
    {
        first_.radix = radix;
        first_.length = radix;
        for (std::size_t r = 0; r < radix_; r++) {
            first_.roots.push_back(turns[r * m_]);
            for (std::size_t j = 0; j < m_; j++) {
                const factor root = turns[r * j];
                turns_[2 * r * m_ + j].value = root.re;
                turns_[(2 * r + 1) * m_ + j].value = root.im;
            }
        }
    }

    template <class Source>
    void run_any_source(const Source &source, double *out, bool swapped) const
    {
        for (std::size_t j = 0; j < m_; j += lane_count) {
            split_four(source, j + lane_count <= m_ ? j : m_ - lane_count);
        }
        for (std::size_t g = 0; g < groups_; g++) {
            passes_.run(&work_[g * m_]);
        }
        finish(out, swapped);
    }

    /// y_r[j] = w_N^(r j) sum_q x[j + q m] w_p^(q r), four j at a time; the last four may overlap those before.
    template <class Source>
    void split_four(const Source &source, std::size_t j) const
    {
        number x[fft_largest_split / lane_count * lane_count + lane_count];
        for (std::size_t q = 0; q < radix_; q++) {
            source.load_from(j + q * m_, x[q]);
        }
        for (std::size_t q = radix_; q < lane_count * groups_; q++) {
            x[q].re = x[q].im = vector{0.0, 0.0, 0.0, 0.0};
        }
        run_pass(first_, work_source{x}, 1, x);
        for (std::size_t r = 1; r < radix_; r++) {
            number root;
            root.re = *reinterpret_cast<const anywhere *>(&turns_[2 * r * m_ + j]);
            root.im = *reinterpret_cast<const anywhere *>(&turns_[(2 * r + 1) * m_ + j]);
            multiply(x[r], root, x[r]);
        }
        for (std::size_t g = 0; g < groups_; g++) {
            const number *rows = x + lane_count * g;
            vector re[lane_count];
            vector im[lane_count];
            transpose(rows[0].re, rows[1].re, rows[2].re, rows[3].re, re);
            transpose(rows[0].im, rows[1].im, rows[2].im, rows[3].im, im);
            for (std::size_t l = 0; l < lane_count; l++) {
                work_[g * m_ + j + l].re = re[l];
                work_[g * m_ + j + l].im = im[l];
            }
        }
    }

    /// X[r + p k] from lane r. What lanes without a transform write is overwritten by the next k; the last has none.
    void finish(double *out, bool swapped) const
    {
        const std::size_t length = m_ * radix_;
        for (std::size_t k = 0; k < m_; k++) {
            for (std::size_t g = 0; g < groups_; g++) {
                const std::size_t line = radix_ * k + lane_count * g;
                const number &x = work_[g * m_ + passes_.order(k)];
                if (line + lane_count <= length) {
                    store(x, swapped, out + 2 * line);
                    continue;
                }
                for (std::size_t r = 0; line + r < length; r++) {
                    out[2 * (line + r)] = swapped ? x.im[r] : x.re[r];
                    out[2 * (line + r) + 1] = swapped ? x.re[r] : x.im[r];
                }
            }
        }
    }

    std::size_t radix_;
    std::size_t groups_; ///< of four lanes
    std::size_t m_;
    lane_passes passes_;
    pass first_;
    std::vector<part> turns_; ///< w_N^(r j): real parts for all j, then imaginary ones, for one r after the other
    mutable std::vector<number> work_;
};

void *create_lanes(std::size_t length, std::size_t split)
{
    if (split == lane_count) {
        return static_cast<transform *>(new quarters_transform(length));
    }
    return static_cast<transform *>(new split_transform(length, split));
}

void destroy_lanes(void *self)
{
    delete static_cast<transform *>(self);
}

void run_lanes(const void *self, const double *in, double *out, bool swapped)
{
    static_cast<const transform *>(self)->run(complex_source{in, swapped}, out);
}

void run_lanes_pair(const void *self, const double *a, double scale_a, const double *b, double scale_b, double *out)
{
    static_cast<const transform *>(self)->run(pair_source{a, scale_a, b, scale_b}, out);
}

const fft_code lanes_code = {create_lanes, destroy_lanes, run_lanes, run_lanes_pair};

} // namespace
