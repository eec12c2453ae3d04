/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/search.h"

#include "lab/diagnose/hidden_mass.h"
#include "lab/diagnose/scan.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { refine_iterations = 8, refined_candidates = 3 };
/// Misfit per value that is nowhere near noise: likelihoods are not worth their digits there.
static const double far_from_noise = 3.0;

double search_threshold(const struct fit_data *data, int effect)
{
    const double floor_nats = 12.0;
    double parameters = (double)sim_effects[effect]->parameter_count;
    size_t values = data->values + (sim_effects[effect]->in_time ? data->contrasts : 0);
    return floor_nats + 0.5 * parameters * log((double)values);
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
    if (hypothesis_is_detail(h, effect))
        return true;
    hypothesis_parameters(h, effect, NULL, values, unused);
    return !sim_effects[effect]->testable || sim_effects[effect]->testable(values, coverage, why, sizeof why);
}

static int by_cost(const void *a, const void *b)
{
    double x = ((const struct scan_candidate *)a)->cost, y = ((const struct scan_candidate *)b)->cost;
    return (x > y) - (x < y);
}

// ---- Fits remembered

/// What the noise is at present, in one number: fits under another are worth nothing.
static uint64_t noise_stamp(const struct fit_data *data)
{
    uint64_t stamp = 1469598103934665603u; // FNV-1a, a word at a time
    for (size_t i = 0; i < data->runs; i++) {
        const struct evidence *e = &data->evidence[i];
        for (size_t k = 0; k < 4 * (e->recording->band + 1); k++) {
            uint64_t bits;
            memcpy(&bits, &e->factor[k], sizeof bits);
            stamp = (stamp ^ bits) * 1099511628211u;
        }
    }
    return stamp;
}

static struct search_fitted *find_fitted(const struct fit_data *data, const struct hypothesis *h, uint64_t stamp)
{
    for (size_t i = 0; i < search_memo_size; i++) {
        struct search_fitted *f = &data->memo->fitted[i];
        if (f->used && f->stamp == stamp && memcmp(f->named, h->named, sizeof f->named) == 0)
            return f;
    }
    return NULL;
}

/// Remembers the lowest cost of a set of names.
static void remember(const struct fit_data *data, const struct hypothesis *h, double cost)
{
    if (!data->memo)
        return;
    uint64_t stamp = noise_stamp(data);
    struct search_fitted *f = find_fitted(data, h, stamp);
    if (f) {
        f->cost = fmin(f->cost, cost);
        return;
    }
    f = &data->memo->fitted[data->memo->next];
    data->memo->next = (data->memo->next + 1) % search_memo_size;
    *f = (struct search_fitted){.used = true, .stamp = stamp, .cost = cost};
    memcpy(f->named, h->named, sizeof f->named);
}

void search_remember(const struct fit_data *data, const struct hypothesis *hypothesis, double cost)
{
    if (!data->memo)
        return;
    struct search_fitted *f = find_fitted(data, hypothesis, noise_stamp(data));
    if (f)
        f->used = false;
    remember(data, hypothesis, cost);
}

double search_evidence(const struct fit_data *data, const struct hypothesis *hypothesis, const struct fit *fit,
                       int effect)
{
    struct hypothesis without = *hypothesis;
    struct fit trial;
    hypothesis_unname(&without, effect);
    const struct search_fitted *before = data->memo ? find_fitted(data, &without, noise_stamp(data)) : NULL;
    if (before)
        return 0.5 * (before->cost - fit->cost);
    if (!fit_init(&trial, data))
        return -INFINITY;
    fit_roughly(&trial, data, NULL, NULL, &without, refine_iterations, INFINITY);
    double cost = trial.cost;
    fit_free(&trial);
    remember(data, &without, cost);
    return 0.5 * (cost - fit->cost);
}

