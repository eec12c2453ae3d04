/* SPDX-License-Identifier: MIT */
/// Frequency response with its standard deviation from the periods' Fourier coefficients, for one input U and one
/// output Y:
///
///     G = mean(Y) / mean(U)
///     std^2 = |G|^2 / M ( s_yy / |Y|^2 + s_uu / |U|^2 - 2 Re( s_yu / (Y conj(U)) ) )
///     s_yu = 1/(M-1) sum (Y_m - Y) conj(U_m - U)
///
/// over M periods, s_uu and s_yy likewise. std is the root: sqrt(E |dG|^2) of the complex error, both components
/// together. For Gaussian scatter |dG|^2 / std^2 is F-distributed with (2, 2(M-1)) degrees of freedom: the 95 % circle
/// has radius std sqrt(3.555) at M = 10. Evaluated as (s_yy + |G|^2 s_uu - 2 Re(conj(G) s_yu)) / (M |U|^2), which is
/// the same and needs no Y other than zero.
///
/// Means and sums of squares are Welford's, so a large mean does not eat the scatter. Arithmetic: core_real, which
/// SERVOSCOPE_REAL_BITS makes double or float; struct frf_statistics says which in `real_bits`. For the main loop, not
/// for an interrupt. math.h is needed for the root and the magnitude check only.
#ifndef SERVOSCOPE_FRF_STATISTICS_H
#define SERVOSCOPE_FRF_STATISTICS_H

#include "core/real.h"
#include "frf/dft.h"

#ifdef __cplusplus
extern "C" {
#endif

struct frf_complex {
    core_real real, imaginary;
};

/// Running sums of one bin; read-only for the application.
struct frf_pair {
    struct frf_complex input_mean, output_mean;
    core_real input_squares, output_squares; ///< sum |U_m - U|^2, sum |Y_m - Y|^2
    struct frf_complex cross;                ///< sum (Y_m - Y) conj(U_m - U)
    struct frf_complex input, output;        ///< of the period being added, until it is known to be whole
};

/// Read-only for the application.
struct frf_statistics {
    struct frf_pair *pairs;
    uint32_t bin_count;
    uint32_t periods;       ///< M: periods that count
    uint32_t last_sequence; ///< of the last period looked at; 0: none
    uint32_t real_bits;     ///< 64: double, 32: float
    struct {
        uint32_t by_reason[frf_reason_count]; ///< periods left out, by bit of enum frf_reason; several may hold
        uint32_t invalid;                     ///< periods left out for any of these reasons
        uint32_t overrun;                     ///< periods overwritten while they were read
        uint32_t missed;                      ///< periods that ended without having been read
        uint32_t not_finite;                  ///< periods with a coefficient that is not a number
    } excluded;
};

enum frf_validity {
    frf_valid = 0,
    frf_invalid_periods = 1,    ///< fewer than two periods: no scatter, no standard deviation
    frf_invalid_input = 2,      ///< input mean at or below the floor: nothing was excited there
    frf_invalid_not_finite = 3, ///< the result does not fit the number type
};

struct frf_estimate {
    core_real real, imaginary;                 ///< G; 0 unless there is an input, output units per input unit
    core_real std;                             ///< of G; 0 unless valid
    core_real input_variance, output_variance; ///< s_uu, s_yy: of one period, not of the mean
    struct frf_complex covariance;             ///< s_yu
    enum frf_validity validity;
};

/// Sets up empty statistics of bin_count bins over `storage`, which must outlive self.
/// Errors: core_err_argument (null, no bins)
/// Test:   tests/unit/test_frf_statistics.c
enum core_status frf_statistics_init(struct frf_statistics *self, struct frf_pair *storage, uint32_t bin_count);

/// Adds one period from coefficients that the caller has; arrays of bin_count. Any unit.
/// A period with a coefficient that is not finite is left out and counted. Returns whether it was added.
bool frf_statistics_add(struct frf_statistics *self, const struct frf_complex *input, const struct frf_complex *output);

/// Adds the last completed period of a DFT, once: channels input_channel and output_channel, in sample counts (times
/// N). Left out and counted: invalid periods, by reason; periods overwritten during the call. Call it at least once
/// per period; periods that passed unseen are counted in excluded.missed. Returns whether a period was added. The DFT
/// must have bin_count bins, else nothing is added.
bool frf_statistics_add_period(struct frf_statistics *self, const struct frf_dft *dft, uint32_t input_channel,
                               uint32_t output_channel);

/// Estimates G and its standard deviation at a bin.
/// input_floor: |mean U| has to exceed it, in the unit of what was added; at least 0. NaN makes every bin invalid.
/// Never NaN or infinite: what cannot be said is 0 with a reason in `validity`.
void frf_statistics_estimate(const struct frf_statistics *self, uint32_t bin, core_real input_floor,
                             struct frf_estimate *out_estimate);

/// Fourier coefficient of a latched period in sample counts, whatever the variant; the table's factor is taken out.
struct frf_complex frf_period_value(const struct frf_dft *dft, const struct frf_period *period, uint32_t bin,
                                    uint32_t channel);

#ifdef __cplusplus
}
#endif

#endif
