/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/judge.h"

#include "lab/diagnose/blackbox.h"
#include "lab/diagnose/constancy.h"
#include "lab/diagnose/predict.h"
#include "lab/diagnose/search.h"
#include "lab/diagnose/structure.h"
#include "sim/stepper.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { trial_iterations = 6 };

/// Share of the torque's RMS that an effect is responsible for: the model with it against the model with it taken out.
static double effect_share(const struct fit_data *data, const struct sim_coverage *coverage, const struct hypothesis *h,
                           int effect)
{
    struct hypothesis without = *h;
    struct sim_model with_model, without_model;
    hypothesis_unname(&without, effect);
    hypothesis_model(h, NULL, &with_model);
    hypothesis_model(&without, NULL, &without_model);
    const struct evidence *e = &data->evidence[0];
    const struct recording *r = e->recording;
    // What depends on time averages out over a mean of periods.
    bool whole = sim_effects[effect]->in_time;
    const struct stretch *stretch = whole ? &r->all : &r->block;
    size_t n = stretch->samples;
    double *work = malloc(4 * n * sizeof *work);
    if (!work)
        return 0.0;
    predict(&with_model, stretch, r->periodic && !whole, e->scale_inertia, work, work + n);
    predict(&without_model, stretch, r->periodic && !whole, e->scale_inertia, work + 2 * n, work + 3 * n);
    double sum = 0.0;
    for (size_t i = 0; i < 2 * n; i++) {
        double d = work[i] - work[2 * n + i];
        sum += d * d;
    }
    free(work);
    return sqrt(sum / (double)n) / coverage->torque_rms;
}

/// The block's noise within the band as a share of the torque's RMS.
static double noise_share(const struct fit_data *data, const struct sim_coverage *coverage)
{
    const struct evidence *e = &data->evidence[0];
    double power = e->covariance[0];
    for (size_t k = 1; k <= e->recording->band; k++)
        power += 2.0 * e->covariance[4 * k];
    return sqrt(power) / coverage->torque_rms;
}

/// By how much the sensors are wrong for an effect, RMS, as a share of the travelled range: small torques may follow
/// from it, or none at all.
static double sensor_share(const struct fit_data *data, const struct sim_coverage *coverage, const struct hypothesis *h,
                           int effect)
{
    const struct recording *r = data->evidence[0].recording;
    if (!sim_effects[effect]->sense)
        return 0.0;
    struct sim_model model;
    struct sim_stepper stepper;
    hypothesis_model(h, NULL, &model);
    for (int e = 0; sim_effects[e]; e++)
        model.effect_on[e] = model.effect_on[e] && e == effect;
    sim_stepper_init_once(&stepper, &model, 1.0 / r->rate_hz);
    double sum = 0.0;
    for (size_t n = 0; n < r->block.samples; n++) {
        struct sim_motion at = {
            .position = r->block.position[n], .velocity = r->block.velocity[n], .linear = r->linear};
        struct sim_sensed said;
        sim_stepper_sense(&stepper, &at, &said);
        sum += (said.position - at.position) * (said.position - at.position);
    }
    return sqrt(sum / (double)r->block.samples) / coverage->position_span;
}

/// Evidence for an effect when the black box may explain everything it can.
static double evidence_beside(const struct blackbox *box, const struct fit_data *data, const struct hypothesis *h,
                              const struct fit *fit, int effect)
{
    struct fit trial;
    struct hypothesis without = *h;
    double with_cost, without_cost = 0.0;
    if (!fit_init(&trial, data))
        return 0.0;
    blackbox_gain(box, data, h, fit, blackbox_all, &with_cost, NULL);
    hypothesis_unname(&without, effect);
    if (fit_run(&trial, data, &without, trial_iterations))
        blackbox_gain(box, data, &without, &trial, blackbox_all, &without_cost, NULL);
    fit_free(&trial);
    return 0.5 * (without_cost - with_cost);
}