/// What an effect has to gain beside a hypothesis. One that acts on what another named effect brought, as a gap in a
/// belt that the given model does not have, also has to gain a share of what that one does: by so much the parts of a
/// new structure are never right.
static double needed_nats(const struct fit_data *data, const struct hypothesis *h, const struct fit *fit, int effect)
{
    const double share = 0.05;
    const struct sim_effect *e = sim_effects[effect];
    double needed = search_threshold(data, effect), misfit = fmax(fit->cost / (double)data->values, 1.0);
    if (!e->applies || e->applies(h->given))
        return needed;
    for (int parent = 0; sim_effects[parent]; parent++)
        if (h->named[parent] && sim_effects[parent]->engage)
            needed = fmax(needed, share * search_evidence(data, h, fit, parent) / misfit);
    return needed;
}

// ---- Adding

/// Cost at which a candidate would gain `nats` over a fit.
static double cost_for(const struct fit_data *data, double cost_before, double nats)
{
    double values = (double)data->values;
    return fmin(cost_before - 2.0 * nats, cost_before * values / (values + 2.0 * nats));
}

/// Scans every effect that may be named; the lowest cost first. Returns how many lead anywhere.
static size_t scan_all(const struct fit_data *data, const struct sim_coverage *coverage, const struct hypothesis *h,
                       const struct fit *fit, struct scan_candidate *out_list)
{
    const double hint = 0.25; // of what it takes: a scan is coarse, and half of the rest comes with the fit
    struct scan scan;
    size_t count = 0;
    if (!scan_init(&scan, data, coverage, h, fit))
        return 0;
    for (int e = 0; sim_effects[e]; e++) {
        double worth = hint * (fit->cost - cost_for(data, fit->cost, search_threshold(data, e)));
        if (hypothesis_may_name(h, e) && scan_effect(&scan, e, worth, &out_list[count]))
            count++;
    }
    scan_free(&scan);
    qsort(out_list, count, sizeof *out_list, by_cost);
    return count;
}

/// Whether a candidate is to be preferred to the best so far (NULL: none). What a model leaves that is nowhere near
/// noise has no likelihood worth its digits, so that of two that both leave far more, and gain nearly alike, the
/// simpler one is taken: the noise estimated under it says the rest.
static bool is_preferred(const struct fit_data *data, const struct scan_candidate *candidate, double margin,
                         const struct scan_candidate *best, double best_margin)
{
    const double alike = 0.7;
    if (!best)
        return margin > 0.0;
    double least = far_from_noise * (double)data->values;
    size_t parameters = sim_effects[candidate->effect]->parameter_count,
           best_parameters = sim_effects[best->effect]->parameter_count;
    if (parameters != best_parameters && fmin(candidate->cost, best->cost) > least)
        return parameters < best_parameters ? margin > alike * best_margin : alike * margin > best_margin;
    return margin > best_margin;
}

/// Whether a candidate is too small a part of far too much: beside a given model a name has to outweigh ten times all
/// that stays (judge.c), and where the best of the catalogue does not take a tenth of it away the rest is not of it,
/// either. Without a given model a name says what is there at all, however little of it.
static bool is_lost_cause(const struct fit_data *data, const struct hypothesis *h, double cost_before,
                          double cost_after)
{
    const double part = 0.1;
    double values = (double)data->values;
    return !h->inertia_free && cost_after > far_from_noise * values &&
           cost_before - cost_after < part * (cost_before - values);
}

/// One round of forward selection. Returns whether an effect was added.
static bool add_best(const struct fit_data *data, const struct sim_coverage *coverage, struct hypothesis *io_h,
                     struct fit *fit)
{
    struct scan_candidate *list = calloc(sim_effects_max, sizeof *list);
    struct fit scratch = {0};
    const struct scan_candidate *best = NULL;
    double best_margin = 0.0;
    if (list && fit_init(&scratch, data)) {
        size_t count = scan_all(data, coverage, io_h, fit, list);
        for (size_t i = 0; i < count && i < refined_candidates; i++) {
            double needed = needed_nats(data, io_h, fit, list[i].effect);
            double goal = cost_for(data, fit->cost, needed + 0.5 * best_margin);
            fit_roughly(&scratch, data, io_h, fit, &list[i].hypothesis, refine_iterations, goal);
            double margin = scaled_gain(data, fit->cost, scratch.cost) - needed;
            list[i].cost = scratch.cost;
            if (is_preferred(data, &list[i], margin, best, best_margin) &&
                !is_lost_cause(data, io_h, fit->cost, list[i].cost) &&
                can_show(&list[i].hypothesis, coverage, list[i].effect)) {
                best_margin = margin;
                best = &list[i];
            }
        }
        if (best) {
            *io_h = best->hypothesis;
            fit_run(fit, data, io_h, refine_iterations);
            remember(data, io_h, fit->cost);
        }
    }
    bool added = best != NULL;
    fit_free(&scratch);
    free(list);
    return added;
}

