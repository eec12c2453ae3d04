/* SPDX-License-Identifier: MIT */
#include "lab/numeric/statistics.h"
#include "lab/tune/solution.h"

#include <math.h>
#include <stdlib.h>

enum { draw_seed = 1 };

/// Sums for the standard deviation of one number, around the value of the measured response.
struct scatter {
    double centre, sum, square;
    size_t count;
};

static void scatter_add(struct scatter *self, double value)
{
    if (isfinite(value) && isfinite(self->centre)) {
        self->sum += value - self->centre;
        self->square += (value - self->centre) * (value - self->centre);
        self->count++;
    }
}

/// NaN with fewer than half of the draws: what is there only sometimes has no standard deviation.
static double scatter_std(const struct scatter *self)
{
    const double n = (double)self->count;
    if (self->count < tune_draws / 2) {
        return NAN;
    }
    return sqrt(fmax(self->square - self->sum * self->sum / n, 0.0) / (n - 1.0));
}

enum { margins_numbers = 12 };

static void margins_list(struct margins *margins, double *out_list[margins_numbers])
{
    double *const all[margins_numbers] = {
        &margins->gain_db,    &margins->gain_hz,      &margins->gain_reduction_db, &margins->gain_reduction_hz,
        &margins->phase_deg,  &margins->phase_hz,     &margins->delay_s,           &margins->modulus,
        &margins->modulus_hz, &margins->crossover_hz, &margins->cutoff_hz,         &margins->last_cutoff_hz,
    };
    for (size_t i = 0; i < margins_numbers; i++) {
        out_list[i] = all[i];
    }
}

struct draws {
    struct random random;
    struct tune_problem problem;
    double complex *response, *loop;
    struct scatter gain[tune_gains_max], margin[margins_numbers];
};

static void draw_response(const struct tune_plant *plant, struct draws *io)
{
    for (size_t k = 0; k < plant->count; k++) {
        const double size = plant->std[k] * sqrt(0.5); // of each component
        const double real = size * random_normal(&io->random);
        const double imag = size * random_normal(&io->random);
        io->response[k] = plant->response[k] + real + imag * I;
    }
}

/// The gains that this response would have given.
static void take_gains(const struct tune_solution *solution, struct draws *io)
{
    double gain[tune_gains_max] = {0.0};
    bool fitted = tune_fit_linear(&io->problem, io->response, gain);
    if (fitted && solution->reweighted) {
        fitted = tune_fit_reweighted(&io->problem, io->response, gain);
    }
    for (size_t i = 0; i < io->problem.gains && fitted; i++) {
        scatter_add(&io->gain[i], gain[i]);
    }
}

/// What the given gains do on this response.
static void take_margins(const struct tune_plant *plant, const struct tune_solution *solution, struct draws *io,
                         struct tune_deviation *io_deviation)
{
    struct margins margins;
    struct nyquist nyquist;
    double *numbers[margins_numbers];
    solution_loop(plant, &solution->controller, io->response, io->loop);
    nyquist_judge(plant, io->response, io->loop, &solution->controller, false, &nyquist);
    io_deviation->stable += nyquist.verdict == nyquist_stable;
    margins_find(plant->count, plant->frequency_hz, io->loop, &margins);
    margins_list(&margins, numbers);
    for (size_t i = 0; i < margins_numbers; i++) {
        scatter_add(&io->margin[i], *numbers[i]);
    }
}

static void set_centres(const struct tune_plant *plant, const struct tune_solution *solution, struct draws *io)
{
    struct margins margins;
    double *numbers[margins_numbers];
    solution_loop(plant, &solution->controller, plant->response, io->loop);
    margins_find(plant->count, plant->frequency_hz, io->loop, &margins);
    margins_list(&margins, numbers);
    for (size_t i = 0; i < margins_numbers; i++) {
        io->margin[i].centre = *numbers[i];
    }
    for (size_t i = 0; i < tune_gains_max; i++) {
        io->gain[i].centre = solution->controller.gain[i];
    }
}

bool solution_deviation(const struct tune_plant *plant, const struct tune_solution *solution,
                        enum tune_weighting weighting, struct tune_deviation *out_deviation)
{
    *out_deviation = (struct tune_deviation){.known = plant->std_known};
    if (!plant->std_known) {
        return true;
    }
    struct draws draws = {.response = malloc(plant->count * sizeof(double complex)),
                          .loop = malloc(plant->count * sizeof(double complex))};
    const bool ready = draws.response && draws.loop &&
                       tune_problem_init(&draws.problem, plant, &solution->controller, &solution->reference, weighting);
    if (ready) {
        double *numbers[margins_numbers];
        random_seed(&draws.random, draw_seed);
        set_centres(plant, solution, &draws);
        for (int draw = 0; draw < tune_draws; draw++) {
            draw_response(plant, &draws);
            take_gains(solution, &draws);
            take_margins(plant, solution, &draws, out_deviation);
        }
        margins_list(&out_deviation->margins, numbers);
        for (size_t i = 0; i < margins_numbers; i++) {
            *numbers[i] = scatter_std(&draws.margin[i]);
        }
        for (size_t i = 0; i < tune_gains_max; i++) {
            out_deviation->gain[i] = scatter_std(&draws.gain[i]);
        }
    }
    tune_problem_free(&draws.problem);
    free(draws.response);
    free(draws.loop);
    return ready;
}
