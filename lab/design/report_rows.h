/* SPDX-License-Identifier: MIT */
/// The four quantities of a design as its pages show them. Internal to lab/design/report*.
#ifndef SERVOSCOPE_DESIGN_REPORT_ROWS_H
#define SERVOSCOPE_DESIGN_REPORT_ROWS_H

#include "lab/design/design.h"

#include <stddef.h>

enum { report_torque, report_velocity, report_position, report_acceleration, report_rows };

/// One quantity of the design in every form that the report needs.
struct report_row {
    const char *name, *unit;
    const double *series;
    double limit; ///< 0: none
    double peak, peak_continuous;
    double used; ///< share of the limit where the design has to hold it; 0 without a limit
};

/// A limit of which this share is used holds the design back.
#define REPORT_NEARLY_ALL 0.995

void report_rows_make(const struct design_request *request, const struct design_result *result,
                      struct report_row out_rows[report_rows]);

/// Amplitudes of all lines. Shapes: result->bin_count values each
void report_rows_amplitudes(const struct design_request *request, const struct design_result *result,
                            double *out_frequency_hz, double *out_torque_Nm, double *out_velocity_rad_per_s);

#endif
