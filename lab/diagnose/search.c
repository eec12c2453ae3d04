/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/search.h"

#include "lab/numeric/least_squares.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { scan_iterations = 2, refine_iterations = 8, refined_candidates = 3 };

double search_threshold(const struct fit_data *data, int effect)
{
    const double floor_nats = 12.0;
    double parameters = (double)sim_effects[effect]->parameter_count;
    size_t values = data->values + (sim_effects[effect]->in_time ? data->contrasts : 0);
    return floor_nats + 0.5 * parameters * log((double)values);
}

struct candidate {
    int effect;
    double cost;
    struct hypothesis hypothesis;
};

/// The torque that an effect at `values` would have added over the recorded motion, whitened: what the residual would
/// look like, to first order, without running the simulation. `columns` of them: sine and cosine of an effect with a
/// phase.
static size_t quick_columns(const struct fit_data *data, int effect, const double *values, double *signal, double *out)
{
    const struct sim_effect *e = sim_effects[effect];
    double p[sim_effect_parameters_max];
    memcpy(p, values, sizeof p);
    size_t columns = e->parameter_count > 1 && e->parameters[1].kind == sim_parameter_phase ? 2 : 1;
    for (size_t column = 0; column < columns; column++) {
        double *whitened = out + column * data->values;
        p[1] = columns == 2 ? 1.5707963267948966 * (double)column : values[1];
        for (size_t i = 0; i < data->runs; i++) {
            const struct recording *r = data->evidence[i].recording;
            for (size_t n = 0; n < r->block.samples; n++) {
                size_t next = n + 1 < r->block.samples ? n + 1 : n;
                struct sim_motion at = {.position = 0.5 * (r->block.position[n] + r->block.position[next]),
                                        .velocity = 0.5 * (r->block.velocity[n] + r->block.velocity[next]),
                                        .time_s = r->block.start_s + (double)n / r->rate_hz,
                                        .linear = r->linear};
                struct sim_opposing o = {.positive_factor = 1.0, .negative_factor = 1.0};
                e->oppose(p, &at, &o);
                signal[n] = o.smooth + (at.velocity > 0.0 ? o.dry : -o.dry);
            }
            evidence_whiten(&data->evidence[i], signal, NULL, whitened);
            whitened += data->evidence[i].values;
        }
    }
    return columns;
}

/// Cost that would be left if the effect at `io_values` were added, by linear least squares beside the present
/// coordinates. Its size (and phase) in io_values becomes the best one.
static double quick_cost(const struct fit_data *data, const struct hypothesis *h, const struct fit *fit, int effect,
                         double *io_values, double *work)
{
    size_t rows = data->values, m = h->count;
    double *A = work, *b = A + rows * (m + 2), *signal = b + rows;
    double weight[hypothesis_coordinates_max + 2] = {0}, centre[hypothesis_coordinates_max + 2] = {0};
    double x[hypothesis_coordinates_max + 2];
    fit_linear(fit, data, h, A, weight, centre);
    size_t columns = quick_columns(data, effect, io_values, signal, A + rows * m);
    m += columns;
    for (size_t j = 0; j < rows; j++)
        b[j] = -fit->residual[j];
    if (!least_squares_solve(rows, m, A, b, weight, centre, x, NULL))
        return INFINITY;
    double cost = 0.0;
    for (size_t i = 0; i < m; i++)
        for (size_t j = 0; j < rows; j++)
            b[j] -= A[rows * i + j] * x[i];
    for (size_t j = 0; j < rows; j++)
        cost += b[j] * b[j];
    // The columns are torques on the motor; the residual is in torques on the whole inertia of the given model.
    const struct sim_model *e = &h->engaged;
    double moved = e->motor_inertia_kgm2 + (e->structure == sim_structure_rigid ? e->load_inertia_kgm2 : 0.0);
    double scale = moved / data->evidence[0].scale_inertia;
    if (columns == 2) {
        io_values[1] = atan2(x[m - 1], x[m - 2]);
        io_values[0] *= hypot(x[m - 1], x[m - 2]) * scale;
    } else if (x[m - 1] > 0.0) {
        io_values[0] *= x[m - 1] * scale;
    }
    return cost;
}

enum { scan_kept = 6 };

struct scan_point {
    double cost;
    double values[sim_effect_parameters_max];
};

static int by_point_cost(const void *a, const void *b)
{
    double x = ((const struct scan_point *)a)->cost, y = ((const struct scan_point *)b)->cost;
    return (x > y) - (x < y);
}

