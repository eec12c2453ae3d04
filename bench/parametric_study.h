/* SPDX-License-Identifier: MIT */
/// Drives drawn at random, measured with noise and identified without a word about their orders: how often the model is
/// the drive, and how often what it says of its own accuracy is true.
/// For `./run bench parametric` and for tests/golden/test_parametric_plants.c.
#ifndef SERVOSCOPE_BENCH_PARAMETRIC_STUDY_H
#define SERVOSCOPE_BENCH_PARAMETRIC_STUDY_H

#include "lab/estimate/parametric_frf.h"

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

enum {
    study_poles_max = 5,
    study_lines_max = 256,
    study_periods_max = 10,
    study_kinds = 3,
};

/// Sum of residue / (s - pole) behind a hold and a delay of any length: one, two or three masses from torque to
/// velocity of the motor or of the last mass.
struct study_plant {
    size_t kind; ///< 0: rigid, 1: two masses, 2: three
    size_t poles;
    double complex pole_rad_per_s[study_poles_max];
    double complex residue[study_poles_max];
    double sample_rate_hz;
    double delay_samples;
};

/// One recording of a plant as spectra of its periods, noise on output and perhaps on input.
struct study_recording {
    struct study_plant plant;
    size_t periods;
    double snr_db; ///< of one period, mean power over the lines
    bool input_noise;
    struct run run;
    struct periodic recording;
    uint32_t bins[study_lines_max];
    double complex input[study_periods_max * study_lines_max];
    double complex output[study_periods_max * study_lines_max];
};

/// Draws plant, lines (60 to 256), periods (2 to 10), SNR (20 to 60 dB), delay (0.1 to 3 samples, or none) and noise,
/// all of it from the seed.
void study_draw(size_t kind, bool delay, uint64_t seed, struct study_recording *out_self);

/// Counts of one kind of plant, or of all.
struct study_tally {
    size_t drawn, refused;
    size_t right, lower, higher;             ///< poles against the plant's
    double covered, covered_squares;         ///< share of lines within the 95 % circle, summed over fits, and squared
    size_t frequencies, frequencies_covered; ///< poles of models of the right order, +-1.96 std
    size_t dampings, dampings_covered;       ///< the same of pairs
};

/// Identifies a recording by method `parametric` and counts it in; with `list` some lines about it are written there.
/// Returns false if the method refused it.
bool study_count(const struct study_recording *recording, struct study_tally *io_tally, FILE *list);

/// Adds one tally to another.
void study_add(const struct study_tally *tally, struct study_tally *io_sum);

/// Mean share of lines within the circle, and its standard error over the fits.
double study_coverage(const struct study_tally *tally, double *out_error);

#endif
