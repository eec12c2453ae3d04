/* SPDX-License-Identifier: MIT */
/// Nonlinear distortion as the bins show it that nobody excites: what repeats there from period to period is no noise,
/// and a linear drive would not put it there.
#ifndef SERVOSCOPE_ESTIMATE_DISTORTION_H
#define SERVOSCOPE_ESTIMATE_DISTORTION_H

#include "lab/estimate/periodic.h"
#include "lab/record/frf_file.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum distortion_kind {
    distortion_odd,   ///< of third, fifth, ... order; it falls on excited lines too, as scatter between realisations
    distortion_even,  ///< of second, fourth, ... order; with odd lines only it falls between them
    distortion_mixed, ///< of any order: what free bins show where even bins are excited too
    distortion_kinds,
};

enum {
    distortion_neighbours = 4,       ///< free bins that speak for a line, the nearest within an octave
    distortion_fewest_neighbours = 2 ///< with fewer a line's level is not known
};

/// Summary of one kind over all lines.
struct distortion_level {
    size_t bins;   ///< free bins that show it; 0: there are none, and nothing else here means anything
    double fisher; ///< -2 sum log P over them, P the chance that noise alone is as strong; adds up over recordings
    double limit;  ///< level over |G| that noise alone stays below with 95 %, median of the lines; NaN: no line has one
    double median; ///< level over |G|, median of the lines that have one; NaN as above
};

struct distortion {
    struct distortion_level kind[distortion_kinds];
};

/// Bins that other inputs excite at the same time, ascending; they are neither free nor taken for distortion.
struct distortion_options {
    const uint32_t *other_bins;
    size_t other_count;
};

/// Fills in the columns odd_distortion and even_distortion of a response, at its valid lines.
///
/// Free bins: multiples of the lines' greatest common divisor between the first and the last line that nothing excites.
///            Where all lines are odd multiples, odd free bins show odd-order distortion and even ones even-order
///            distortion. Where even ones are excited too they show both together: no column, only the summary's
///            distortion_mixed. A full grid has none, and its columns stay unknown.
/// Equation:  E_m(d) = Y_m(d) - G(d) U_m(d), what the input itself carries there taken off with the response of the
///            neighbouring lines (between them on a straight line);
///            D^2(k) = mean over the distortion_neighbours nearest d of |Ebar(d)|^2 - s_E^2(d)/M;
///            level(k) = D(k) / |Ubar(k)|
/// Noise:     a level is 0 where noise alone would be as strong with a chance above 5 %:
///            sum M |Ebar|^2 / sum s_E^2 ~ F(2J, 2J(M-1)) over J bins. So of the lines of a linear drive 5 % have one
/// Drift:     the output's trend over the periods is taken out first: what it leaks is the same in every period
/// Units:     those of the response
/// Periods:   those that count, without leading ones that have not settled, as long as two are left
/// Limits:    where G changes much between two lines and the input is strong on a free bin between them (a closed
///            loop),
///            what the straight line misses counts as distortion
/// Errors:    false if memory is short
/// Test:      tests/unit/test_distortion.c
bool distortion_estimate(const struct periodic *recording, const struct distortion_options *options, struct frf *io_frf,
                         struct distortion *out);

/// Chance that noise alone shows as much in all bins together; 1 without bins.
double distortion_chance(const struct distortion_level *self);

/// Adds what another recording (realisation, segment) shows. The limit and the median become the larger ones.
void distortion_merge(struct distortion *self, const struct distortion *other);

#endif