/// Evidence for an effect from the bins that structure over time leaves alone: how noisy the mean of the periods is in
/// the others, their scatter does not say.
static double evidence_outside(const struct fit_data *data, const struct hypothesis *h, const struct fit *fit,
                               int effect, const struct structure *structure)
{
    struct fit trial;
    struct hypothesis without = *h;
    double gain = 0.0;
    if (!fit_init(&trial, data))
        return 0.0;
    hypothesis_unname(&without, effect);
    if (fit_run(&trial, data, &without, trial_iterations)) {
        size_t at = 0;
        for (size_t run = 0; run < data->runs; run++)
            for (size_t i = 0; i < data->evidence[run].values; i++, at++) {
                size_t channel, bin = evidence_bin(&data->evidence[run], i, &channel);
                if (!structure_holds(structure, bin))
                    gain += 0.5 * (trial.residual[at] * trial.residual[at] - fit->residual[at] * fit->residual[at]);
            }
    }
    fit_free(&trial);
    return gain;
}

/// Says what kind of term would explain what is left, and how much of it. Where it lies, misfit.h says.
static void describe_rest(const struct blackbox *box, const struct fit_data *data, const struct hypothesis *h,
                          const struct fit *fit, struct judgement *io_judgement)
{
    double excess = fmax(fit->cost - (double)data->values, 1e-9), gains[blackbox_groups];
    int best = 0;
    for (int g = 0; g < blackbox_groups; g++) {
        gains[g] = blackbox_gain(box, data, h, fit, 1u << g, NULL, NULL);
        if (gains[g] > gains[best])
            best = g;
    }
    io_judgement->shape = best;
    snprintf(io_judgement->where, sizeof io_judgement->where,
             "no known cause has its shape, but %s would fit %.0f %% of it",
             blackbox_group_name((enum blackbox_group)best), 100.0 * fmin(2.0 * gains[best] / excess, 1.0));
}

/// Structure over time in what the hypothesis leaves of the contrasts (`fit` NULL: in what is there of them without
/// effects in time), over all runs. `left`: what a black box leaves of the residual.
static bool look_over_time(const struct fit_data *data, const struct fit *fit, const double *left,
                           struct structure *out)
{
    const double *contrasts = fit && fit->rows > data->values ? fit->residual + data->values : NULL;
    memset(out, 0, sizeof *out);
    for (size_t i = 0; i < data->runs; i++) {
        const struct evidence *e = &data->evidence[i];
        struct structure s;
        if (!structure_find(e, contrasts ? contrasts : e->contrast.base, &s))
            return false;
        if (!e->recording->periodic)
            structure_find_slow(e, left, &s);
        left += e->values;
        structure_merge(out, &s);
        if (contrasts)
            contrasts += e->contrast.values;
    }
    return true;
}

bool judge_structure(const struct fit_data *data, const struct sim_model *model, struct structure *out_structure)
{
    double *residual = malloc((data->values + data->contrasts) * sizeof *residual);
    memset(out_structure, 0, sizeof *out_structure);
    if (!residual)
        return false;
    size_t rows = fit_residual(data, model, residual);
    const double *contrasts = rows > data->values ? residual + data->values : NULL;
    bool good = true;
    for (size_t i = 0; i < data->runs && good; i++) {
        const struct evidence *e = &data->evidence[i];
        struct structure s;
        good = structure_find(e, contrasts ? contrasts : e->contrast.base, &s);
        if (good)
            structure_merge(out_structure, &s);
        if (contrasts)
            contrasts += e->contrast.values;
    }
    free(residual);
    return good;
}

/// What judging names needs.
struct bench {
    const struct blackbox *box;
    const struct fit_data *data;
    const struct sim_coverage *coverage;
    const struct hypothesis *hypothesis;
    const struct fit *fit;
};

static bool is_large_enough(const struct bench *b, int effect)
{
    // Of the torque's RMS: less is not worth a name even if it is significant; unless the noise is smaller still.
    const double least_share = fmin(0.0015, fmax(0.0003, 0.5 * noise_share(b->data, b->coverage)));
    const double least_sensor_share = 1e-6; // of the travelled range: positions are known that well
    return effect_share(b->data, b->coverage, b->hypothesis, effect) >= least_share ||
           sensor_share(b->data, b->coverage, b->hypothesis, effect) >= least_sensor_share;
}

static bool is_claimed(const struct bench *b, int effect)
{
    return b->hypothesis->named[effect] && !hypothesis_is_detail(b->hypothesis, effect);
}

static bool is_in_time(const struct bench *b, int effect)
{
    return sim_effects[effect]->in_time && b->data->contrasts > 0;
}

