/* SPDX-License-Identifier: MIT */
#include "lab/tune/solution.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Damping of the filter's poles where nobody says it: wide enough to bear a resonance that moves by a few percent. A
/// biquad's are narrower, because the drive's antiresonance is to be filled up by them; as narrow as that itself, they
/// would leave the load's vibration undamped and hide it from the motor.
static const double notch_pole_damping = 0.3, biquad_pole_damping = 0.1;
static const double corner_share_most = 0.45;

/// Completes the filter from what was asked for and what was found.
static int make_filter(const struct tune_plant *plant, const struct resonance *resonance,
                       const struct tune_structure *structure, const struct tune_options *options,
                       struct tune_filter *out_filter, struct error *out_error)
{
    *out_filter = options->filter;
    if (structure->filter == tune_filter_none) {
        *out_filter = (struct tune_filter){.on = false};
        return 0;
    }
    if (!(out_filter->zero_hz > 0.0)) {
        if (!resonance->found) {
            return error_set(out_error, error_refused,
                             "no line stands out by 3 dB, so there is no resonance for the filter: expected --notch "
                             "HZ:DAMPING, or --controller pi");
        }
        out_filter->zero_hz = resonance->frequency_hz;
        out_filter->zero_damping = resonance->damping;
    }
    if (!(out_filter->pole_hz > 0.0)) {
        const bool moves = structure->filter == tune_filter_biquad && resonance->has_antiresonance;
        out_filter->pole_hz = moves ? resonance->antiresonance_hz : out_filter->zero_hz;
        out_filter->pole_damping = moves ? biquad_pole_damping : notch_pole_damping;
    }
    if (!tune_filter_make(out_filter, plant->rate_hz)) {
        return error_set(out_error, error_usage,
                         "the filter's zeros at %.6g Hz, damping %.4g, and poles at %.6g Hz, damping %.4g: expected "
                         "frequencies below %.6g Hz, half the rate",
                         out_filter->zero_hz, out_filter->zero_damping, out_filter->pole_hz, out_filter->pole_damping,
                         0.5 * plant->rate_hz);
    }
    return 0;
}

static int set_up(const struct tune_plant *plant, const struct resonance *resonance,
                  const struct tune_structure *structure, const struct tune_options *options,
                  struct tune_solution *out_solution, struct error *out_error)
{
    const double corner_most_hz = corner_share_most * plant->rate_hz;
    *out_solution = (struct tune_solution){
        .controller = {.structure = structure, .rate_hz = plant->rate_hz},
        .reference = {.bandwidth_hz = options->bandwidth_hz,
                      .damping = options->damping,
                      .delay_samples = options->delay_samples,
                      .rate_hz = plant->rate_hz},
    };
    struct tune_controller *controller = &out_solution->controller;
    if (structure->corner_ratio > 0.0) {
        controller->corner_hz = options->corner_hz > 0.0
                                    ? options->corner_hz
                                    : fmin(structure->corner_ratio * options->bandwidth_hz, corner_most_hz);
        if (!(controller->corner_hz <= corner_most_hz)) {
            return error_set(out_error, error_usage, "--corner: %.6g Hz, expected at most %.6g Hz (.45 of the rate)",
                             controller->corner_hz, corner_most_hz);
        }
    } else if (options->corner_hz > 0.0) {
        return error_set(out_error, error_usage, "--corner: %.6g Hz, but %s has no derivative: expected no --corner",
                         options->corner_hz, structure->name);
    }
    return make_filter(plant, resonance, structure, options, &controller->filter, out_error);
}

void solution_loop(const struct tune_plant *plant, const struct tune_controller *controller,
                   const double complex *response, double complex *out_loop)
{
    for (size_t k = 0; k < plant->count; k++) {
        out_loop[k] = tune_controller_at(controller, plant->delay[k]) * response[k];
    }
}

static void judge(const struct tune_plant *plant, const struct tune_controller *controller, double complex *work,
                  struct nyquist *out_nyquist)
{
    solution_loop(plant, controller, plant->response, work);
    nyquist_judge(plant, plant->response, work, controller, true, out_nyquist);
}

/// The better one of the two fits, by stability first and cost second.
static bool choose(const struct tune_plant *plant, struct tune_problem *problem, double complex *work,
                   struct tune_solution *io_solution)
{
    struct tune_controller linear = io_solution->controller, *best = &io_solution->controller;
    if (!tune_fit_linear(problem, plant->response, linear.gain)) {
        return false;
    }
    memcpy(best->gain, linear.gain, sizeof best->gain);
    if (!tune_fit_reweighted(problem, plant->response, best->gain)) {
        return false;
    }
    io_solution->reweighted = true;
    io_solution->cost_linear = tune_fit_cost(problem, plant->response, linear.gain);
    io_solution->cost = tune_fit_cost(problem, plant->response, best->gain);
    judge(plant, best, work, &io_solution->nyquist);
    if (io_solution->nyquist.verdict == nyquist_stable && io_solution->cost <= io_solution->cost_linear) {
        return true;
    }
    struct nyquist nyquist;
    judge(plant, &linear, work, &nyquist);
    if (nyquist.verdict == nyquist_stable) {
        *best = linear;
        io_solution->nyquist = nyquist;
        io_solution->cost = io_solution->cost_linear;
        io_solution->reweighted = false;
    }
    return true;
}

int solution_find(const struct tune_plant *plant, const struct resonance *resonance,
                  const struct tune_structure *structure, const struct tune_options *options,
                  struct tune_solution *out_solution, struct error *out_error)
{
    struct tune_problem problem;
    int status = set_up(plant, resonance, structure, options, out_solution, out_error);
    if (status) {
        return status;
    }
    double complex *work = malloc(plant->count * sizeof *work);
    if (!work ||
        !tune_problem_init(&problem, plant, &out_solution->controller, &out_solution->reference, options->weighting)) {
        free(work);
        return error_set(out_error, error_refused, "memory is short");
    }
    if (!choose(plant, &problem, work, out_solution)) {
        status = error_set(out_error, error_refused,
                           "the gains of controller %s cannot be told apart on these lines: expected lines around and "
                           "below %.6g Hz",
                           structure->name, options->bandwidth_hz);
    }
    tune_problem_free(&problem);
    free(work);
    return status;
}