static size_t longest_block(const struct fit_data *data)
{
    size_t longest = 0;
    for (size_t i = 0; i < data->runs; i++) {
        size_t samples = data->evidence[i].recording->block.samples;
        longest = samples > longest ? samples : longest;
    }
    return longest;
}

/// The best few of a long scan by quick cost, each the lowest of its neighbourhood: a ripple's cost has a deep valley
/// for every cycle more or less over the travel, and the right one may be narrow.
static size_t choose_valleys(const struct fit_data *data, const struct hypothesis *from, const struct fit *fit,
                             int effect, struct scan_point *points, size_t total,
                             double out_values[][sim_effect_parameters_max])
{
    size_t valleys = 0;
    double *work = malloc((data->values * (from->count + 3) + longest_block(data)) * sizeof *work);
    if (!work)
        return 0;
    for (size_t i = 0; i < total; i++)
        points[i].cost = quick_cost(data, from, fit, effect, points[i].values, work);
    free(work);
    double before = INFINITY;
    for (size_t i = 0; i < total; i++) {
        double here = points[i].cost, after = i + 1 < total ? points[i + 1].cost : INFINITY;
        if (here <= before && here < after)
            points[valleys++] = points[i];
        before = here;
    }
    qsort(points, valleys, sizeof *points, by_point_cost);
    size_t count = valleys < scan_kept ? valleys : scan_kept;
    for (size_t i = 0; i < count; i++)
        memcpy(out_values[i], points[i].values, sizeof points[i].values);
    return count;
}

/// Gives scan values of an effect in time their size and phase: a frequency far from small is no place to step from.
static void size_in_time(const struct fit_data *data, const struct hypothesis *from, const struct fit *fit, int effect,
                         double values[][sim_effect_parameters_max], size_t count)
{
    struct sim_model current;
    hypothesis_model(from, NULL, &current);
    double *work = malloc((data->values * (from->count + 3) + longest_block(data)) * sizeof *work);
    for (size_t i = 0; work && i < count; i++) {
        if (data->contrasts > 0)
            contrast_size_effect(&data->evidence[0], &current, effect, values[i]);
        else if (sim_effects[effect]->oppose)
            quick_cost(data, from, fit, effect, values[i], work);
    }
    free(work);
}

/// Scan values worth a real step: all of a short scan, the best valleys of a long one.
static size_t choose_scan(const struct fit_data *data, const struct sim_coverage *coverage,
                          const struct hypothesis *from, const struct fit *fit, int effect,
                          double out_values[][sim_effect_parameters_max])
{
    struct sim_model current;
    hypothesis_model(from, NULL, &current);
    const struct sim_effect *e = sim_effects[effect];
    double values[sim_effect_parameters_max] = {0};
    size_t total = 0, count = 0;
    if (contrast_is_line(effect) && coverage->tone_count == 0)
        return 0;
    while (e->scan(&current, coverage, total, values)) {
        if (total < sim_effect_scan_max)
            memcpy(out_values[total], values, sizeof values);
        total++;
    }
    if (total <= sim_effect_scan_max || !e->oppose) {
        count = total < sim_effect_scan_max ? total : sim_effect_scan_max;
        if (e->in_time)
            size_in_time(data, from, fit, effect, out_values, count);
        return count;
    }
    struct scan_point *points = calloc(total, sizeof *points);
    if (points) {
        for (size_t i = 0; i < total; i++)
            e->scan(&current, coverage, i, points[i].values);
        count = choose_valleys(data, from, fit, effect, points, total, out_values);
    }
    free(points);
    return count;
}

static int by_cost(const void *a, const void *b)
{
    double x = ((const struct candidate *)a)->cost, y = ((const struct candidate *)b)->cost;
    return (x > y) - (x < y);
}

/// Whether an effect changes what the model is made of, rather than adding to what acts on it.
static bool restructures(int effect, const struct hypothesis *from, const struct hypothesis *trial)
{
    const struct sim_effect *e = sim_effects[effect];
    return trial->engaged.structure != from->engaged.structure || e->attach || e->bend || e->build_up;
}

/// What a step brings does not make up for this: a start so many times worse than the best of its scan, a place so many
/// times worse after its step than the best, a scan whose best place is so many times worse than the model without.
static const double start_too_far = 30.0, place_too_far = 4.0, scan_too_far = 30.0;