/// Whether the periods themselves, not their mean, say that something changes, and no number of the given model that
/// creeps would do as well.
static bool is_seen_in_time(const struct bench *b, int effect, struct judgement *j)
{
    double nats = constancy_nats_in_time(b->data, b->hypothesis, b->fit, effect);
    if (nats > search_threshold(b->data, effect))
        return true;
    if (!j->unexplained)
        snprintf(j->where, sizeof j->where, "what %s takes of it is no better described than by another slow change",
                 sim_effects[effect]->id);
    j->unexplained = true;
    return false;
}

/// Effects in time answer for what stays over time. Returns whether all stand that were named.
static bool judge_in_time(const struct bench *b, struct judgement *j)
{
    const double dominance = 20.0;
    bool all = true;
    for (int e = 0; sim_effects[e]; e++) {
        if (!is_claimed(b, e) || !is_in_time(b, e))
            continue;
        j->stands[e] = is_large_enough(b, e) &&
                       (!(j->leftover_in_time > 0.0) ||
                        search_evidence(b->data, b->hypothesis, b->fit, e) > dominance * j->leftover_in_time) &&
                       is_seen_in_time(b, e, j);
        all = all && j->stands[e];
    }
    return all;
}

/// A name of which there is more in one period than in another is not what it says, however well it suits their mean.
static bool is_constant(const struct bench *b, int effect, struct judgement *j)
{
    double changes = constancy_nats(b->data, b->hypothesis, b->fit, effect);
    if (!constancy_is_broken(changes, search_evidence(b->data, b->hypothesis, b->fit, effect)))
        return true;
    if (!j->unexplained)
        snprintf(j->where, sizeof j->where, "what %s takes of it changes slowly over the run", sim_effects[effect]->id);
    j->unexplained = true;
    j->leftover_in_time = fmax(j->leftover_in_time, changes);
    return false;
}

/// The others answer for what stays of the mean of the periods.
static void judge_others(const struct bench *b, const struct structure *over_time, struct judgement *j)
{
    // How far a cause has to outweigh what stays unexplained. Beside a given model a name says what changed, and a term
    // of the wrong shape gains a hundred times what it leaves. Without a model it says what is there at all.
    const double dominance = b->hypothesis->inertia_free ? 5.0 : 1000.0;
    // And a name that does not take away far more than all that is left may be a piece of something else.
    const double part_of_rest = b->hypothesis->inertia_free ? 0.3 : 10.0,
                 rest = fmax(0.5 * (b->fit->cost - (double)b->data->values), 0.0);
    for (int e = 0; sim_effects[e]; e++) {
        if (!is_claimed(b, e) || is_in_time(b, e))
            continue;
        bool stands = is_large_enough(b, e);
        if (stands && j->of_mean) {
            double evidence = search_evidence(b->data, b->hypothesis, b->fit, e);
            stands = evidence > part_of_rest * rest &&
                     (evidence > dominance * j->leftover || evidence_beside(b->box, b->data, b->hypothesis, b->fit, e) >
                                                                fmax(0.05 * evidence, 0.1 * j->leftover));
        }
        if (stands && over_time->found)
            stands = evidence_outside(b->data, b->hypothesis, b->fit, e, over_time) > search_threshold(b->data, e);
        j->stands[e] = stands && is_constant(b, e, j);
    }
}

/// `rest`: what a black box leaves of the residual. Where an effect in time does not stand, what it explained is
/// unexplained again.
static bool judge_names(const struct bench *b, const double *rest, const struct structure *over_time,
                        struct judgement *j)
{
    struct structure structure = *over_time, bare = {0};
    if (!judge_in_time(b, j)) {
        if (!look_over_time(b->data, NULL, rest, &bare))
            return false;
        structure_merge(&structure, &bare);
    }
    judge_others(b, &structure, j);
    for (int e = 0; sim_effects[e]; e++)
        j->count += j->stands[e];
    return true;
}

