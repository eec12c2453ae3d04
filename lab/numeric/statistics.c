/* SPDX-License-Identifier: MIT */
#include "lab/numeric/statistics.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>

static const double two_pi = 6.283185307179586476925;

enum { fraction_terms_max = 20000, bisections = 220 };

/// Keeps a denominator of Lentz's method away from zero; smaller than any that matters.
static const double tiny = 1e-300;

static double away_from_zero(double x)
{
    return fabs(x) < tiny ? tiny : x;
}

/// exp(-x) x^a / Gamma(a), common to both expansions of the incomplete gamma function.
static double gamma_prefactor(double a, double x)
{
    return exp(a * log(x) - x - lgamma(a));
}

/// Lower function by its power series: converges fast for x < a + 1.
static double gamma_lower_series(double a, double x)
{
    double term = 1.0 / a;
    double sum = term;
    for (int n = 1; n < fraction_terms_max && fabs(term) > DBL_EPSILON * fabs(sum); n++) {
        term *= x / (a + n);
        sum += term;
    }
    return sum * gamma_prefactor(a, x);
}

/// Upper function by Legendre's continued fraction (modified Lentz): converges fast for x > a + 1.
static double gamma_upper_fraction(double a, double x)
{
    double b = x + 1.0 - a;
    double c = 1.0 / tiny;
    double d = 1.0 / away_from_zero(b);
    double value = d;
    for (int n = 1; n < fraction_terms_max; n++) {
        double numerator = -n * (n - a);
        b += 2.0;
        d = 1.0 / away_from_zero(numerator * d + b);
        c = away_from_zero(b + numerator / c);
        double factor = c * d;
        value *= factor;
        if (fabs(factor - 1.0) < DBL_EPSILON) {
            break;
        }
    }
    return value * gamma_prefactor(a, x);
}

double statistics_chi2_cdf(double x, double dof)
{
    if (!(dof > 0.0 && x >= 0.0)) {
        return NAN;
    }
    double a = dof / 2.0;
    double z = x / 2.0;
    if (z <= 0.0) {
        return 0.0;
    }
    return z < a + 1.0 ? gamma_lower_series(a, z) : 1.0 - gamma_upper_fraction(a, z);
}

double statistics_chi2_tail(double x, double dof)
{
    if (!(dof > 0.0 && x >= 0.0)) {
        return NAN;
    }
    double a = dof / 2.0;
    double z = x / 2.0;
    if (z <= 0.0) {
        return 1.0;
    }
    return z < a + 1.0 ? 1.0 - gamma_lower_series(a, z) : gamma_upper_fraction(a, z);
}

/// Continued fraction of I_z(a, b) (modified Lentz); converges fast for z < (a + 1)/(a + b + 2).
static double beta_fraction(double a, double b, double z)
{
    double c = 1.0;
    double d = 1.0 / away_from_zero(1.0 - (a + b) * z / (a + 1.0));
    double value = d;
    for (int m = 1; m < fraction_terms_max; m++) {
        double even = m * (b - m) * z / ((a + 2 * m - 1) * (a + 2 * m));
        double odd = -(a + m) * (a + b + m) * z / ((a + 2 * m) * (a + 2 * m + 1));
        d = 1.0 / away_from_zero(1.0 + even * d);
        c = away_from_zero(1.0 + even / c);
        value *= c * d;
        d = 1.0 / away_from_zero(1.0 + odd * d);
        c = away_from_zero(1.0 + odd / c);
        value *= c * d;
        if (fabs(c * d - 1.0) < DBL_EPSILON) {
            break;
        }
    }
    return value;
}

/// I_z(a, b) with z and 1 - z both given, so that neither loses digits near its end.
static double beta_lower(double a, double b, double z, double one_minus_z)
{
    if (z <= 0.0 || one_minus_z <= 0.0) {
        return z <= 0.0 ? 0.0 : 1.0;
    }
    double log_prefactor = lgamma(a + b) - lgamma(a) - lgamma(b) + a * log(z) + b * log(one_minus_z);
    if (z < (a + 1.0) / (a + b + 2.0)) {
        return exp(log_prefactor) * beta_fraction(a, b, z) / a;
    }
    return 1.0 - exp(log_prefactor) * beta_fraction(b, a, one_minus_z) / b;
}

double statistics_f_cdf(double x, double d1, double d2)
{
    if (!(d1 > 0.0 && d2 > 0.0 && x >= 0.0)) {
        return NAN;
    }
    double sum = d1 * x + d2;
    return beta_lower(d1 / 2.0, d2 / 2.0, d1 * x / sum, d2 / sum);
}