/// The scan values with one step each, the lowest cost first; returns how many are worth more.
static size_t step_restructured(struct fit *scratch, const struct fit_data *data, const struct hypothesis *from,
                                const struct fit *fit, int effect, double values[][sim_effect_parameters_max],
                                size_t count, struct candidate *out_list)
{
    size_t stepped = 0;
    double lowest = INFINITY;
    for (size_t i = 0; i < count; i++) {
        out_list[i].hypothesis = *from;
        hypothesis_name(&out_list[i].hypothesis, effect, values[i]);
        out_list[i].cost = fit_cost(scratch, data, &out_list[i].hypothesis, out_list[i].hypothesis.x);
        lowest = fmin(lowest, out_list[i].cost);
    }
    qsort(out_list, count, sizeof *out_list, by_cost);
    while (stepped < count && out_list[stepped].cost <= start_too_far * lowest) {
        struct candidate *place = &out_list[stepped++];
        place->cost = fit_roughly(scratch, data, from, fit, &place->hypothesis, 1) ? scratch->cost : INFINITY;
    }
    qsort(out_list, stepped, sizeof *out_list, by_cost);
    return stepped;
}

/// Where the structure changes, derivatives of the old one are worth little: scan values get one step of their own, the
/// lowest few a short fit.
static void scan_restructured(struct fit *scratch, const struct fit_data *data, const struct hypothesis *from,
                              const struct fit *fit, int effect, double values[][sim_effect_parameters_max],
                              size_t count, struct candidate *out)
{
    enum { tried = 4 };
    struct candidate *list = calloc(count, sizeof *list);
    if (!list)
        return;
    size_t stepped = step_restructured(scratch, data, from, fit, effect, values, count, list);
    if (stepped > 0 && isfinite(list[0].cost)) {
        out->cost = list[0].cost;
        out->hypothesis = list[0].hypothesis;
    }
    bool hopeless = !(out->cost <= scan_too_far * fit->cost);
    for (size_t i = 0; i < tried && i < stepped && !hopeless && list[i].cost <= place_too_far * out->cost; i++)
        if (fit_roughly(scratch, data, from, fit, &list[i].hypothesis, scan_iterations) && scratch->cost < out->cost) {
            out->cost = scratch->cost;
            out->hypothesis = list[i].hypothesis;
        }
    free(list);
}

/// Tries one effect from its scan values with one step each; keeps the best.
static bool scan_effect(struct fit *scratch, const struct fit_data *data, const struct sim_coverage *coverage,
                        const struct hypothesis *from, const struct fit *fit, int effect, struct candidate *out)
{
    double values[sim_effect_scan_max][sim_effect_parameters_max];
    size_t count = choose_scan(data, coverage, from, fit, effect, values);
    out->effect = effect;
    out->cost = INFINITY;
    for (size_t i = 0; i < count; i++) {
        struct hypothesis trial = *from;
        hypothesis_name(&trial, effect, values[i]);
        if (restructures(effect, from, &trial)) {
            scan_restructured(scratch, data, from, fit, effect, values, count, out);
            break;
        }
        if (fit_step(scratch, data, from, fit, &trial) && scratch->cost < out->cost) {
            out->cost = scratch->cost;
            out->hypothesis = trial;
        }
    }
    return isfinite(out->cost);
}

/// Scaled gain in nats of a candidate over the current fit.
static double scaled_gain(const struct fit_data *data, double cost_before, double cost_after)
{
    double misfit = fmax(cost_after / (double)data->values, 1.0);
    return 0.5 * (cost_before - cost_after) / misfit;
}

static bool can_show(const struct hypothesis *h, const struct sim_coverage *coverage, int effect)
{
    char why[160];
    double values[sim_effect_parameters_max], unused[sim_effect_parameters_max];
    hypothesis_parameters(h, effect, NULL, values, unused);
    return !sim_effects[effect]->testable || sim_effects[effect]->testable(values, coverage, why, sizeof why);
}

/// One round of forward selection. Returns whether an effect was added.
static bool add_best(const struct fit_data *data, const struct sim_coverage *coverage, struct hypothesis *io_h,
                     struct fit *fit)
{
    struct candidate *list = calloc(sim_effects_max, sizeof *list);
    struct fit scratch = {0};
    double best = 0.0;
    if (list && fit_init(&scratch, data)) {
        size_t count = 0;
        for (int e = 0; sim_effects[e]; e++)
            if (hypothesis_may_name(io_h, e) && scan_effect(&scratch, data, coverage, io_h, fit, e, &list[count]))
                count++;
        qsort(list, count, sizeof *list, by_cost);
        size_t chosen = count;
        for (size_t i = 0; i < count && i < refined_candidates; i++) {
            fit_roughly(&scratch, data, NULL, NULL, &list[i].hypothesis, refine_iterations);
            double gain = scaled_gain(data, fit->cost, scratch.cost) - search_threshold(data, list[i].effect);
            if (gain > best && can_show(&list[i].hypothesis, coverage, list[i].effect)) {
                best = gain;
                chosen = i;
            }
        }
        if (chosen < count) {
            *io_h = list[chosen].hypothesis;
            fit_run(fit, data, io_h, refine_iterations);
        }
    }
    fit_free(&scratch);
    free(list);
    return best > 0.0;
}

