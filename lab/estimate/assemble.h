/* SPDX-License-Identifier: MIT */
/// One response from those of a sequence's segments, each measured on lines of its own.
#ifndef SERVOSCOPE_ESTIMATE_ASSEMBLE_H
#define SERVOSCOPE_ESTIMATE_ASSEMBLE_H

#include "lab/record/error.h"
#include "lab/record/frf_file.h"

#include <stddef.h>

/// Puts all lines of the segments into one response, ordered by frequency.
///
/// Lines:   as they are, standard deviations included; the segments share none
/// Periods, degrees of freedom: the smallest of all segments, because a response has one number for all lines. So
///          confidence_95_factor holds for the segment with the fewest, and is larger than it need be for the others
/// Keys:    those of estimate_set_common_keys; `segments` and, one number for each,
///          `segment_first_hz`, `segment_periods`, `segment_degrees_of_freedom`
/// Errors:  error_refused if input, output or method differ, if two segments have the same line, or if memory is short;
///          *out_frf is empty then
/// Test:    tests/unit/test_assemble.c
int estimate_assemble(const struct frf *segments, size_t count, struct frf *out_frf, struct error *out_error);

#endif
