/* SPDX-License-Identifier: MIT */
/// The page of a tuned loop: gains and margins with their std, closed loop beside the reference, open loop, plant.
#ifndef SERVOSCOPE_TUNE_REPORT_H
#define SERVOSCOPE_TUNE_REPORT_H

#include "lab/page/page.h"
#include "lab/record/frf_file.h"
#include "lab/tune/tune.h"

/// Adds all sections of the page; `frf` is the response that was tuned from.
/// Errors: if memory is short a figure is replaced by a sentence that says so.
/// Test:   tests/unit/test_tune.c
void tune_report_sections(struct page *page, const struct frf *frf, const struct tune_result *result);

#endif
