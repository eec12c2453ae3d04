/* SPDX-License-Identifier: MIT */
/// What the pages of a run and of a sequence have in common. Internal to lab/measure/report*.
#ifndef SERVOSCOPE_MEASURE_REPORT_PARTS_H
#define SERVOSCOPE_MEASURE_REPORT_PARTS_H

#include "lab/measure/report.h"

/// Names and units of the quantities of a kind of axis.
struct report_words {
    const char *name[measure_quantities];
    const char *unit[measure_quantities];
};

const struct report_words *report_words_of(bool linear);

/// A note about the worst SYNC, if the run has one; `rate_hz` of the SYNC.
void report_add_bus_note(struct page *page, const struct run *run);

/// A note if more than one sample in a hundred came late.
void report_add_late_note(struct page *page, uint64_t late, size_t rows);

/// The section on bus timing.
void report_add_bus(struct page *page, const struct run *run);

/// The section on amplitudes: `averaged` periods each; 0: not said.
void report_add_spectrum(struct page *page, bool linear, size_t count, const double *frequency_hz,
                         double *const amplitude[], double *const table_amplitude[], const char *what);

#endif
