/* SPDX-License-Identifier: MIT */
/// The default: projections, which find a good valley in few transforms, then a descent on rising p-norms, which finds
/// its bottom; from several starts. How many, and how long each, follows from the size of the problem, so that the
/// work stays bounded.
#include "lab/design/method.h"
#include "lab/design/starts.h"

#include <math.h>

enum {
    iterations_per_variable = 3,
    iterations_min = 300,
    iterations_max = 3000,
    longer_with_time = 2,   ///< times the iterations if there is a time budget: fewer starts, better ones
    newton_lines_max = 450, ///< above, the cube of the variables costs more than it gains
    newton_variables_max = 800,
    descent_evaluations = 30, ///< about, of Newton's method, a factorisation counted as transforms
    descent_iterations = 60,  ///< of L-BFGS for each p
    descent_norms = 8,
    starts_max = 48,
    relaxations = 4,
    finalists = 3,
    finalists_with_time = 8,
    smallest_polishable = 8,
    coarse_sixths = 38, ///< points per highest line of the projections, times 6
    fine_points = 80,
    descent_points = 40,
};

/// In units of transform_work(), 0.2 to 0.4 ns each: the first is what the projections of one start may take, the
/// second all starts of the default.
static const double start_work_max = 4e9;
static const double work_max = 2.2e9;
static const double far_less = 8; ///< as a ratio

/// Lines from which on more starts no longer find much: their spread falls with the number of lines.
static const double one_start_lines = 1415;

/// Of one complex transform: length times the sum of its prime factors, which is what a mixed-radix transform costs.
static double transform_work(size_t length)
{
    double factors = 0;
    size_t rest = length;
    for (size_t prime = 2; prime * prime <= rest; prime++) {
        for (; rest % prime == 0; rest /= prime) {
            factors += (double)prime;
        }
    }
    return (double)length * (factors + (rest > 1 ? (double)rest : 0));
}

/// A grid with so many points per highest line; never finer than the samples where only these count, unless their
/// number has so large a prime factor that twice as many points cost far less.
static size_t grid_of(const struct design_request *request, double points_per_line)
{
    const size_t samples = request->period_samples;
    const double highest = (double)request->bins[request->bin_count - 1];
    const size_t grid = design_waveform_smooth_length((size_t)ceil(points_per_line * highest));
    if (request->grid == design_grid_continuous || grid < samples) {
        return grid;
    }
    const size_t twice = design_waveform_smooth_length(2 * samples);
    return transform_work(samples) > far_less * transform_work(twice) ? twice : samples;
}

static double clamped(double value, double least, double most)
{
    return fmax(least, fmin(value, most));
}

static void plan_lengths(const struct design_request *request, double coarse_work, double grid_work,
                         struct design_starts_plan *plan)
{
    const double lines = (double)request->bin_count;
    const double variables = request->amplitude_tolerance_db > 0 ? 2 * lines : lines;
    double iterations = clamped(iterations_per_variable * variables, iterations_min, iterations_max);
    double further = request->time_budget_s > 0 ? longer_with_time * iterations : iterations;
    const double most = fmax(iterations_min / 2.0, start_work_max / coarse_work);
    plan->iterations = request->iterations > 0 ? request->iterations : (size_t)fmin(iterations, most);
    plan->further_iterations = request->iterations > 0 ? request->iterations : (size_t)fmin(further, most);
    if (lines > newton_lines_max || variables > newton_variables_max) {
        plan->descent_iterations =
            (size_t)clamped(work_max / (descent_norms * grid_work), smallest_polishable, descent_iterations);
    }
    size_t descent = plan->descent_iterations > 0 ? descent_norms * plan->descent_iterations : descent_evaluations;
    plan->evaluations_per_start = plan->further_iterations + descent;
}

static size_t plan_starts(const struct design_request *request, double coarse_work, double grid_work,
                          const struct design_starts_plan *plan)
{
    if (request->starts > 0) {
        return request->starts;
    }
    if (request->time_budget_s > 0) {
        return SIZE_MAX;
    }
    const double variables = (request->amplitude_tolerance_db > 0 ? 2 : 1) * (double)request->bin_count;
    const double factorisations = plan->descent_iterations > 0 ? 0 : pow(variables, 3) / 2;
    const double work = (double)plan->iterations * coarse_work +
                        (double)(plan->evaluations_per_start - plan->further_iterations) * grid_work + factorisations;
    const double worthwhile = pow(one_start_lines / (double)request->bin_count, 2);
    return (size_t)clamped(fmin(work_max / work, worthwhile), 1, starts_max);
}

static int run(const struct design_request *request, struct design_search *search, struct error *out_error)
{
    struct design_starts_plan plan = {
        .coarse_grid = grid_of(request, coarse_sixths / 6.0),
        .grid = grid_of(request, descent_points),
        .fine_grid = grid_of(request, fine_points),
    };
    // Two signals share a transform, and there is one each way.
    const double transforms = (double)search->waveform.signal_count;
    const double coarse_work = transforms * transform_work(plan.coarse_grid);
    const double grid_work = transforms * transform_work(plan.grid);
    plan_lengths(request, coarse_work, grid_work, &plan);
    plan.starts = plan_starts(request, coarse_work, grid_work, &plan);
    plan.finalists = request->time_budget_s > 0 ? finalists_with_time : finalists;
    plan.relaxations = plan.starts > 1 ? relaxations : 0; // a single start is for those in a hurry
    if (plan.descent_iterations > 0 && plan.fine_grid == plan.grid) {
        plan.fine_grid = 0;
    }
    return design_starts_run(request, &plan, search) ? 0 : design_method_out_of_memory(out_error);
}

const struct design_method design_method_fast = {
    .name = "fast",
    .summary = "projections, then p-norm descent, from several starts; more --starts find a little more",
    .iterations = 0,
    .run = run,
};
