/* SPDX-License-Identifier: MIT */
/// What the second paper claims or leaves out beside its example: equal signal-to-noise ratios, several inputs at once,
/// what falls into a band of one octave, and what detection lines see of it.
#ifndef SERVOSCOPE_BENCH_SEQUENTIAL_CHECKS_H
#define SERVOSCOPE_BENCH_SEQUENTIAL_CHECKS_H

#include "bench/sequential_study.h"

/// Standard deviation of the response at some of the excitation's lines, from runs of the linearised plant at A = 1
/// with white noise on every sample of the position. By (6.7), (6.8) with l = 1 it is 2 noise_m /
/// sqrt(sequential_samples) for every line of every excitation.
/// The noise is uniform: a sum over 5000 samples does not know, and 10^8 of them come quickly.
/// Errors: false if memory is short
bool sequential_scatter(const struct sequential_excitation *excitation, size_t bin_count, const uint32_t *bins,
                        double noise_m, size_t runs, uint64_t seed, double *out_std);

struct sequential_inputs {
    double error_db[2]; ///< largest over both positions: from the force on mass 1, on mass 2
    double test_time_s;
};

/// Both forces on the linearised plant, held between samples and sampled exactly: octaves on interleaved lines played
/// together (section 8), or one force after the other; l = 1. Errors: false if memory is short
bool sequential_two_inputs(bool together, double settle_s, struct sequential_inputs *out_inputs);

/// Error of a response at the excited lines over random-phase draws, relative to the true one: its mean, which repeats
/// with every draw, and its scatter. -INFINITY: none.
struct sequential_levels {
    double coherent_db;
    double stochastic_db;
    double odd_db; ///< what lines that are left out show, as if they had been excited: odd bins, even bins
    double even_db;
};

/// Static y = u + a2 u^2 + a3 u^3 at A = 1. `lines` as for sequential_design().
/// Errors: false if memory is short
bool sequential_static(const char *lines, double a2, double a3, size_t draws, uint64_t seed,
                       struct sequential_levels *out_levels);

enum { sequential_bands = 3 }; ///< below 1.5 Hz, 1.5 to 6 Hz, above

/// The same on the plant, four periods after 200 s of settling, in each of the bands. `lines` may also be
/// "octaves-random-odd": octaves with odd lines only, of each four neighbours one left out.
bool sequential_distortion(const char *lines, const struct cubic_plant *plant, double amplitude_N, size_t draws,
                           uint64_t seed, struct sequential_levels out_levels[sequential_bands]);

/// Products that fall on lines L .. 2L-1 when all of them are excited.
struct sequential_products {
    size_t second_order;     ///< lines hit by 2 f, f1 + f2, f1 - f2
    size_t third_harmonics;  ///< hit by 3 f
    size_t second_inclusive; ///< second_order of L .. 2L, the upper edge closed
    size_t triples;          ///< ordered (f1, f2, f3) with f1 + f2 - f3 in the band
    size_t trivial;          ///< of those, f3 = f1 or f2: in phase with the line, it changes the gain
};

/// Errors: false if memory is short
bool sequential_count_products(size_t lowest, struct sequential_products *out_products);

#endif
