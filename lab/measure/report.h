/* SPDX-License-Identifier: MIT */
/// The page of a measurement: how punctual the bus was, what was lost, how near the limits it went, how it settled.
#ifndef SERVOSCOPE_MEASURE_REPORT_H
#define SERVOSCOPE_MEASURE_REPORT_H

#include "lab/measure/measure.h"
#include "lab/measure/summary.h"
#include "lab/page/page.h"

#include <stddef.h>

/// Adds the sections of one measurement: verdicts, bus timing (from the run's keys), lost and late samples over time,
/// level, settling, amplitudes at the lines. What an early end or the kind of drive leaves nothing to show of is said.
/// Test: tests/unit/test_measure_summary.c, tests/cli/measure.sh
void measure_page_sections(struct page *page, const struct measure_summary *summary,
                           const struct measure_report *report);

/// What the page of a sequence keeps of one segment, whose run does not stay in memory.
struct measure_page_segment {
    const char *name; ///< of its run's file; borrowed
    size_t rows, rows_planned, lost;
    uint64_t late; ///< among its rows
    struct measure_level level[measure_quantities];
    double first[measure_velocity + 1]; ///< measure_summary_first
    double usual[measure_velocity + 1]; ///< measure_summary_usual
    size_t lines;
    double *frequency_hz, *amplitude[measure_velocity + 1], *table_amplitude[measure_velocity + 1];
};

/// Copies what the page of a sequence needs, but for the name.
/// Errors: false if memory is short; nothing to free then
bool measure_page_segment_make(const struct measure_summary *summary, const struct measure_report *report,
                               struct measure_page_segment *out_self);

void measure_page_segment_free(struct measure_page_segment *self);

/// A sequence as far as it was measured.
struct measure_page_sequence {
    const char *kind;
    size_t planned;         ///< segments
    const char *stopped_by; ///< NULL: it was not
    const struct run *keys; ///< with the bus's keys of the last run, which count from the first; may be NULL
    size_t count;           ///< segments that were measured
    const struct measure_page_segment *segments;
    bool linear;
};

/// Adds the sections of a sequence: verdicts, bus timing, then lost and late samples, peaks, settling of each segment
/// over its number and all lines in one figure. Single periods are not shown.
void measure_page_sequence_sections(struct page *page, const struct measure_page_sequence *sequence);

#endif