bool search_add(const struct fit_data *data, const struct sim_coverage *coverage, int effect, const struct fit *fit,
                double hoped_cost, struct hypothesis *io_hypothesis, struct fit *out_fit)
{
    struct scan scan;
    struct scan_candidate candidate;
    const double hint = 0.2;   // of the gap
    const double near = 100.0; // a first step that closes neither half of the gap nor comes this close will not make it
    double gap = fit->cost - hoped_cost;
    if (!scan_init(&scan, data, coverage, io_hypothesis, fit))
        return false;
    bool found = scan_effect(&scan, effect, hint * gap, &candidate);
    scan_free(&scan);
    if (!found || candidate.cost > hoped_cost + fmax(0.5 * gap, near))
        return false;
    *io_hypothesis = candidate.hypothesis;
    return fit_run(out_fit, data, io_hypothesis, refine_iterations);
}

// ---- Dropping

/// Drops the named effect that is needed least, if it is not needed. Returns whether one was dropped.
static bool drop_weakest(const struct fit_data *data, struct hypothesis *io_h, struct fit *fit)
{
    int weakest = -1;
    double least = 0.0, misfit = fmax(fit->cost / (double)data->values, 1.0);
    for (int e = 0; sim_effects[e]; e++) {
        if (!io_h->named[e] || hidden_mass_holds(io_h, e))
            continue;
        double margin = search_evidence(data, io_h, fit, e) / misfit - needed_nats(data, io_h, fit, e);
        if (margin < least) {
            least = margin;
            weakest = e;
        }
    }
    if (weakest < 0)
        return false;
    hypothesis_unname(io_h, weakest);
    fit_run(fit, data, io_h, refine_iterations);
    remember(data, io_h, fit->cost);
    return true;
}

static void drop_unneeded(const struct fit_data *data, struct hypothesis *io_h, struct fit *fit)
{
    while (drop_weakest(data, io_h, fit)) {
    }
}

// ---- Placing

/// Looks for a better place of one named effect: its scan again, now that everything else has found its value. A
/// ripple's first fit, beside wrong numbers, may have settled on a neighbouring frequency.
static void place_again(const struct fit_data *data, const struct sim_coverage *coverage, int effect,
                        struct hypothesis *io_h, struct fit *io_fit)
{
    const double better = 1.0, hint = 0.2; // of what the effect brings where it is
    struct fit base = {0}, trial = {0};
    struct scan scan;
    struct hypothesis without = *io_h;
    struct scan_candidate candidate;
    hypothesis_unname(&without, effect);
    if (fit_init(&base, data) && fit_init(&trial, data) && fit_run(&base, data, &without, 0) &&
        scan_init(&scan, data, coverage, &without, &base)) {
        double goal = io_fit->cost - better;
        bool found = scan_effect(&scan, effect, hint * (base.cost - io_fit->cost), &candidate);
        scan_free(&scan);
        if (found && fit_roughly(&trial, data, &without, &base, &candidate.hypothesis, refine_iterations, goal) &&
            trial.cost < goal) {
            *io_h = candidate.hypothesis;
            fit_run(io_fit, data, io_h, refine_iterations);
            remember(data, io_h, io_fit->cost);
        }
    }
    fit_free(&base);
    fit_free(&trial);
}