/// Whether one group of the black box, beside the given model, does as well as three or more names together: one gap,
/// then, which the catalogue pieces together. Returns the group, or blackbox_groups if there is none.
static enum blackbox_group one_gap(const struct blackbox *box, const struct fit_data *data, const struct hypothesis *h,
                                   const struct fit *fit)
{
    struct fit trial;
    struct hypothesis bare;
    const size_t names = hypothesis_claims(h), patchwork = 3;
    if (names < patchwork || !fit_init(&trial, data))
        return blackbox_groups;
    hypothesis_init(&bare, h->given, h->inertia_free, h->actuator_seen);
    bare.sensors_seen = h->sensors_seen;
    bare.gain_free = h->gain_free;
    enum blackbox_group found = blackbox_groups;
    if (fit_run(&trial, data, &bare, trial_iterations))
        for (int g = 0; g < blackbox_groups && found == blackbox_groups; g++) {
            double columns = (double)(box->group_begin[g + 1] - box->group_begin[g]), left;
            blackbox_gain(box, data, &bare, &trial, 1u << g, &left, NULL);
            // It has more freedom than the names: what chance gains with that is not held against them.
            if (left + columns < fit->cost + 0.01 * (trial.cost - fit->cost))
                found = (enum blackbox_group)g;
        }
    fit_free(&trial);
    return found;
}

/// What the mean of the periods leaves, held against the black box. io_rest: the whitened residual on entry, what the
/// black box leaves of it on return.
static void judge_mean(const struct bench *b, const struct judge_validation *validation, double *io_rest,
                       struct judgement *j)
{
    bool named = hypothesis_claims(b->hypothesis) > 0;
    // Beside a given model a right answer leaves noise, and that nothing is wrong is the boldest answer of all. Without
    // one, half as much again is what a machine is like.
    const double too_much = b->hypothesis->inertia_free ? 1.5
                            : named                     ? 1.25
                                                        : 1.15,
                 visible = 1.12;    // a third of the noise's amplitude
    const double seen_again = 1.03; // on data the fit has not seen: chance does not come twice
    const double validation_rms = validation->mean_rms;
    // Without a given model nothing says how good the structure itself is.
    bool astray = validation->astray && !b->hypothesis->inertia_free;
    double left, values = (double)b->data->values, columns = (double)b->box->columns;
    j->leftover = blackbox_gain(b->box, b->data, b->hypothesis, b->fit, blackbox_all, &left, io_rest);
    double chance = 0.5 * columns + 12.0 * sqrt(0.5 * columns);
    bool structured = j->leftover / fmax(left / values, 1.0) > chance && b->fit->cost > visible * left;
    j->unexplained = validation->worse || astray || (structured && !(validation_rms < seen_again)) ||
                     b->fit->cost / values > too_much * too_much || !(validation_rms < too_much);
    j->of_mean = j->unexplained;
    if (j->unexplained) {
        describe_rest(b->box, b->data, b->hypothesis, b->fit, j);
        return;
    }
    enum blackbox_group gap =
        b->hypothesis->inertia_free ? blackbox_groups : one_gap(b->box, b->data, b->hypothesis, b->fit);
    if (gap == blackbox_groups)
        return;
    j->unexplained = j->of_mean = true;
    j->shape = (int)gap;
    j->leftover = b->fit->cost;
    snprintf(j->where, sizeof j->where, "several names were needed for one gap, which %s alone would close",
             blackbox_group_name(gap));
}

/// What differs between periods beyond noise.
static void judge_over_time(const struct structure *over_time, struct judgement *j)
{
    if (!over_time->found)
        return;
    j->leftover_in_time = fmax(over_time->nats, over_time->beyond);
    if (!j->unexplained || over_time->nats > j->leftover)
        snprintf(j->where, sizeof j->where, "%s", over_time->where);
    j->unexplained = true;
}

bool judge(const struct fit_data *data, const struct sim_coverage *coverage, const struct hypothesis *hypothesis,
           const struct fit *fit, const struct judge_validation *validation, struct judgement *out_judgement)
{
    struct blackbox box;
    struct structure over_time;
    memset(out_judgement, 0, sizeof *out_judgement);
    out_judgement->shape = -1;
    double *rest = malloc(data->values * sizeof *rest);
    if (!rest || !blackbox_init(&box, data)) {
        free(rest);
        return false;
    }
    const struct bench bench = {&box, data, coverage, hypothesis, fit};
    memcpy(rest, fit->residual, data->values * sizeof *rest);
    judge_mean(&bench, validation, rest, out_judgement);
    bool good = look_over_time(data, fit, rest, &over_time);
    if (good) {
        structure_merge(&over_time, &validation->over_time);
        judge_over_time(&over_time, out_judgement);
    }
    if (good && !validation->worse)
        good = judge_names(&bench, rest, &over_time, out_judgement);
    free(rest);
    blackbox_free(&box);
    return good;
}

