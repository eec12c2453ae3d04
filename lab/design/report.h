/* SPDX-License-Identifier: MIT */
/// What a person wants to see of a design: the period against its limits, the spectrum, the figures.
#ifndef SERVOSCOPE_DESIGN_REPORT_H
#define SERVOSCOPE_DESIGN_REPORT_H

#include "lab/design/design.h"
#include "lab/page/page.h"

/// Adds the page of one excitation: what was reached against which limit, in a box; peaks against limits, one period as
/// it is played (from start_index on), amplitudes; how many products of second and third order fall on each bin; the
/// start and what it leaves of a transient, beside all other starts; how it was made.
/// Errors: if memory is short the figures are replaced by a sentence that says so.
/// Cost:   that of design_start_choose() for periods of at most 32768 samples; longer ones show no other starts
/// Test:   tests/unit/test_design_report.c
void design_report_sections(struct page *page, const struct design_request *request,
                            const struct design_result *result);

/// Adds one section, of one excitation among other things: the box, the peaks, the period, the amplitudes.
void design_report_section(struct page *page, const char *heading, const struct design_request *request,
                           const struct design_result *result);

#endif
