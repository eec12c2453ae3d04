/* SPDX-License-Identifier: MIT */
/// A diagnosis as sections of a page, for diagnosis_report() and for whoever shows it within a larger story.
#ifndef SERVOSCOPE_DIAGNOSE_REPORT_H
#define SERVOSCOPE_DIAGNOSE_REPORT_H

#include "lab/diagnose/diagnosis.h"
#include "lab/page/page.h"

/// Adds the verdict and its numbered sections: what was given, what is wrong, causes, friction, gain, what could not be
/// tested, ties and next measurements, what stays unexplained. Sections without content are left out or say so.
/// Test:  tests/unit/test_diagnosis_report.c
void diagnosis_report_sections(struct page *page, const struct diagnosis *self);

#endif
