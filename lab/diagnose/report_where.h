/* SPDX-License-Identifier: MIT */
/// Where in speed, place and time two models' errors lie, for the report.
#ifndef SERVOSCOPE_DIAGNOSE_REPORT_WHERE_H
#define SERVOSCOPE_DIAGNOSE_REPORT_WHERE_H

#include "lab/diagnose/diagnosis.h"

enum { report_shares_max = 10, report_places = 40 };

/// One part of the recording: how much of it that is, and how much of each model's squared error lies there.
struct report_share {
    char what[80];
    double samples, nominal, extended; ///< 0..1
};

/// Fills in both directions of motion, slow and fast, three parts of the travel and three of the time; returns how
/// many. Parts without samples are left out.
size_t report_shares_find(const struct diagnosis_curves *curves, bool linear,
                          struct report_share out_shares[report_shares_max]);

/// RMS of both models' errors over equal parts of the travel; NaN where nothing was.
struct report_places {
    double position[report_places], nominal[report_places], extended[report_places];
};

/// Errors: false if nothing moved.
bool report_places_find(const struct diagnosis_curves *curves, struct report_places *out_places);

#endif