bool search_add(const struct fit_data *data, const struct sim_coverage *coverage, int effect, const struct fit *fit,
                double hoped_cost, struct hypothesis *io_hypothesis, struct fit *out_fit)
{
    struct candidate candidate;
    const double near = 100.0; // a first step that closes neither half of the gap nor comes this close will not make it
    bool found = scan_effect(out_fit, data, coverage, io_hypothesis, fit, effect, &candidate);
    if (!found || candidate.cost > hoped_cost + fmax(0.5 * (fit->cost - hoped_cost), near))
        return false;
    *io_hypothesis = candidate.hypothesis;
    return fit_run(out_fit, data, io_hypothesis, refine_iterations);
}

double search_evidence(const struct fit_data *data, const struct hypothesis *hypothesis, const struct fit *fit,
                       int effect)
{
    struct hypothesis without = *hypothesis;
    struct fit trial;
    if (!fit_init(&trial, data))
        return -INFINITY;
    hypothesis_unname(&without, effect);
    fit_roughly(&trial, data, NULL, NULL, &without, refine_iterations);
    double gain = 0.5 * (trial.cost - fit->cost);
    fit_free(&trial);
    return gain;
}

/// Drops the named effect that is needed least, if it is not needed. Returns whether one was dropped.
static bool drop_weakest(const struct fit_data *data, struct hypothesis *io_h, struct fit *fit)
{
    int weakest = -1;
    double least = 0.0, misfit = fmax(fit->cost / (double)data->values, 1.0);
    for (int e = 0; sim_effects[e]; e++) {
        if (!io_h->named[e])
            continue;
        double margin = search_evidence(data, io_h, fit, e) / misfit - search_threshold(data, e);
        if (margin < least) {
            least = margin;
            weakest = e;
        }
    }
    if (weakest < 0)
        return false;
    hypothesis_unname(io_h, weakest);
    fit_run(fit, data, io_h, refine_iterations);
    return true;
}

static void drop_unneeded(const struct fit_data *data, struct hypothesis *io_h, struct fit *fit)
{
    while (drop_weakest(data, io_h, fit)) {
    }
}

/// Looks for a better place of one named effect: its scan again, now that everything else has found its value. A
/// ripple's first fit, beside wrong numbers, may have settled on a neighbouring frequency.
static void place_again(const struct fit_data *data, const struct sim_coverage *coverage, int effect,
                        struct hypothesis *io_h, struct fit *io_fit)
{
    struct fit base = {0}, scratch = {0};
    struct hypothesis without = *io_h;
    struct candidate candidate;
    hypothesis_unname(&without, effect);
    if (fit_init(&base, data) && fit_init(&scratch, data) && fit_run(&base, data, &without, 0) &&
        scan_effect(&scratch, data, coverage, &without, &base, effect, &candidate) &&
        fit_run(&scratch, data, &candidate.hypothesis, refine_iterations) && scratch.cost < io_fit->cost - 1.0) {
        *io_h = candidate.hypothesis;
        fit_run(io_fit, data, io_h, refine_iterations);
    }
    fit_free(&base);
    fit_free(&scratch);
}

static void place_named_again(const struct fit_data *data, const struct sim_coverage *coverage, struct hypothesis *io_h,
                              struct fit *io_fit)
{
    for (int e = 0; sim_effects[e]; e++)
        if (io_h->named[e])
            place_again(data, coverage, e, io_h, io_fit);
}

static size_t named_count(const struct hypothesis *h)
{
    size_t count = 0;
    for (int e = 0; sim_effects[e]; e++)
        count += h->named[e];
    return count;
}

bool search_run(const struct fit_data *data, const struct sim_coverage *coverage, const struct search_options *options,
                struct hypothesis *io_hypothesis, struct fit *io_fit)
{
    if (!fit_run(io_fit, data, io_hypothesis, refine_iterations))
        return false;
    for (size_t round = 0; round < 2 * options->causes_max && named_count(io_hypothesis) < options->causes_max;
         round++) {
        if (options->progress && !options->progress(options->user, "searching"))
            break;
        drop_unneeded(data, io_hypothesis, io_fit);
        if (!add_best(data, coverage, io_hypothesis, io_fit))
            break;
        place_named_again(data, coverage, io_hypothesis, io_fit);
    }
    drop_unneeded(data, io_hypothesis, io_fit);
    return true;
}
