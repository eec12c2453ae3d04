/* SPDX-License-Identifier: MIT */
/// A response and its models as the figures of its report want them: decibels, unwrapped phases, regions, distances.
/// Internal to lab/estimate/report*.
#ifndef SERVOSCOPE_ESTIMATE_REPORT_LINES_H
#define SERVOSCOPE_ESTIMATE_REPORT_LINES_H

#include "lab/estimate/difference.h"
#include "lab/estimate/report.h"
#include "lab/estimate/smoothness.h"

#include <stdbool.h>
#include <stddef.h>

/// The valid lines of a response; NaN where a figure has a gap.
struct report_lines {
    size_t count;
    double *frequency_hz, *magnitude_db, *low_db, *high_db;
    double *phase_deg, *phase_low_deg, *phase_high_deg;
    double *std_db, *noise_db, *coherence;
    bool noise_differs; ///< from the total standard deviation, somewhere
    bool has_std, has_coherence;
};

/// A model's curve, and its distance from the measured lines.
struct report_curve {
    double *magnitude_db, *low_db, *high_db, *phase_deg;
    double *over_two_std; ///< of each valid line; NaN where the model has no value
    size_t compared, beyond;
};

/// A run, or another response, beside the one that the section is about.
struct report_overlay {
    const struct frf *frf;
    const char *name;
    bool is_model; ///< of method parametric
    struct report_lines lines;
    double *over_two_std; ///< of each valid line: distance from the first over 2 std of the difference
    struct difference difference;
};

struct report_drawing {
    double *memory;
    double factor;        ///< of std, what the regions shown reach to
    bool factor_is_95;    ///< it is the response's own confidence_95_factor; else 2
    bool is_model;        ///< the response itself is a model's (method parametric): no measured lines
    double *at_lines;     ///< lines.count + invalid ones: scratch
    double *over_two_std; ///< of each valid line against its neighbours, where there is no model
    struct smoothness smoothness;
    struct report_lines lines;
    size_t overlay_count;
    size_t runs_drawn; ///< the first so many overlays are runs of the response
    struct report_overlay overlays[frf_report_overlays_max];
    const char *first;    ///< the name of what the overlays are compared with
    double known_delay_s; ///< taken out of the response's phases
    struct report_curve curves[frf_report_curves_max];
};

enum { report_units_size = 56 };

/// One unit of "rad_per_s/Nm" as a person writes it: "1 (rad/s)/Nm"; of "", which is not known, "1".
void report_units(const char *units, char out_text[report_units_size]);

/// Errors: false if memory is short; report_drawing_free() in every case
bool report_drawing_make(const struct frf *frf, const struct frf_report_options *options, struct report_drawing *out);

void report_drawing_free(struct report_drawing *self);

#endif
