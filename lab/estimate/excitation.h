/* SPDX-License-Identifier: MIT */
/// What excited a recording, kept to tell whether two runs are realisations (other phases) or the same excitation
/// again, which only adds periods: the nonlinear distortion of one excitation is the same in all of its periods.
#ifndef SERVOSCOPE_ESTIMATE_EXCITATION_H
#define SERVOSCOPE_ESTIMATE_EXCITATION_H

#include "lab/estimate/periodic.h"

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Of one recording. Zero-initialised: nothing is known of it.
struct excitation {
    bool has_table_crc32;
    uint32_t table_crc32;
    size_t period_samples;
    size_t count;
    uint32_t *bins;       ///< owned
    double complex *mean; ///< of the input's spectra over the periods that count; owned
    double noise;         ///< sum over lines of the variances of these means
};

/// Takes over what a cut recording was excited by. Errors: false if memory is short; excitation_free() in every case.
bool excitation_take(const struct periodic *recording, struct excitation *out);

void excitation_free(struct excitation *self);

enum excitation_match {
    excitation_unknown,     ///< too few lines, too much noise, other lines or no period
    excitation_other,       ///< other phases: a realisation of its own
    excitation_same,        ///< same table, or same phases and sizes
    excitation_other_level, ///< same phases at another level
};

/// Compares two excitations, whatever sample each recording begins with.
///
/// Equation:  c(t) = Re sum_k A_k conj(B_k) exp(-jw_k t), the largest over all shifts t of a period;
///            likeness = c / sqrt(sum |A|^2 sum |B|^2), which noise alone leaves at about
///            1 - (s_A^2/sum |A|^2 + s_B^2/sum |B|^2)/2;  level = sqrt(sum |B|^2 / sum |A|^2)
/// Same:      both have a table_crc32 and it is the same one; else likeness missing no more than 1 % and what noise
///            explains on K lines, times 1 + 5/sqrt(K); level within 10 % and 4 standard deviations
/// Lines:     phases decide from 6 lines on (of fewer a shift alone brings any two together) and where what may miss is
///            less than 1 % for each line and 30 % in all, which other phases reach by chance
/// Errors:    false if memory is short
/// Test:      tests/unit/test_excitation.c
bool excitation_compare(const struct excitation *a, const struct excitation *b, enum excitation_match *out_match,
                        double *out_level);

/// Of all segments of a recording that is a sequence, or of one run. Zero-initialise.
struct excitations {
    size_t count;
    struct excitation *items;
};

/// Takes `one` over, which is empty then. Errors: false if memory is short.
bool excitations_add(struct excitations *self, struct excitation *one);

/// Adds all of `io_from`, which is empty then, behind those of `io_to`. Errors: false if memory is short.
bool excitations_move(struct excitations *io_from, struct excitations *io_to);

/// Segment by segment: what any segment that can be compared says; excitation_unknown if none can.
bool excitations_compare(const struct excitations *a, const struct excitations *b, enum excitation_match *out_match,
                         double *out_level);

void excitations_free(struct excitations *self);

#endif
