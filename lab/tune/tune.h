/* SPDX-License-Identifier: MIT */
/// A controller from a measured frequency response: the gains by model reference control, stability judged on the
/// measured lines before anything is given out, margins, and how sure all of it is.
#ifndef SERVOSCOPE_TUNE_TUNE_H
#define SERVOSCOPE_TUNE_TUNE_H

#include "lab/record/error.h"
#include "lab/record/frf_file.h"
#include "lab/tune/controller.h"
#include "lab/tune/fit.h"
#include "lab/tune/margins.h"
#include "lab/tune/nyquist.h"
#include "lab/tune/plant.h"
#include "lab/tune/reference.h"
#include "lab/tune/resonance.h"

enum { tune_warnings_max = 16, tune_warning_size = 560, tune_draws = 100 };

struct tune_options {
    const char *structure; ///< name in tune_structures
    double bandwidth_hz;   ///< of the reference model
    double damping;        ///< of the reference model
    double delay_samples;  ///< of the reference model
    double rate_hz;        ///< 0: as the file says
    double loop_delay_s;   ///< delay of the loop that the response does not contain
    double corner_hz;      ///< of the derivative; 0: the structure's ratio times the bandwidth
    enum tune_weighting weighting;
    struct tune_filter filter; ///< zero_hz 0: from the response; pole_hz 0: from the response, or as zero_hz
};

/// What a structure, a reference and a response give.
struct tune_solution {
    struct tune_controller controller;
    struct tune_reference reference;
    bool reweighted;    ///< the gains are those of the reweighted fit, not of the linear one
    double cost;        ///< J_mr of these gains
    double cost_linear; ///< J_mr of the linear fit
    struct nyquist nyquist;
};

/// Standard deviations that follow from the response's: from draws of other responses that might as well have been
/// measured. Gains: those that would have come out. Margins: those of the given gains.
struct tune_deviation {
    bool known; ///< the file has standard deviations
    double gain[tune_gains_max];
    struct margins margins;
    size_t stable; ///< of tune_draws draws, how many the given gains hold stable
};

struct tune_result {
    struct tune_plant plant;
    struct resonance resonance;
    enum tune_weighting weighting;
    struct tune_solution solution;
    struct margins margins;
    struct tune_deviation deviation;
    double complex *loop;      ///< K G on the plant's lines
    double complex *reference; ///< M there
    double doubt_at_crossover; ///< the plant's doubt over its response there; 0: none
    size_t file_warning_count; ///< the first ones: what the response's file itself warns of
    size_t warning_count;
    char warnings[tune_warnings_max][tune_warning_size];
};

/// Defaults: pi, damping .9, one sample of delay, log-frequency weighting; the bandwidth is the caller's.
void tune_options_default(struct tune_options *out_options);

/// Tunes. `path` begins messages.
/// Errors: error_usage: a name or number that cannot be; error_refused: the response cannot be used, is biased by its
///         own file's word, has no resonance for a notch, the loop would be unstable or cannot be judged, with figures
///         and what to try. *out_result is empty then.
/// Test:   tests/unit/test_tune.c, tests/golden/test_tune_reference.c
int tune_run(const char *path, const struct frf *frf, const struct tune_options *options,
             struct tune_result *out_result, struct error *out_error);

/// Frees what tune_run() gave; harmless on a zeroed struct.
void tune_result_free(struct tune_result *self);

#endif
