/* SPDX-License-Identifier: MIT */
/// What the command line of `servoscope design` says, and the request that it makes of it.
#ifndef SERVOSCOPE_TOOLS_DESIGN_OPTIONS_H
#define SERVOSCOPE_TOOLS_DESIGN_OPTIONS_H

#include "lab/design/design.h"
#include "lab/design/offset.h"
#include "lab/record/error.h"

/// The options, before they are understood. Numbers that were not given are 0, texts NULL but where a default is said.
struct design_options {
    const char *rate;
    long long period_samples;
    const char *lines;
    const char *out;
    const char *report;
    const char *dft_header; ///< kinds, as dft_header_parse() reads them
    const char *method;     ///< NULL: the designer's own choice
    const char *keep;
    const char *grid;      ///< "continuous"
    const char *start;     ///< "paper"
    const char *mode;      ///< "cascade"
    const char *amplitude; ///< "constraint"
    double amplitude_tolerance_db;
    long long iterations;
    long long starts;
    double time_budget_s;
    long long threads;
    long long seed; ///< 1
    struct design_limits rotary;
    double inertia_kgm2;
    double position_limit_m;
    double velocity_limit_m_per_s;
    double acceleration_limit_m_per_s2;
    double force_limit_N;
    double mass_kg;
    double pulley_radius_m;
    double minimum_effective; ///< Nm, or N of a linear axis
    const char *stroke;       ///< RAD:PERIODS
    const char *stroke_m;     ///< M:PERIODS
    double bias_velocity_rad_per_s;
    double bias_velocity_m_per_s;
    long long inputs;     ///< 1
    long long periods;    ///< 10; counted ones, for test time, travel and prediction
    double settle_time_s; ///< NAN: one period
    const char *predict;  ///< a model file
    const char *separate; ///< CAUSE,CAUSE
    const char *model;    ///< with separate: the drive as it is known, a model file
    double nats;          ///< 20; with separate: how far apart is enough
};

/// Reads the command line; defaults are set first.
/// Errors: error_usage with option, value and expectation
int design_options_read(int argc, char **argv, struct design_options *out_options, struct error *out_error);

/// Fills in everything of a request but its lines, amplitudes and start model. Texts are borrowed from argv.
/// Errors: error_usage with option, value and expectation
int design_options_resolve(const struct design_options *options, struct design_request *out_request,
                           struct error *out_error);

/// Fills in the travel that is added to the multisine, but for how long it is played.
/// Errors: error_usage with option, value and expectation
int design_options_offset(const struct design_options *options, const struct design_request *request,
                          struct design_offset *out_offset, struct error *out_error);

#endif