double statistics_f_tail(double x, double d1, double d2)
{
    if (!(d1 > 0.0 && d2 > 0.0 && x >= 0.0)) {
        return NAN;
    }
    double sum = d1 * x + d2;
    return beta_lower(d2 / 2.0, d1 / 2.0, d2 / sum, d1 * x / sum);
}

/// Bisects on log x. The tail decides above the median, the distribution function below, each where it keeps its
/// digits.
static double bisect_quantile(double (*cdf)(double, double, double), double (*tail)(double, double, double),
                              double probability, double d1, double d2)
{
    double low = -700.0;
    double high = 700.0;
    for (int n = 0; n < bisections && high - low > DBL_EPSILON * fabs(high + low); n++) {
        double middle = 0.5 * (low + high);
        double x = exp(middle);
        bool below = probability < 0.5 ? cdf(x, d1, d2) < probability : tail(x, d1, d2) > 1.0 - probability;
        if (below) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return exp(0.5 * (low + high));
}

static double chi2_cdf_adapter(double x, double dof, double unused)
{
    (void)unused;
    return statistics_chi2_cdf(x, dof);
}

static double chi2_tail_adapter(double x, double dof, double unused)
{
    (void)unused;
    return statistics_chi2_tail(x, dof);
}

double statistics_chi2_quantile(double probability, double dof)
{
    if (!(probability > 0.0 && probability < 1.0 && dof > 0.0)) {
        return NAN;
    }
    return bisect_quantile(chi2_cdf_adapter, chi2_tail_adapter, probability, dof, 0.0);
}

double statistics_f_quantile(double probability, double d1, double d2)
{
    if (!(probability > 0.0 && probability < 1.0 && d1 > 0.0 && d2 > 0.0)) {
        return NAN;
    }
    return bisect_quantile(statistics_f_cdf, statistics_f_tail, probability, d1, d2);
}

static double middle_of(double a, double b, double c)
{
    const double low = a < b ? a : b;
    const double high = a < b ? b : a;
    return c < low ? low : c > high ? high : c;
}

/// Reorders values so that the k-th in order has its place and none before it is larger (Hoare, Comm. ACM 4 (1961)
/// 321).
static double select_in_order(double *values, ptrdiff_t count, ptrdiff_t k)
{
    ptrdiff_t first = 0;
    ptrdiff_t last = count - 1;
    while (first < last) {
        const double pivot = middle_of(values[first], values[first + (last - first) / 2], values[last]);
        ptrdiff_t i = first;
        ptrdiff_t j = last;
        while (i <= j) {
            while (values[i] < pivot) {
                i++;
            }
            while (pivot < values[j]) {
                j--;
            }
            if (i <= j) {
                const double held = values[i];
                values[i++] = values[j];
                values[j--] = held;
            }
        }
        /* Between j and i lies nothing but the pivot: k there ends the search, too. */
        first = k > j ? i : first;
        last = k < i ? j : last;
    }
    return values[k];
}

double statistics_median(double *values, size_t count)
{
    if (count == 0) {
        return NAN;
    }
    const size_t half = count / 2;
    const double upper = select_in_order(values, (ptrdiff_t)count, (ptrdiff_t)half);
    if (count % 2) {
        return upper;
    }
    double lower = values[0];
    for (size_t i = 1; i < half; i++) {
        lower = values[i] > lower ? values[i] : lower;
    }
    return 0.5 * (lower + upper);
}

void random_seed(struct random *self, uint64_t seed)
{
    for (size_t i = 0; i < 4; i++) {
        seed += UINT64_C(0x9e3779b97f4a7c15);
        uint64_t z = seed;
        z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
        z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
        self->state[i] = z ^ (z >> 31);
    }
}

static uint64_t rotate_left(uint64_t x, unsigned bits)
{
    return (x << bits) | (x >> (64U - bits));
}

uint64_t random_bits(struct random *self)
{
    uint64_t *s = self->state;
    uint64_t result = rotate_left(s[0] + s[3], 23) + s[0];
    uint64_t shifted = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= shifted;
    s[3] = rotate_left(s[3], 45);
    return result;
}

double random_uniform(struct random *self)
{
    return (double)(random_bits(self) >> 11) * 0x1p-53;
}

double random_normal(struct random *self)
{
    /* 1 - u lies in (0, 1], so the logarithm is finite. */
    double radius = sqrt(-2.0 * log(1.0 - random_uniform(self)));
    return radius * cos(two_pi * random_uniform(self));
}
