/* SPDX-License-Identifier: MIT */
/// The fourth paper's study, piece by piece (Larsson, Geerardyn, Schoukens: Robust Input Design For Resonant Systems
/// Under Limited A Priori Information): how sure a resonance becomes with lines spaced by a ratio, wherever it lies.
/// For `./run bench quasilog` and for tests/golden/test_parametric.c.
#ifndef SERVOSCOPE_BENCH_QUASILOG_STUDY_H
#define SERVOSCOPE_BENCH_QUASILOG_STUDY_H

#include "lab/estimate/parametric.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { quasilog_systems = 7, quasilog_lines_max = 16384 };

/// Resonance frequencies of section 4.5.
extern const double quasilog_resonance_hz[quasilog_systems];

/// cheby1 of order 2 at 65536 Hz with the given damping and resonance, its gain at 0 Hz made 1.
void quasilog_system(double damping, double resonance_hz, struct parametric_model *out_model);
/// The same at 400 Hz plus that at 4000 Hz, order 4.
void quasilog_sum(double damping, struct parametric_model *out_model);

/// One experiment: unit RMS multisine of 65536 samples, white output noise of standard deviation noise.
struct quasilog_experiment {
    struct parametric_data data;
    size_t count;
    double *frequency_hz, *variance;
    double complex *input, *output;
};

/// Errors: false if memory is short
bool quasilog_open(bool linear, double noise, struct quasilog_experiment *out_self);
void quasilog_close(struct quasilog_experiment *self);

/// Draws phases and noise of one run.
struct random;
void quasilog_draw(struct quasilog_experiment *self, const struct parametric_model *truth, struct random *random);

/// Standard deviation of G by Cramer and Rao's bound, dB.
double quasilog_bound_db(const struct quasilog_experiment *experiment, struct parametric_model *truth,
                         double frequency_hz);

struct quasilog_scatter {
    double std_db, bias_db; ///< of the estimate over the runs
    double cost_ratio;      ///< mean cost over its expected value
    size_t failed;          ///< runs without an estimate
};

/// Estimates `runs` draws and takes the scatter of G at `count` frequencies. The start comes from the data.
bool quasilog_monte_carlo(struct quasilog_experiment *experiment, const struct parametric_model *truth, size_t runs,
                          uint64_t seed, size_t count, const double *frequency_hz,
                          struct quasilog_scatter *out_scatter);

/// Frequency over natural frequency of the single sine that determines frequency and damping best (4): by the formula
/// and by search.
double quasilog_optimum_formula(double damping);
double quasilog_optimum_searched(double damping);

/// Lines within the 3 dB band: by (5) and counted.
size_t quasilog_band_formula(double damping);
size_t quasilog_band_counted(double damping, double resonance_hz);

/// Integral (8) over pi / (16 w^2 zeta^3), which the paper says it is for small damping.
double quasilog_integral_ratio(double damping);

/// Largest element off the diagonal blocks of (7) over the largest of all, for a 1/f spectrum and resonances
/// `separation` bandwidths of the lower one apart, its natural frequency taken as the unit.
double quasilog_coupling(double damping, double separation);

#endif
