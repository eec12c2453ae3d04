/* SPDX-License-Identifier: MIT */
/// Structure over time in what a model leaves of a run with periods: what is noise does not care which period it is in.
#ifndef SERVOSCOPE_DIAGNOSE_STRUCTURE_H
#define SERVOSCOPE_DIAGNOSE_STRUCTURE_H

#include "lab/diagnose/noise.h"

enum { structure_places_max = 24 };

/// Something beyond chance. Nats are log-likelihood ratios against equal variance: however large it is, they hardly
/// grow. What it would be worth to a model that has it says `beyond`.
struct structure {
    bool found;
    double nats;                ///< of the strongest, as are excess, the bins and the words
    double excess;              ///< its power over that of the rest
    double beyond;              ///< nats that all slow changes and levels have over the rest, if that is the noise
    size_t first_bin, last_bin; ///< of the block, where it is
    char where[160];            ///< empty if nothing was found
    size_t place_count;         ///< all that were found; more than structure_places_max are left out
    size_t place_first[structure_places_max], place_last[structure_places_max]; ///< bins
};

/// Adds the places of another structure, whose words are kept if it is the stronger one.
void structure_merge(struct structure *self, const struct structure *other);

/// Whether a bin lies in one of the places.
bool structure_holds(const struct structure *self, size_t bin);

/// Looks, in the contrasts that a model leaves, for a change from period to period that is slower than the rest (per
/// octave of frequency), for a constant part that differs between periods by more than the lines next to it, for a
/// stretch of one period that is louder than the same stretch of the others (likewise), and
/// for lines.
/// Equation:  nats = (n ln(S / n) - m ln(A / m) - (n - m) ln((S - A) / (n - m))) / 2,  A the sum of m of the n squares
///            whose sum is S, where A / m is the larger
/// Range:     four periods or more; nothing is found in fewer
/// Shapes:    contrasts: evidence->contrast.values
/// Errors:    false if memory is short
bool structure_find(const struct evidence *evidence, const double *contrasts, struct structure *out_structure);

/// The same for a run without periods, in what model and black box together leave of it (whitened): a change slower
/// than a fourth of the run, which no function of the motion explains.
/// Shapes:    whitened: evidence->values
void structure_find_slow(const struct evidence *evidence, const double *whitened, struct structure *out_structure);

#endif
