/* SPDX-License-Identifier: MIT */
/// The second paper's study, piece by piece (Hoagg, Lacy, Babuska, Bernstein: Sequential Multisine Excitation Signals
/// for System Identification of Large Space Structures): one multisine, octaves one after the other, one line after the
/// other, each on the plant with cubic springs. For `./run bench sequential` and tests/golden/test_sequential.c.
///
/// Lines and periods come from lab/design/sequence.h, phases from lab/design/phases.h, spectra from lab/estimate. Every
/// line has the amplitude A / sqrt(N_i), N_i the lines of its segment. The response is the mean of the counted periods'
/// spectra over that of the force; its error |20 log |Ghat / G||, G being the linearised plant.
#ifndef SERVOSCOPE_BENCH_SEQUENTIAL_STUDY_H
#define SERVOSCOPE_BENCH_SEQUENTIAL_STUDY_H

#include "tests/support/cubic_plant.h"

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    sequential_rate_hz = 500,
    sequential_samples = 5000, ///< 10 s: lines every 0.1 Hz
    sequential_lines = 250,    ///< 0.1 .. 25 Hz; line k is bin k + 1
};

enum sequential_phases {
    sequential_schroeder, ///< as in the paper
    sequential_random,
    sequential_sine, ///< (5.1): the dwell's
};

struct sequential_segment {
    size_t line_count;
    uint32_t *bins;
    double *phase_rad;
    size_t periods; ///< counted ones at l = 1
};

struct sequential_excitation {
    size_t count;
    struct sequential_segment *segments;
};

/// From a specification (lab/design/sequence.h). One multisine counts as many periods as it has lines.
/// Errors: false if memory is short or the specification is not one
bool sequential_design(const char *lines, enum sequential_phases phases, uint64_t seed,
                       struct sequential_excitation *out_self);
void sequential_free(struct sequential_excitation *self);

/// One period of sum A / sqrt(N_i) cos(2 pi f_k t + phi_k) at `points` equal steps. Errors: false if memory is short
bool sequential_force(const struct sequential_segment *segment, double amplitude_N, size_t points, double *out_force_N);

struct sequential_play {
    const struct cubic_plant *plant;
    double amplitude_N; ///< A
    size_t settle_periods;
    size_t periods; ///< counted; 0: as many as the excitation says
    bool held;      ///< the force is held between samples
    bool from_rest; ///< every segment; else the state is carried over
    bool downwards; ///< the last segment first
};

/// One segment, played.
struct sequential_recording {
    size_t periods;
    double force_N[sequential_samples];
    double *position_m; ///< periods x sequential_samples; owned
};

/// Plays settling and counted periods of one segment from the state given. Errors: false if memory is short
bool sequential_record(const struct sequential_segment *segment, const struct sequential_play *play,
                       struct cubic_state *io_state, struct sequential_recording *out_recording);

/// Response at bins: mean output over input. Bins that are not excited give what distortion makes of a line as strong
/// as those of `segment`. Errors: false if memory is short
bool sequential_estimate(const struct sequential_segment *segment, const struct sequential_recording *recording,
                         size_t bin_count, const uint32_t *bins, double complex *out_response);

/// Plays and estimates the whole excitation; lines that it does not excite stay 0.
bool sequential_respond(const struct sequential_excitation *self, const struct sequential_play *play,
                        double complex out_response[sequential_lines]);

/// Error in dB over the excited lines with low_hz <= f < high_hz: RMS, and largest.
double sequential_error_rms_db(const double complex response[sequential_lines], double low_hz, double high_hz);
double sequential_error_max_db(const double complex response[sequential_lines], double low_hz, double high_hz);

/// Largest of the signal over its nominal amplitude A, on eight points a sample.
double sequential_peak(const struct sequential_segment *segment);

/// How far the response differs from period to period in the end, RMS over the RMS of a period: neighbours, and every
/// other one. The play's counted periods have to be at least three. Errors: false if memory is short
bool sequential_period_difference(const struct sequential_segment *segment, const struct sequential_play *play,
                                  double *out_next, double *out_next_but_one);

/// Power of all superharmonics up to half the rate over that of the line, dB.
/// Errors: NaN if memory is short
double sequential_harmonic_distortion_db(const struct sequential_segment *segment, const struct sequential_play *play,
                                         struct cubic_state *io_state);

#endif
