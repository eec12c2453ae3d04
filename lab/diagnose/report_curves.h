/* SPDX-License-Identifier: MIT */
/// The curves of a diagnosis as the report's figures need them. Internal to lab/diagnose.
#ifndef SERVOSCOPE_DIAGNOSE_REPORT_CURVES_H
#define SERVOSCOPE_DIAGNOSE_REPORT_CURVES_H

#include "lab/diagnose/diagnosis.h"

enum { report_bands_max = 240, report_points_max = 1500 };

/// Errors of three models in units of two standard deviations of the noise, RMS over bands of neighbouring bins.
struct report_bands {
    bool logarithmic; ///< the frequencies span so much that a logarithmic axis suits
    size_t count;
    size_t widest; ///< bins in the widest band, 1: nothing was put together
    double frequency_hz[report_bands_max];
    double nominal[report_bands_max], refitted[report_bands_max], extended[report_bands_max];
};

void report_bands_find(const struct diagnosis_curves *curves, struct report_bands *out_bands);

/// How many bins of a model's error lie above two standard deviations, and the worst of them.
struct report_excess {
    size_t bins; ///< with a usable standard deviation
    size_t above;
    double worst; ///< in units of two standard deviations
    double worst_hz;
};

struct report_excess report_excess_find(const struct diagnosis_curves *curves, const double *error_Nm);

/// RMS of the finite values; NaN if there are none.
double report_rms(const double *values, size_t count);

/// First sample of the `width` samples where the nominal residual has the most energy.
size_t report_worst_stretch(const struct diagnosis_curves *curves, size_t width);

/// Friction torque against speed, one sample of every few, so that both speed and time are covered evenly.
struct report_friction {
    size_t count;
    double velocity[report_points_max], torque[report_points_max];
    double spread; ///< RMS of the measured points about the extended model's curve, standstill apart; NaN without one
};

void report_friction_find(const struct diagnosis_curves *curves, struct report_friction *out_friction);

#endif
