/* SPDX-License-Identifier: MIT */
/// What a person wants to see of a frequency response: Bode diagram with its uncertainty, and what a model gets wrong.
#ifndef SERVOSCOPE_ESTIMATE_REPORT_H
#define SERVOSCOPE_ESTIMATE_REPORT_H

#include "lab/page/page.h"
#include "lab/record/frf_file.h"

#include <stdbool.h>
#include <stddef.h>

enum {
    frf_report_curves_max = 4,
    frf_report_overlays_max = 7, ///< beside the response itself: as many shapes as can be told apart
};

/// A model's response at any frequencies, ascending; it is held against the measured lines at equal frequencies.
struct frf_model_curve {
    const char *name;
    size_t count;
    const double *frequency_hz;
    const double *real;
    const double *imag;
    const double *std; ///< its own standard deviation; NULL: not known
    bool at_lines;     ///< simulated at the measured lines: nothing is known in between, so that no line joins them
};

struct frf_report_options {
    const char *name;         ///< of the response, where others are drawn beside it: its file; NULL: "measured"
    double known_delay_s;     ///< taken out of every phase shown; 0: frf_report_known_delay_s() of each response
    const char *delay_reason; ///< what it comes from, for the caption; NULL: not said
    size_t curve_count;       ///< at most frf_report_curves_max
    const struct frf_model_curve *curves;
    size_t run_count;       ///< realisations whose mean the response is; more than frf_report_overlays_max: not drawn
    const struct frf *runs; ///< their responses, the same lines
    const char *const *run_names;
    size_t other_count;       ///< responses that are no part of this one, to be compared with it; too many: not drawn
    const struct frf *others; ///< lines of their own; the same units
    const char *const *other_names;
};

/// Half a sample where the input is held between samples and the delay is still in the response (keys `hold`,
/// `sample_rate_hz`, `delay_removed_s`); else 0.
double frf_report_known_delay_s(const struct frf *frf);

/// Adds a section: magnitude in dB with its 95 % regions, phase, standard deviations (total, and noise where it
/// differs), coherence where a method gives it, and how far each line is from what it should be, over 2 std: from the
/// models, else from its neighbours (lab/estimate/smoothness.h). A perfect model stays below 1.
/// Measured lines are points that nothing joins. Runs and other responses are overlaid, each in its own shape, with
/// a panel of how far they are from the first, over 2 std of the difference. A response that is itself a model's
/// (method `parametric`) is drawn as a line and called one.
/// `options` may be NULL. Lines that are not valid are left out and counted.
/// Errors: if memory is short the figure is replaced by a sentence that says so.
/// Test:   tests/unit/test_frf_report.c
void frf_report_section(struct page *page, const struct frf *frf, const struct frf_report_options *options);

#endif
