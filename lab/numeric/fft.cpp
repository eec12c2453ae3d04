/* SPDX-License-Identifier: MIT */
#include "lab/numeric/fft.h"

#include "lab/numeric/fft_chirp.hpp"
#include "lab/numeric/fft_code.hpp"

#include <complex>
#include <kissfft/kissfft.hh>
#include <limits>
#include <memory>
#include <new>
#include <vector>

static const fft_code *best_code()
{
    static const fft_code *const code = fft_code_avx2() ? fft_code_avx2() : fft_code_portable();
    return code;
}

// Longer ones have no place in any memory, and their indices none in the tables.
static const size_t longest_length = size_t(1) << (sizeof(size_t) > 4 ? 32 : 26);

// Time per point, in nanoseconds on a processor of 2022. Only which of two ways is the shorter matters.
struct cost {
    double small;     ///< for each prime factor p up to 5
    double per_prime; ///< times p, for each larger one
};
static const cost lanes_cost = {0.2, 0.073};
static const cost kiss_cost = {2.2, 2.0};
static const double quarters_cost = 1.2;       ///< beside the passes
static const double split_cost = 0.7;          ///< likewise
static const double split_cost_per_term = 0.9; ///< for each of (p - 1)/2 pairs of terms in each lane
static const double chirp_cost = 4.0;          ///< beside two transforms of the inner length
static const double least_chirp_cost = 10.0;   ///< with them

static double cost_of(size_t length, const cost &costs)
{
    double sum = 0.0;
    size_t rest = length;
    for (size_t p = 2; p * p <= rest; p++) {
        for (; rest % p == 0; rest /= p) {
            sum += p <= 5 ? costs.small : costs.per_prime * static_cast<double>(p);
        }
    }
    if (rest > 1) {
        sum += rest <= 5 ? costs.small : costs.per_prime * static_cast<double>(rest);
    }
    return sum;
}

static size_t largest_prime_of(size_t length)
{
    size_t largest = 1;
    size_t rest = length;
    for (size_t p = 2; p * p <= rest; p++) {
        for (; rest % p == 0; rest /= p) {
            largest = p;
        }
    }
    return rest > 1 ? rest : largest;
}

// One of the ways to transform a length directly.
struct direct_way {
    size_t split; ///< 0: KissFFT
    double cost;
};

// A short transform gains nothing from lanes.
static bool has_lanes(size_t length, size_t split)
{
    const size_t shortest_in_lanes = 8;
    return length % split == 0 && length / split >= shortest_in_lanes &&
           largest_prime_of(length / split) <= fft_largest_radix;
}

static direct_way best_direct_way(size_t length)
{
    if (has_lanes(length, 4)) {
        return {4, quarters_cost + cost_of(length / 4, lanes_cost)};
    }
    direct_way best = {0, cost_of(length, kiss_cost)};
    for (size_t split = 3; split <= fft_largest_split; split += 2) {
        if (has_lanes(length, split)) {
            const double used = static_cast<double>(split) / static_cast<double>((split + 3) / 4 * 4);
            const double terms = static_cast<double>(split / 2) / 4.0;
            const double cost = (split_cost + split_cost_per_term * terms + cost_of(length / split, lanes_cost)) / used;
            best = cost < best.cost ? direct_way{split, cost} : best;
        }
    }
    return best;
}

// The cheapest 32 x 2^a x 3^b x 5^c from `least` on.
static size_t smooth_length(size_t least)
{
    size_t best = 0;
    double best_time = std::numeric_limits<double>::infinity();
    for (size_t fives = 32; fives < 2 * least; fives *= 5) {
        for (size_t threes = fives; threes < 2 * least; threes *= 3) {
            size_t length = threes;
            while (length < least) {
                length *= 2;
            }
            const double time = best_direct_way(length).cost * static_cast<double>(length);
            if (time < best_time) {
                best = length;
                best_time = time;
            }
        }
    }
    return best;
}

// The inner length of a transform by chirp, 0 where a direct one is the shorter way.
static size_t chirp_length(size_t length, const direct_way &direct)
{
    if (direct.cost <= least_chirp_cost) {
        return 0;
    }
    const size_t inner = smooth_length(2 * length);
    const double ratio = static_cast<double>(inner) / static_cast<double>(length);
    return direct.cost > chirp_cost + 2.0 * ratio * best_direct_way(inner).cost ? inner : 0;
}

// std::complex<double> is laid out as two doubles (C++11 26.4/4), so the casts below are the sanctioned ones.

static const std::complex<double> *complex_of(const double *data)
{
    return reinterpret_cast<const std::complex<double> *>(data);
}

static std::complex<double> *complex_of(double *data)
{
    return reinterpret_cast<std::complex<double> *>(data);
}

struct fft_plan {
    explicit fft_plan(size_t points) : length(points)
    {
        const direct_way direct = best_direct_way(length);
        if (const size_t inner = chirp_length(length, direct)) {
            chirp.reset(new chirp_transform(length, inner, code));
        } else if (direct.split > 0) {
            lanes = code->create(length, direct.split);
        } else {
            forward.reset(new kissfft<double>(length, false));
            inverse.reset(new kissfft<double>(length, true));
            pair.resize(length);
            make_scratch();
        }
    }
    ~fft_plan()
    {
        if (lanes) {
            code->destroy(lanes);
        }
    }
    fft_plan(const fft_plan &) = delete;
    fft_plan &operator=(const fft_plan &) = delete;

    // KissFFT allocates what it needs for larger factors when it first meets one; here a lack of memory can be told.
    void make_scratch()
    {
        std::vector<std::complex<double>> out(length);
        forward->transform(pair.data(), out.data());
        inverse->transform(pair.data(), out.data());
    }

    // One of these three is there.
    size_t length;
    const fft_code *code = best_code();
    void *lanes = nullptr;
    std::unique_ptr<chirp_transform> chirp;
    std::unique_ptr<kissfft<double>> forward;
    std::unique_ptr<kissfft<double>> inverse; ///< with forward
    std::vector<std::complex<double>> pair;   ///< with forward: of fft_forward_pair
};

struct fft_plan *fft_plan_create(size_t length)
{
    if (length > longest_length) {
        return nullptr;
    }
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
    if (plan->lanes) {
        plan->code->run(plan->lanes, in, out, false);
    } else if (plan->chirp) {
        const std::complex<double> *numbers = complex_of(in);
        plan->chirp->run([numbers](size_t n) { return numbers[n]; }, complex_of(out), false);
    } else {
        plan->forward->transform(complex_of(in), complex_of(out));
    }
}

void fft_inverse(const struct fft_plan *plan, const double *in, double *out)
{
    if (plan->lanes) {
        plan->code->run(plan->lanes, in, out, true);
    } else if (plan->chirp) {
        plan->chirp->run([in](size_t n) { return std::complex<double>(in[2 * n + 1], in[2 * n]); }, complex_of(out),
                         true);
    } else {
        plan->inverse->transform(complex_of(in), complex_of(out));
    }
}

void fft_forward_pair(struct fft_plan *plan, const double *a, double scale_a, const double *b, double scale_b,
                      double *out)
{
    const auto both = [=](size_t n) { return std::complex<double>(scale_a * a[n], scale_b * b[n]); };
    if (plan->lanes) {
        plan->code->run_pair(plan->lanes, a, scale_a, b, scale_b, out);
    } else if (plan->chirp) {
        plan->chirp->run(both, complex_of(out), false);
    } else {
        for (size_t n = 0; n < plan->length; n++) {
            plan->pair[n] = both(n);
        }
        plan->forward->transform(plan->pair.data(), complex_of(out));
    }
}