/// Whether another effect does as well as the one that was taken out of a hypothesis (`without`, fitted).
static bool replaces(const struct fit_data *data, const struct sim_coverage *coverage, const struct hypothesis *without,
                     const struct fit *without_fit, int in, double most_cost)
{
    struct fit trial;
    struct hypothesis swapped = *without;
    if (!hypothesis_may_name(without, in) || !fit_init(&trial, data))
        return false;
    bool good = search_add(data, coverage, in, without_fit, most_cost, &swapped, &trial) && trial.cost < most_cost &&
                !hypothesis_is_detail(&swapped, in);
    fit_free(&trial);
    return good;
}

size_t judge_ties(const struct fit_data *data, const struct sim_coverage *coverage, const struct hypothesis *hypothesis,
                  const struct fit *fit, struct diagnosis_tie *out_ties, size_t most)
{
    const double apart_nats = 6.0;
    double misfit = fmax(fit->cost / (double)data->values, 1.0);
    double most_cost = fit->cost + 2.0 * apart_nats * misfit;
    size_t count = 0;
    struct fit without_fit;
    if (!fit_init(&without_fit, data))
        return 0;
    for (int out = 0; sim_effects[out]; out++) {
        struct hypothesis without = *hypothesis;
        if (!hypothesis->named[out] || hypothesis_is_detail(hypothesis, out))
            continue;
        hypothesis_unname(&without, out);
        // A name that may as well be missing is tied to whatever else may be missing.
        if (!fit_run(&without_fit, data, &without, trial_iterations) || without_fit.cost < most_cost)
            continue;
        for (int in = 0; sim_effects[in] && count < most; in++) {
            if (hypothesis->named[in] || !replaces(data, coverage, &without, &without_fit, in, most_cost))
                continue;
            struct diagnosis_tie *t = &out_ties[count++];
            t->effects[0] = out;
            t->effects[1] = in;
            snprintf(t->next, sizeof t->next,
                     "servoscope design --separate %s,%s --model MODEL.json finds the excitation; or measure %s",
                     sim_effects[out]->id, sim_effects[in]->id, sim_effects[out]->measure);
        }
    }
    fit_free(&without_fit);
    return count;
}

bool judge_is_vague(const struct sim_effect *effect, const double *values, const double *deviations,
                    const double *nominal)
{
    const double certain = 2.0;
    bool sinusoid = false;
    for (size_t i = 0; i < effect->parameter_count; i++)
        sinusoid = sinusoid || effect->parameters[i].kind == sim_parameter_amplitude;
    for (size_t i = 0; i < effect->parameter_count; i++) {
        const enum sim_parameter_kind kind = effect->parameters[i].kind;
        // Phases and what is optional say how, not how much.
        if (kind == sim_parameter_phase || effect->parameters[i].optional ||
            (sinusoid && kind != sim_parameter_amplitude))
            continue;
        if (!(fabs(values[i] - nominal[i]) < certain * deviations[i]))
            return false;
    }
    return true;
}

bool judge_is_astray(double error, double noise_floor)
{
    const double much = 1.25, least = 0.003; // twice the share of the torque that is worth a name
    return error > much * noise_floor && error * error - noise_floor * noise_floor > least * least;
}

bool judge_distance(double error, double noise_floor, struct judgement *io_judgement)
{
    const double far = 4.0, large = 0.1;
    const bool blind = noise_floor > 1.0;
    if (blind) {
        memset(io_judgement->stands, 0, sizeof io_judgement->stands);
        io_judgement->count = 0;
        snprintf(io_judgement->where, sizeof io_judgement->where,
                 "what passes for noise is %.3g times the measured torque: the motion is recorded too coarsely",
                 noise_floor);
    } else if (!io_judgement->unexplained && error > large && error > far * noise_floor) {
        snprintf(io_judgement->where, sizeof io_judgement->where,
                 "on unseen data the error is %.2g times what the noise above the excited band would make",
                 error / noise_floor);
    } else {
        return false;
    }
    io_judgement->unexplained = true;
    return true;
}
