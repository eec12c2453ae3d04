/* SPDX-License-Identifier: MIT */
/// Which lines are excited one after the other, for how long, and for several inputs at once (second paper, 5 to 8).
///
///     octaves:FMIN:FMAX:STEP   bands [FMIN 2^i, FMIN 2^(i+1)), the last one closed at FMAX: no harmonic and no sum or
///                              difference of two lines of a band falls into it. Band i counts N_i periods, as many
///                              as it has lines: the same noise at each line as one multisine of all would have
///     dwell:FMIN:FMAX:STEP     one line at a time, one period of the table each: f / STEP periods of the sine
///     any other (lines.h)      one segment of all lines
///
/// Several inputs play at once on lines of their own: input p has those of input 1 shifted by (p-1) STEP/P. Where STEP
/// is not said (quasilog, list) the lines lie on every P-th bin and the shift is p-1 bins. `odd` and `random-odd` shift
/// by 2 (p-1) STEP/P, for an even P by 2 (p-1) STEP/(P+1): then the lines of all inputs are odd multiples of one
/// frequency, and even-order distortion of none of them, nor of two together, falls on a line of another.
#ifndef SERVOSCOPE_DESIGN_SEQUENCE_H
#define SERVOSCOPE_DESIGN_SEQUENCE_H

#include "lab/design/lines.h"
#include "lab/record/error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    design_inputs_max = 16,
    design_segments_max = 4096, ///< each is a set of files
};

enum design_sequence_kind {
    design_sequence_multisine,
    design_sequence_octaves,
    design_sequence_dwell,
};

/// One multisine of a sequence; all of a sequence have the same period.
struct design_segment {
    uint32_t periods;           ///< N_i: counted periods at the least averaging
    struct design_lines *lines; ///< one set for each input; owned
};

struct design_sequence {
    enum design_sequence_kind kind;
    double rate_hz;
    size_t period_samples;
    size_t inputs; ///< P
    size_t segment_count;
    struct design_segment *segments; ///< in the order of playing: frequencies ascend
};

/// Name as in a specification and in the manifest: "multisine", "octaves", "dwell".
const char *design_sequence_kind_str(enum design_sequence_kind kind);

/// Whether a specification names a sequence of several tables (octaves, dwell), right or wrong in the rest.
bool design_sequence_is(const char *specification);

/// Reads a specification. `seed` is for random-odd.
/// Errors: those of design_lines_parse(); error_usage for a period that does not resolve the shift of the inputs (it
///         names one that would), a line of the last input that is too high, inputs outside 1 .. 16, too many segments.
///         *out_sequence is empty then.
/// Test:   tests/unit/test_design_sequence.c
int design_sequence_parse(const char *specification, const struct design_line_grid *grid, size_t inputs, uint64_t seed,
                          struct design_sequence *out_sequence, struct error *out_error);

void design_sequence_free(struct design_sequence *self);

/// Counted table periods of a segment for averaging factor l.
/// Equation:  ceil(l N_i / P): P inputs need a period P times as long, in which P lines stand where one stood
uint64_t design_sequence_periods(const struct design_sequence *self, size_t segment, uint64_t periods);

/// Time that the measurement takes: settling once per segment, then the counted periods.
/// Equation:  T = sum_i (ceil(l N_i / P) N / rate + settle_s)             (second paper, 4.2, 5.2, 7.4, 8.1)
///            one multisine l/eta + dt; dwell sum_k l_k/f_k + dt with l_k = l f_k/eta; octaves l N/eta + M dt
/// Units:     seconds. Range: periods >= 1, settle_s >= 0
double design_sequence_test_time_s(const struct design_sequence *self, uint64_t periods, double settle_s);

#endif
