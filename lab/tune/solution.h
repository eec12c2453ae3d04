/* SPDX-License-Identifier: MIT */
/// The steps of tune_run() that are also tried out at other bandwidths and on other responses.
#ifndef SERVOSCOPE_TUNE_SOLUTION_H
#define SERVOSCOPE_TUNE_SOLUTION_H

#include "lab/tune/tune.h"

/// Sets up controller and reference and finds the gains: those of the reweighted fit if they are stable and miss the
/// reference by less, else those of the linear fit if they are stable, else the reweighted ones with their verdict.
/// Errors: error_usage for a filter or corner at half the rate and beyond; error_refused where memory is short, terms
///         depend on each other, or the structure needs a resonance that is not there
int solution_find(const struct tune_plant *plant, const struct resonance *resonance,
                  const struct tune_structure *structure, const struct tune_options *options,
                  struct tune_solution *out_solution, struct error *out_error);

/// Fills in the open loop K G of a response on the plant's lines.
void solution_loop(const struct tune_plant *plant, const struct tune_controller *controller,
                   const double complex *response, double complex *out_loop);

/// Draws tune_draws responses, G plus circular normal noise of the file's standard deviation, and fills in how gains
/// and margins scatter. Same response, same numbers: the seed is fixed.
/// Errors: false if memory is short
bool solution_deviation(const struct tune_plant *plant, const struct tune_solution *solution,
                        enum tune_weighting weighting, struct tune_deviation *out_deviation);

#endif
