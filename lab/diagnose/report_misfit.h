/* SPDX-License-Identifier: MIT */
/// Where the models are wrong, as figures and a table of the report. Internal to lab/diagnose.
#ifndef SERVOSCOPE_DIAGNOSE_REPORT_MISFIT_H
#define SERVOSCOPE_DIAGNOSE_REPORT_MISFIT_H

#include "lab/diagnose/diagnosis.h"
#include "lab/page/page.h"

/// Adds what of the models' squared residuals is noise, the residual over its expected standard deviation against
/// frequency, speed, position, level and time, and a table of where most of each model's misfit sits.
/// `best`: what the last model is called.
void report_misfit_add(struct page *page, const struct diagnosis *self, const char *best);

#endif
