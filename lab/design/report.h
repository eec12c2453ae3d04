/* SPDX-License-Identifier: MIT */
/// What a person wants to see of a design: the period against its limits, the spectrum, the figures.
#ifndef SERVOSCOPE_DESIGN_REPORT_H
#define SERVOSCOPE_DESIGN_REPORT_H

#include "lab/design/design.h"
#include "lab/page/page.h"

/// Adds a section: torque, velocity and position over one period as it is played (from start_index on), each with its
/// limits; amplitudes over frequency; a table of peaks at the samples and in between.
/// Errors: if memory is short the figures are replaced by a sentence that says so.
void design_report_section(struct page *page, const struct design_request *request, const struct design_result *result);

#endif
