/* SPDX-License-Identifier: MIT */
/// Many starts of one search, on as many threads as there are processors. Each start is projections on a coarse grid,
/// then a descent on the real one; the best few are finished with a still larger p on a still finer grid.
/// A start depends on the seed and its number alone and ties go to the lower number, so that the result does not depend
/// on the number of threads.
#ifndef SERVOSCOPE_DESIGN_STARTS_H
#define SERVOSCOPE_DESIGN_STARTS_H

#include "lab/design/search.h"

enum { design_starts_finalists_max = 8 };

struct design_starts_plan {
    size_t coarse_grid;           ///< points per period of the projections
    size_t grid;                  ///< of the descent
    size_t fine_grid;             ///< of the finish; 0: none
    size_t iterations;            ///< of the projections of start 0
    size_t further_iterations;    ///< of the other starts
    size_t descent_iterations;    ///< of L-BFGS for each p; 0: Newton's method instead
    size_t finalists;             ///< so many of the best starts are finished, 1 .. design_starts_finalists_max
    size_t relaxations;           ///< descents of the finish that begin at a small p once more
    size_t starts;                ///< at most so many, at least 1; SIZE_MAX: until the time budget is used up
    size_t evaluations_per_start; ///< about, for the progress
};

/// Runs the plan, and leaves the best phases in search->best and in search->watch how many starts went to their end.
/// Start 0 begins with Newman's phases and is never cut short by the time budget; the others begin with Newman's,
/// disturbed.
/// Returns false if memory is short.
bool design_starts_run(const struct design_request *request, const struct design_starts_plan *plan,
                       struct design_search *search);

#endif
