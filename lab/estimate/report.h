/* SPDX-License-Identifier: MIT */
/// What a person wants to see of a frequency response: Bode diagram with its uncertainty, and what a model gets wrong.
#ifndef SERVOSCOPE_ESTIMATE_REPORT_H
#define SERVOSCOPE_ESTIMATE_REPORT_H

#include "lab/page/page.h"
#include "lab/record/frf_file.h"

#include <stddef.h>

enum { frf_report_curves_max = 4 };

/// A model's response at any frequencies, ascending; it is held against the measured lines at equal frequencies.
struct frf_model_curve {
    const char *name;
    size_t count;
    const double *frequency_hz;
    const double *real;
    const double *imag;
};

struct frf_report_options {
    double known_delay_s; ///< taken out of every phase shown (half a sample of hold, a known dead time); 0: none
    size_t curve_count;   ///< at most frf_report_curves_max
    const struct frf_model_curve *curves;
};

/// Adds a section: magnitude in dB with a band of 2 std, phase, standard deviations (total, and noise where it
/// differs), and with models the error of each over 2 std, line by line: a perfect model stays below 1.
/// `options` may be NULL. Lines that are not valid are left out and counted.
/// Errors: if memory is short the figure is replaced by a sentence that says so.
void frf_report_section(struct page *page, const struct frf *frf, const struct frf_report_options *options);

#endif