static void place_named_again(const struct fit_data *data, const struct sim_coverage *coverage, struct hypothesis *io_h,
                              struct fit *io_fit)
{
    for (int e = 0; sim_effects[e]; e++)
        if (io_h->named[e] && !hidden_mass_holds(io_h, e))
            place_again(data, coverage, e, io_h, io_fit);
}

// ---- One for two

/// Looks for one effect that does as well as two that are named together, with what the second costs granted. `without`
/// has neither, `base` belongs to it.
static bool find_one_for(const struct fit_data *data, const struct sim_coverage *coverage,
                         const struct hypothesis *without, const struct fit *base, double granted,
                         struct hypothesis *io_h, struct fit *io_fit)
{
    const double hint = 0.5; // of what the two bring
    struct fit trial = {0};
    struct scan scan = {0};
    bool found = false, good = fit_init(&trial, data) && scan_init(&scan, data, coverage, without, base);
    double misfit = fmax(io_fit->cost / (double)data->values, 1.0);
    for (int e = 0; good && sim_effects[e]; e++) {
        struct scan_candidate one;
        double goal = io_fit->cost + 2.0 * misfit * (granted - search_threshold(data, e));
        if (io_h->named[e] || !hypothesis_may_name(without, e) || !(goal < base->cost) ||
            !scan_effect(&scan, e, hint * (base->cost - goal), &one))
            continue;
        if (fit_roughly(&trial, data, without, base, &one.hypothesis, refine_iterations, goal) && trial.cost < goal &&
            can_show(&one.hypothesis, coverage, e)) {
            *io_h = one.hypothesis;
            found = fit_run(io_fit, data, io_h, refine_iterations);
            break;
        }
    }
    scan_free(&scan);
    fit_free(&trial);
    return found;
}

/// A wrong name that came first may have needed another to make up for it. Returns whether one took the place of two.
/// Where what is left is nowhere near noise, likelihoods do not decide between one and two, and nothing is looked for.
static bool merge_two(const struct fit_data *data, const struct sim_coverage *coverage, struct hypothesis *io_h,
                      struct fit *io_fit)
{
    struct fit base;
    bool merged = false;
    if (io_fit->cost > far_from_noise * (double)data->values || !fit_init(&base, data))
        return false;
    for (int a = 0; sim_effects[a] && !merged; a++)
        for (int b = a + 1; io_h->named[a] && sim_effects[b] && !merged; b++) {
            struct hypothesis without = *io_h;
            if (!io_h->named[b])
                continue;
            hypothesis_unname(&without, a);
            if (without.named[b])
                hypothesis_unname(&without, b);
            double granted = search_threshold(data, a) + search_threshold(data, b);
            merged = fit_run(&base, data, &without, refine_iterations) &&
                     find_one_for(data, coverage, &without, &base, granted, io_h, io_fit);
        }
    fit_free(&base);
    return merged;
}

/// Whether one more name may be tried. Where several leave what is nowhere near noise the cause is not in the
/// catalogue, and a further one would only describe more of its consequences.
static bool has_room(const struct fit_data *data, const struct search_options *options, const struct hypothesis *h,
                     const struct fit *fit)
{
    const size_t several = 4;
    size_t count = hypothesis_claims(h);
    return count < options->causes_max && (count < several || !(fit->cost > far_from_noise * (double)data->values));
}

bool search_run(const struct fit_data *data, const struct sim_coverage *coverage, const struct search_options *options,
                struct hypothesis *io_hypothesis, struct fit *io_fit)
{
    if (!fit_run(io_fit, data, io_hypothesis, refine_iterations))
        return false;
    remember(data, io_hypothesis, io_fit->cost);
    drop_unneeded(data, io_hypothesis, io_fit);
    if (options->progress && !options->progress(options->user, "searching"))
        return true;
    if (has_room(data, options, io_hypothesis, io_fit) && add_best(data, coverage, io_hypothesis, io_fit)) {
        place_named_again(data, coverage, io_hypothesis, io_fit);
        drop_unneeded(data, io_hypothesis, io_fit);
    } else if (merge_two(data, coverage, io_hypothesis, io_fit)) {
        remember(data, io_hypothesis, io_fit->cost);
    }
    return true;
}
