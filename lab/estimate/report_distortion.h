/* SPDX-License-Identifier: MIT */
/// What a person wants to see of a drive's nonlinear distortion: its level beside response and noise, and harmonics.
#ifndef SERVOSCOPE_ESTIMATE_REPORT_DISTORTION_H
#define SERVOSCOPE_ESTIMATE_REPORT_DISTORTION_H

#include "lab/page/page.h"
#include "lab/record/frf_file.h"

/// Adds a section: response, noise, total standard deviation where realisations give one, odd and even distortion, all
/// in dB; with thd_db (one for each line, NaN where it is not known; NULL: no dwell) the total harmonic distortion.
/// Adds nothing if nothing of that is known. Lines that are not valid, and levels of 0, are left out.
/// Errors: if memory is short the figure is replaced by a sentence that says so.
/// Test:   tests/unit/test_report_distortion.c
void frf_report_distortion_section(struct page *page, const struct frf *frf, const double *thd_db);

#endif
