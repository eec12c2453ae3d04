/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/diagnosis.h"

#include "lab/diagnose/alike.h"
#include "lab/diagnose/blackbox.h"
#include "lab/diagnose/cause_gain.h"
#include "lab/diagnose/gain.h"
#include "lab/diagnose/gain_tie.h"
#include "lab/diagnose/held_back.h"
#include "lab/diagnose/hidden_mass.h"
#include "lab/diagnose/hold.h"
#include "lab/diagnose/inertia_guess.h"
#include "lab/diagnose/judge.h"
#include "lab/diagnose/recording.h"
#include "lab/diagnose/repeat.h"
#include "lab/diagnose/search.h"
#include "lab/diagnose/validate.h"
#include "lab/diagnose/wording.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { refit_iterations = 10, settle_iterations = 3 }; ///< the second: of what was fitted under nearly that noise

/// Everything a diagnosis works on; freed as one.
struct work {
    size_t fit_count, validate_count;
    struct recording *recordings; ///< fit runs, then validation runs
    struct evidence *evidence;    ///< likewise
    struct fit_data fit_data, validate_data;
    struct held_back parts; ///< of the only run
    struct fit fit;
    struct search_memo memo; ///< of fit_data
    struct cause_gain gains[sim_effects_max];
    struct repeat repeat;                 ///< of the fit's parameters, on the validation data
    double own_evidence[sim_effects_max]; ///< beside hidden masses, each with its own noise; 0: not known
};

static void work_free(struct work *w)
{
    for (size_t i = 0; i < w->fit_count + w->validate_count; i++) {
        if (w->evidence)
            evidence_free(&w->evidence[i]);
        if (w->recordings)
            recording_free(&w->recordings[i]);
    }
    free(w->evidence);
    free(w->recordings);
    held_back_free(&w->parts);
    fit_free(&w->fit);
}

/// Recording number i: fit runs, then validation runs, of which the only one may be the end of the first fit run.
static int prepare_one(const struct diagnosis_request *request, struct work *w, bool held_back, size_t i,
                       struct error *out_error)
{
    const struct run *run = i < w->fit_count ? &request->fit[i] : &request->validate[i - w->fit_count];
    if (held_back && (i == 0 || i == w->fit_count))
        run = i == 0 ? &w->parts.fitted : &w->parts.judged;
    struct run alike = *run;
    bool one_rate = alike_share_rate(&request->fit[0], &alike);
    int status = recording_prepare(&alike, &w->recordings[i], out_error);
    if (status != 0)
        return status;
    if (one_rate)
        oddities_add(&w->recordings[i].oddities, "%s: sampled at %.8g Hz, the first run at %.8g Hz: taken as the same.",
                     run->path, run->sample_rate_hz, alike.sample_rate_hz);
    if (held_back && i == w->fit_count)
        recording_begin(&w->recordings[i], (double)w->parts.from / run->sample_rate_hz);
    return alike_check(run, &w->recordings[i], &request->fit[0], &w->recordings[0], out_error);
}

static int prepare_recordings(const struct diagnosis_request *request, struct work *w, struct diagnosis *d,
                              struct error *out_error)
{
    d->held_back = request->validate_count == 0;
    w->fit_count = request->fit_count;
    w->validate_count = d->held_back ? 1 : request->validate_count;
    size_t count = w->fit_count + w->validate_count;
    w->recordings = calloc(count, sizeof *w->recordings);
    w->evidence = calloc(count, sizeof *w->evidence);
    if (!w->recordings || !w->evidence || (d->held_back && !held_back_split(&request->fit[0], &w->parts)))
        return error_set(out_error, error_refused, "not enough memory");
    for (size_t i = 0; i < count; i++) {
        int status = prepare_one(request, w, d->held_back, i, out_error);
        if (status != 0)
            return status;
    }
    return 0;
}

/// The inertia at which a fit of a free one begins, or one too small to matter, which stays.
static double start_inertia(const struct recording *first, struct diagnosis *d)
{
    struct inertia_guess guess = inertia_guess_make(first);
    d->inertia_seen = inertia_guess_accelerates(&guess);
    if (d->inertia_seen)
        return fabs(guess.inertia);
    oddities_add(&d->oddities,
                 "The %s does not accelerate the axis (correlation %.2g with the acceleration): no %s can be found. It "
                 "is taken as so small that it does not matter.",
                 d->linear ? "force" : "torque", guess.correlation, d->linear ? "mass" : "inertia");
    return guess.negligible;
}

static int choose_model(const struct diagnosis_request *request, const struct recording *first, struct diagnosis *d,
                        struct error *out_error)
{
    d->linear = first->linear;
    d->model_given = request->model != NULL;
    if (request->model) {
        d->given = *request->model;
        if (d->given.linear != first->linear)
            return error_set(out_error, error_refused,
                             "the model is %s and %s is %s: use a model in the units of the runs",
                             d->given.linear ? "linear (kg, N)" : "rotary (kgm2, Nm)", request->fit[0].path,
                             first->linear ? "linear (m, N)" : "rotary (rad, Nm)");
    } else {
        sim_model_default(&d->given);
        d->given.linear = first->linear;
        d->given.motor_inertia_kgm2 = start_inertia(first, d);
        d->given.sensors = (struct sim_sensors){0};
    }
    d->given.sample_rate_hz = first->rate_hz;
    return 0;
}

/// A torque without a reference may be the command itself, which acts from its row on: half a sample later than a
/// measured one. Only where a rigid body with friction explains nearly all of it can that be told from a spring.
static void choose_hold(struct work *w, struct diagnosis *d)
{
    const double nearly_all = 0.9, early = 0.25, late = 0.75, clearly = 3.0;
    size_t held = 0, count = w->fit_count + w->validate_count;
    struct hold first = {0};
    for (size_t i = 0; i < w->fit_count; i++) {
        struct hold hold;
        const struct recording *r = &w->recordings[i];
        if (r->block.torque_ref || r->block.still || !hold_find(r, &hold) || !(hold.explained > nearly_all))
            return;
        held += hold.delay > early + clearly * hold.deviation && hold.delay < late;
        first = i == 0 ? hold : first;
    }
    if (held < w->fit_count)
        return;
    for (size_t i = 0; i < count; i++)
        w->recordings[i].all.held = w->recordings[i].block.held = true;
    oddities_add(&d->oddities,
                 "The %s acts %.2f samples later than straight lines between its rows say: it was taken as a "
                 "command that holds from its row on.",
                 wording_input(d), first.delay);
}

/// Without a model and without acceleration torques are balanced instead of moving anything.
static void choose_balance(struct work *w, const struct diagnosis *d)
{
    for (size_t i = 0; i < w->fit_count + w->validate_count; i++)
        w->recordings[i].all.still = w->recordings[i].block.still = !d->model_given && !d->inertia_seen;
}

static void scale_input(struct work *w, struct diagnosis *d, double factor)
{
    for (size_t i = 0; i < w->fit_count + w->validate_count; i++)
        gain_scale(&w->recordings[i], factor);
    d->input_gain *= factor;
}

/// A current or a voltage may count the other way round than the motion; a torque may not.
static void choose_sign(struct work *w, struct diagnosis *d, const struct inertia_guess *guess)
{
    if (!inertia_guess_accelerates(guess) || guess->inertia > 0.0)
        return;
    scale_input(w, d, -1.0);
    oddities_add(&d->oddities, "Positive %s accelerates backward (correlation %.2g): its sign was turned.",
                 wording_input(d), guess->correlation);
}

/// A current or a voltage becomes a torque by what the model's inertia takes; without a model it stays what it is.
static void choose_gain(struct work *w, struct diagnosis *d)
{
    d->input_unit = w->recordings[0].input_unit;
    d->input_gain = 1.0;
    if (!d->input_unit)
        return;
    struct inertia_guess guess = inertia_guess_make(&w->recordings[0]);
    choose_sign(w, d, &guess);
    if (d->model_given && inertia_guess_accelerates(&guess))
        scale_input(w, d, (d->given.motor_inertia_kgm2 + d->given.load_inertia_kgm2) / fabs(guess.inertia));
    else if (!d->model_given)
        oddities_add(&d->oddities,
                     "The input is in %s, and no model says what %s that makes: %ss, frictions and %s are in units of "
                     "what 1 %s makes.",
                     d->input_unit, d->linear ? "force" : "torque", d->linear ? "force" : "torque",
                     d->linear ? "masses" : "inertias", d->input_unit);
}

/// What is odd about the recordings, and whether they can be of the drive that the model is of.
static int look_at_oddities(const struct diagnosis_request *request, const struct work *w, struct diagnosis *d,
                            struct error *out_error)
{
    oddities_of_names(request->fit, request->fit_count, NULL, &d->oddities);
    oddities_of_names(request->validate, request->validate_count, &request->fit[0], &d->oddities);
    for (size_t i = 0; i < w->fit_count + w->validate_count; i++) {
        if (d->held_back && i == w->fit_count)
            continue; // of the same run as the first
        const struct oddities *odd = &w->recordings[i].oddities;
        for (size_t j = 0; j < odd->count; j++)
            oddities_add(&d->oddities, "%s", odd->texts[j]);
    }
    double inertia = d->model_given && !d->input_unit ? d->given.motor_inertia_kgm2 + d->given.load_inertia_kgm2 : 0.0;
    return oddities_of_inertia(&request->fit[0], &w->recordings[0], inertia, d->given.structure == sim_structure_rigid,
                               &d->oddities, out_error);
}

static int prepare_evidence(struct work *w, const struct diagnosis *d, struct error *out_error)
{
    double inertia = d->given.motor_inertia_kgm2 + d->given.load_inertia_kgm2;
    for (size_t i = 0; i < w->fit_count + w->validate_count; i++)
        if (!evidence_init(&w->evidence[i], &w->recordings[i], inertia))
            return error_set(out_error, error_refused, "not enough memory");
    w->fit_data = (struct fit_data){.runs = w->fit_count, .evidence = w->evidence, .memo = &w->memo};
    w->validate_data = (struct fit_data){.runs = w->validate_count, .evidence = w->evidence + w->fit_count};
    for (size_t i = 0; i < w->fit_count; i++) {
        w->fit_data.values += w->evidence[i].values;
        w->fit_data.contrasts += w->evidence[i].contrast.values;
        w->evidence[i].phase_free = i > 0;
    }
    for (size_t i = 0; i < w->validate_count; i++) {
        struct evidence *e = &w->evidence[w->fit_count + i];
        w->validate_data.values += e->values;
        w->validate_data.contrasts += e->contrast.values;
        e->phase_free = true;
    }
    if (!fit_init(&w->fit, &w->fit_data))
        return error_set(out_error, error_refused, "not enough memory");
    return 0;
}

static bool estimate_noise(struct evidence *evidence, size_t count, const struct sim_model *model)
{
    bool good = true;
    for (size_t i = 0; i < count; i++)
        good = evidence_estimate_noise(&evidence[i], model) && good;
    return good;
}

/// The noise of the fit runs under a model, and what lines it leaves: where a search for a disturbance begins.
static bool estimate_fit_noise(struct work *w, const struct sim_model *model)
{
    struct sim_coverage *coverage = &w->recordings[0].coverage;
    if (!estimate_noise(w->evidence, w->fit_count, model))
        return false;
    // Those found before stay behind the new ones: a line that the model has by now is not seen any more.
    double before[sim_tones_max];
    size_t fresh = w->evidence[0].tone_count, old = coverage->tone_count;
    memcpy(before, coverage->tones_hz, sizeof before);
    memcpy(coverage->tones_hz, w->evidence[0].tones_hz, sizeof before);
    coverage->tone_count = fresh + old < sim_tones_max ? fresh + old : sim_tones_max;
    memcpy(coverage->tones_hz + fresh, before, (coverage->tone_count - fresh) * sizeof *before);
    return true;
}

static bool tell(const struct diagnosis_request *request, const char *what)
{
    return !request->progress || request->progress(request->user, what);
}

/// Without periods the residual itself is all there is to take the noise from. What a black box can explain of it is
/// taken out first, or friction that the model lacks would pass for noise and never be worth a name.
static bool sharpen_noise(struct evidence *evidence, const struct fit_data *data, struct fit *fit, struct hypothesis *h,
                          size_t iterations)
{
    for (size_t pass = 0; !evidence[0].recording->periodic && pass < 3; pass++) {
        struct blackbox box;
        double *left = malloc(data->values * sizeof *left);
        bool good = left && fit_run(fit, data, h, iterations) && blackbox_init(&box, data);
        if (good) {
            memcpy(left, fit->residual, data->values * sizeof *left);
            blackbox_gain(&box, data, h, fit, blackbox_all, NULL, left);
            const double *part = left;
            for (size_t i = 0; good && i < data->runs; i++) {
                good = evidence_sharpen_noise(&evidence[i], part);
                part += evidence[i].values;
            }
            blackbox_free(&box);
        }
        free(left);
        if (!good)
            return false;
    }
    return true;
}

/// The noise of the validation runs under the extended model, which is not fitted to them.
static bool estimate_validation_noise(struct work *w, const struct hypothesis *h, const struct sim_model *extended)
{
    struct fit fit;
    struct hypothesis fixed = *h;
    if (!estimate_noise(w->evidence + w->fit_count, w->validate_count, extended) || !fit_init(&fit, &w->validate_data))
        return false;
    bool good = sharpen_noise(w->evidence + w->fit_count, &w->validate_data, &fit, &fixed, 0);
    fit_free(&fit);
    return good;
}

/// Moves a free gain to where the fit wants it; the fit does not belong to the recordings any more then.
static bool refine_gain(struct work *w, struct diagnosis *d, const struct hypothesis *h, double *out_step)
{
    const double most = 0.7; // twofold
    double step, deviation;
    *out_step = 0.0;
    if (!h->gain_free)
        return true;
    if (!gain_step(&w->fit_data, &w->fit, h, w->recordings, &step, &deviation))
        return false;
    *out_step = fmin(fmax(step, -most), most);
    scale_input(w, d, exp(*out_step));
    d->input_gain_deviation = d->input_gain * deviation;
    return true;
}

static bool same_names(const struct hypothesis *a, const struct hypothesis *b)
{
    return memcmp(a->named, b->named, sizeof a->named) == 0;
}

/// Estimates the noise under a model, fits the hypothesis with it, and says what model that makes.
static bool fit_anew(struct work *w, struct hypothesis *h, struct sim_model *io_model)
{
    if (!estimate_fit_noise(w, io_model) || !sharpen_noise(w->evidence, &w->fit_data, &w->fit, h, refit_iterations) ||
        !fit_run(&w->fit, &w->fit_data, h, refit_iterations))
        return false;
    hypothesis_model(h, NULL, io_model);
    return true;
}

/// Refits the given structure, and with it a free gain.
static bool refit_given(struct work *w, struct diagnosis *d, struct hypothesis *h, struct sim_model *out_model)
{
    const double settled = 1e-4;
    size_t passes = h->gain_free ? 8 : 2;
    bool more = true;
    *out_model = d->given;
    for (size_t pass = 0; pass < passes && more; pass++) {
        double step = 0.0;
        if (!fit_anew(w, h, out_model) || (pass + 1 < passes && !refine_gain(w, d, h, &step)))
            return false;
        more = !h->gain_free || fabs(step) > settled;
    }
    return true;
}

/// The noise follows the fit: estimated once more for what else is taken from it.
static bool fit_hidden_mass(struct work *w, struct hypothesis *h, struct sim_model *io_model)
{
    struct hypothesis without = *h;
    if (!hidden_mass_fit(&w->fit_data, w->evidence, &w->fit, h)) {
        // Data of an unknown cause may not determine a mass with noise of its own: then there is none to be named.
        for (int e = 0; sim_effects[e]; e++)
            if (without.named[e] && hidden_mass_is(e))
                hypothesis_unname(&without, e);
        *h = without;
        hypothesis_model(h, NULL, io_model);
        return fit_anew(w, h, io_model);
    }
    hypothesis_model(h, NULL, io_model);
    return estimate_fit_noise(w, io_model);
}

static bool names_new_mass(const struct hypothesis *before, const struct hypothesis *h)
{
    for (int e = 0; sim_effects[e]; e++)
        if (sim_effects[e]->attach && h->named[e] && !before->named[e])
            return true;
    return false;
}

/// What is left without one name, with its own noise: that of the rest, where no hidden mass is among it.
static bool fit_without(struct work *w, const struct hypothesis *h, int effect, struct hypothesis *out,
                        struct sim_model *out_model)
{
    *out = *h;
    hypothesis_unname(out, effect);
    hypothesis_model(out, NULL, out_model);
    if (!hidden_mass_is(effect))
        return fit_hidden_mass(w, out, out_model);
    return fit_anew(w, out, out_model) && fit_anew(w, out, out_model);
}

/// Beside a hidden mass, drops what the rest does as well without, each with its own noise; of several the one that is
/// missed least. Returns whether memory sufficed.
static bool drop_beside_hidden_mass(struct work *w, struct hypothesis *h, struct sim_model *io_model)
{
    if (!fit_hidden_mass(w, h, io_model))
        return false;
    double cost = w->fit.cost, credible = hidden_mass_credible_cost(&w->fit_data, cost), least = INFINITY;
    struct hypothesis best = *h;
    struct sim_model best_model = *io_model;
    for (int e = 0; sim_effects[e]; e++) {
        struct hypothesis without;
        struct sim_model model;
        if (!h->named[e])
            continue;
        if (!fit_without(w, h, e, &without, &model))
            return false;
        w->own_evidence[e] = 0.5 * (w->fit.cost - cost);
        double missed = w->fit.cost - (hidden_mass_is(e) ? credible : cost) - 2.0 * search_threshold(&w->fit_data, e);
        if (missed < fmin(least, 0.0)) {
            least = missed;
            best = without;
            best_model = model;
        }
    }
    if (same_names(&best, h))
        return fit_hidden_mass(w, h, io_model);
    *h = best;
    *io_model = best_model;
    return fit_anew(w, h, io_model);
}

/// What was found to be left without each name is what it is judged by, too.
static void remember_own_evidence(struct work *w, const struct hypothesis *h)
{
    for (int e = 0; sim_effects[e]; e++) {
        struct hypothesis without = *h;
        if (!h->named[e] || !(w->own_evidence[e] > 0.0))
            continue;
        hypothesis_unname(&without, e);
        search_remember(&w->fit_data, &without, w->fit.cost + 2.0 * w->own_evidence[e]);
    }
}

/// One round of the search. The structure stays where it is meanwhile if the noise depends on it.
static bool search_once(struct work *w, const struct search_options *options, struct hypothesis *h,
                        struct sim_model *io_model)
{
    struct hypothesis before = *h, free;
    bool concerned = hidden_mass_concerns(&w->fit_data, h);
    if (concerned)
        hidden_mass_hold(h, &free);
    bool good = search_run(&w->fit_data, &w->recordings[0].coverage, options, h, &w->fit);
    if (concerned)
        hidden_mass_release(&free, h);
    hypothesis_model(h, NULL, io_model);
    if (good && concerned && same_names(&before, h))
        return drop_beside_hidden_mass(w, h, io_model);
    if (!good || !names_new_mass(&before, h) || !hidden_mass_concerns(&w->fit_data, h))
        return good;
    if (!fit_hidden_mass(w, h, io_model))
        return false;
    hidden_mass_instead(&w->fit_data, w->evidence, &w->recordings[0].coverage, &before, w->fit.cost, &w->fit, h);
    hypothesis_model(h, NULL, io_model);
    return true;
}

/// Estimates the noise and fits with it until neither changes the other. A name that is new was fitted with the noise
/// of a model without it; what that is off by is not worth another name.
static bool settle_noise(struct work *w, struct hypothesis *h, struct sim_model *io_model)
{
    enum { most = 4 };
    const double settled = 0.01; // of the residuals' number
    if (hidden_mass_concerns(&w->fit_data, h))
        return fit_hidden_mass(w, h, io_model);
    for (int pass = 0; pass < most; pass++) {
        if (!estimate_fit_noise(w, io_model) ||
            !sharpen_noise(w->evidence, &w->fit_data, &w->fit, h, settle_iterations))
            return false;
        double before = fit_cost(&w->fit, &w->fit_data, h, h->x);
        if (!w->evidence[0].recording->periodic || !fit_run(&w->fit, &w->fit_data, h, refit_iterations) ||
            !(before - w->fit.cost > settled * (double)w->fit_data.values))
            break;
        hypothesis_model(h, NULL, io_model);
    }
    return true;
}

/// Refits the given structure, then searches; the noise is estimated anew under every better model, because a wrong
/// model's errors scatter with the motion and would pass for noise.
static bool find_causes(const struct diagnosis_request *request, struct work *w, struct diagnosis *d,
                        struct hypothesis *h)
{
    struct sim_model model;
    double step;
    hypothesis_init(h, &d->given, !d->model_given && d->inertia_seen, w->recordings[0].block.torque_ref != NULL);
    h->middle = w->recordings[0].coverage.position_mean;
    h->sensors_seen = w->evidence[0].kinematics.values > 0;
    h->gain_free = d->input_unit && d->model_given;
    if (!refit_given(w, d, h, &model))
        return false;
    d->refitted_model = model;
    struct search_options options = {.causes_max = 6, .progress = request->progress, .user = request->user};
    for (size_t pass = 0; pass < 2 * options.causes_max; pass++) {
        struct hypothesis before = *h;
        if ((pass > 0 && !refine_gain(w, d, h, &step)) || !settle_noise(w, h, &model) ||
            !search_once(w, &options, h, &model))
            return false;
        if (same_names(&before, h))
            break;
    }
    // Effects in time are linear about the model that the noise was estimated with: once more, from where they are now.
    for (int pass = 0; contrast_concerns(&model) && pass < 2; pass++)
        if (!fit_anew(w, h, &model))
            return false;
    if (hidden_mass_concerns(&w->fit_data, h)) {
        if (!fit_hidden_mass(w, h, &model))
            return false;
        remember_own_evidence(w, h);
    }
    d->extended_model = model;
    d->fit_misfit = w->fit.cost / (double)w->fit_data.values;
    return true;
}

/// What was found in the rows themselves is no hypothesis of the fit.
static void add_finding(const struct recording *r, struct diagnosis *d)
{
    const struct repair_finding *f = &r->finding;
    if (f->effect < 0 || d->cause_count == diagnosis_causes_max)
        return;
    struct diagnosis_cause *cause = &d->causes[d->cause_count++];
    memset(cause, 0, sizeof *cause);
    cause->effect = f->effect;
    cause->evidence = f->evidence;
    cause->gain = (struct cause_gain){{NAN, NAN, NAN}, NAN}; // it is no part of the model's error
    memcpy(cause->values, f->values, sizeof cause->values);
    memcpy(cause->deviations, f->deviations, sizeof cause->deviations);
    struct sim_finding finding = {cause->values, cause->deviations, cause->nominal, d->linear};
    sim_effects[f->effect]->say(&finding, cause->says, sizeof cause->says);
    d->extended_model.effect_on[f->effect] = true;
    memcpy(d->extended_model.effect_parameters[f->effect], f->values, sizeof f->values);
    for (size_t i = 0; i < sim_effects[f->effect]->parameter_count; i++) {
        const struct sim_parameter *p = &sim_effects[f->effect]->parameters[i];
        model_deviations_add(&d->deviations, sim_effects[f->effect]->id, d->linear ? p->linear_name : p->name,
                             f->deviations[i]);
    }
}

/// Residuals whose mean square is above one carry more than noise, and other data may give other numbers: the
/// deviations grow with both.
static void widen_deviations(const struct work *w, const struct diagnosis *d, int effect, double *io_deviations)
{
    double misfit = sqrt(fmax(d->fit_misfit, 1.0));
    for (size_t i = 0; i < sim_effects[effect]->parameter_count; i++)
        io_deviations[i] = hypot(misfit * io_deviations[i], sqrt(w->repeat.variance[effect][i]));
}

static void describe_cause(const struct work *w, const struct diagnosis *d, const struct hypothesis *h, int effect,
                           struct diagnosis_cause *out)
{
    const struct sim_effect *e = sim_effects[effect];
    memset(out, 0, sizeof *out);
    out->effect = effect;
    out->evidence = search_evidence(&w->fit_data, h, &w->fit, effect);
    out->gain = w->gains[effect];
    hypothesis_parameters(h, effect, w->fit.covariance, out->values, out->deviations);
    for (size_t i = 0; i < e->parameter_count; i++)
        if (e->parameters[i].model_offset != SIZE_MAX)
            memcpy(&out->nominal[i], (const char *)&d->given + e->parameters[i].model_offset, sizeof(double));
    widen_deviations(w, d, effect, out->deviations);
    struct sim_finding finding = {out->values, out->deviations, out->nominal, d->linear};
    e->say(&finding, out->says, sizeof out->says);
    wording_in_units(d, sizeof out->says, out->says);
}

/// What is nowhere larger than twice its own deviation is no claim, however much of the error it takes; nor is what
/// does harm on unseen data.
static void refuse_claims(const struct work *w, const struct diagnosis *d, const struct hypothesis *h,
                          struct judgement *io_judgement)
{
    for (int e = 0; sim_effects[e]; e++) {
        struct diagnosis_cause cause;
        char name[wording_short];
        if (!h->named[e] || !io_judgement->stands[e])
            continue;
        describe_cause(w, d, h, e, &cause);
        wording_effect(e, name);
        bool harm = cause_gain_is_harm(&cause);
        if (!harm && !judge_is_vague(sim_effects[e], cause.values, cause.deviations, cause.nominal))
            continue;
        io_judgement->stands[e] = false;
        io_judgement->count--;
        if (!io_judgement->unexplained)
            snprintf(io_judgement->where, sizeof io_judgement->where,
                     harm ? "%s was found on the fitted runs and does harm on unseen data"
                          : "%s takes part of it, of a size that is not known",
                     name);
        io_judgement->unexplained = true;
    }
}

static int stronger(const void *a, const void *b)
{
    double x = ((const struct diagnosis_cause *)a)->evidence, y = ((const struct diagnosis_cause *)b)->evidence;
    return (x < y) - (x > y);
}

static void list_causes(const struct work *w, struct diagnosis *d, const struct hypothesis *h,
                        const struct judgement *judgement)
{
    for (int e = 0; sim_effects[e]; e++) {
        if (!h->named[e])
            continue;
        if (hypothesis_is_detail(h, e)) {
            struct diagnosis_cause detail;
            describe_cause(w, d, h, e, &detail);
            wording_detail(&detail, &d->oddities);
            d->detail_count++;
            continue;
        }
        bool stands = judgement->stands[e];
        size_t *count = stands ? &d->cause_count : &d->candidate_count;
        struct diagnosis_cause *list = stands ? d->causes : d->candidates;
        if (*count < diagnosis_causes_max)
            describe_cause(w, d, h, e, &list[(*count)++]);
    }
    add_finding(&w->recordings[0], d);
    qsort(d->causes, d->cause_count, sizeof d->causes[0], stronger);
    qsort(d->candidates, d->candidate_count, sizeof d->candidates[0], stronger);
}

/// Whether an effect shows only where something accelerates: masses and what is between them.
static bool takes_acceleration(const struct sim_effect *e)
{
    return e->place == sim_place_load || e->engage ||
           e->parameters[0].model_offset == offsetof(struct sim_model, load_inertia_kgm2);
}

/// What was not asked of the data because the data cannot answer.
static void list_untestable(const struct work *w, struct diagnosis *d, const struct hypothesis *h)
{
    const struct sim_coverage *coverage = &w->recordings[0].coverage;
    for (int e = 0; sim_effects[e]; e++) {
        struct diagnosis_untestable *u = &d->untestable[d->untestable_count];
        u->effect = e;
        if (h->named[e] || sim_effects[e]->notice)
            continue;
        if (sim_effects[e]->place == sim_place_actuator && !h->actuator_seen)
            snprintf(u->why, sizeof u->why, "no %s reference was recorded beside the %s", wording_input(d),
                     wording_input(d));
        else if (w->recordings[0].block.still && takes_acceleration(sim_effects[e]))
            snprintf(u->why, sizeof u->why, "nothing accelerates");
        else if (!sim_effects[e]->blind || !sim_effects[e]->blind(coverage, u->why, sizeof u->why))
            continue;
        d->untestable_count++;
    }
}

static void list_deviations(const struct work *w, struct diagnosis *d, const struct hypothesis *h)
{
    for (int e = 0; sim_effects[e]; e++) {
        if (!h->named[e])
            continue;
        double values[sim_effect_parameters_max] = {0}, deviations[sim_effect_parameters_max] = {0};
        hypothesis_parameters(h, e, w->fit.covariance, values, deviations);
        widen_deviations(w, d, e, deviations);
        for (size_t i = 0; i < sim_effects[e]->parameter_count; i++) {
            const struct sim_parameter *p = &sim_effects[e]->parameters[i];
            model_deviations_add(&d->deviations, p->model_offset == SIZE_MAX ? sim_effects[e]->id : NULL,
                                 d->linear ? p->linear_name : p->name, deviations[i]);
        }
    }
}

/// What a black box that learned on the fit runs leaves of the validation runs; NaN if memory is short.
static double ceiling_rms(const struct work *w, const struct sim_model *extended)
{
    const struct fit_data *unseen = &w->validate_data;
    double *left = malloc((unseen->values + unseen->contrasts) * sizeof *left), rms = NAN;
    if (left) {
        fit_residual(unseen, extended, left);
        rms = blackbox_ceiling(&w->fit_data, w->fit.residual, unseen, left);
    }
    free(left);
    return rms;
}

/// What each name is worth on unseen data.
static bool measure_gains(struct work *w, const struct hypothesis *h)
{
    bool good = true;
    for (int e = 0; good && sim_effects[e]; e++)
        good = !h->named[e] || cause_gain_measure(&w->fit_data, h, &w->validate_data, e, &w->gains[e]);
    return good;
}

/// Figures of all three models on unseen data, with one set of weights.
static bool measure_models(struct work *w, struct diagnosis *d, const struct hypothesis *h)
{
    if (!estimate_validation_noise(w, h, &d->extended_model))
        return false;
    d->nominal = validate_figures(&w->validate_data, &d->given);
    d->refitted = validate_figures(&w->validate_data, &d->refitted_model);
    d->extended = validate_figures(&w->validate_data, &d->extended_model);
    d->mean_rms_chance = validate_mean_rms_chance(&w->validate_data);
    d->black_box_rms = ceiling_rms(w, &d->extended_model);
    d->noise_floor_nrmse = validate_noise_floor(&w->validate_data, &d->extended_model);
    return true;
}

static bool pass_judgement(struct work *w, struct diagnosis *d, const struct hypothesis *h,
                           struct judgement *out_judgement, bool *out_distant)
{
    // An effect that cannot show in the validation data changes nothing there; one that spoils it is a wrong name, and
    // so is all that leaves a model to which none at all would be preferable.
    const double clearly = 1.2, none = 1.0;
    double error = d->extended.validation_nrmse;
    const struct recording *judged = &w->recordings[w->fit_count]; // a speed made of positions errs by more than noise
    struct judge_validation seen = {
        .mean_rms = d->extended.mean_rms,
        .worse =
            error > clearly * d->noise_floor_nrmse && (error > clearly * d->refitted.validation_nrmse || error > none),
        .astray = judged->periodic && !judged->derived && judge_is_astray(error, d->noise_floor_nrmse),
    };
    if (!judge_structure(&w->validate_data, &d->extended_model, &seen.over_time) ||
        !judge(&w->fit_data, &w->recordings[0].coverage, h, &w->fit, &seen, out_judgement))
        return false;
    if (!repeat_compare(&w->fit_data, h, &w->fit, &w->validate_data, w->evidence + w->fit_count, &w->repeat) ||
        !estimate_validation_noise(w, h, &d->extended_model)) // which that may have moved
        return false;
    *out_distant = !judged->periodic && judge_distance(error, d->noise_floor_nrmse, out_judgement);
    if (!measure_gains(w, h))
        return false;
    refuse_claims(w, d, h, out_judgement);
    d->verdict = out_judgement->unexplained                                         ? diagnosis_unexplained
                 : out_judgement->count > 0 || w->recordings[0].finding.effect >= 0 ? diagnosis_explained
                                                                                    : diagnosis_no_discrepancy;
    return true;
}

static bool conclude(struct work *w, struct diagnosis *d, const struct hypothesis *h)
{
    struct judgement judgement;
    bool distant;
    if (!measure_models(w, d, h) || !pass_judgement(w, d, h, &judgement, &distant) ||
        !misfit_find(&w->fit_data, &d->given, &d->extended_model, &d->fitted_misfit) ||
        !misfit_find(&w->validate_data, &d->given, &d->extended_model, &d->misfit))
        return false;
    list_causes(w, d, h, &judgement);
    list_untestable(w, d, h);
    list_deviations(w, d, h);
    if (judgement.unexplained) {
        wording_rest(d, judgement.where, d->where);
        d->rest_shape = judgement.shape;
        d->rest_in_time = judgement.leftover_in_time > 0.0;
        d->unexplained_share = distant ? validate_share_left(d->nominal.validation_nrmse, d->extended.validation_nrmse,
                                                             d->noise_floor_nrmse)
                                       : validate_share_left(d->nominal.mean_rms, d->extended.mean_rms, 1.0);
    }
    if (h->inertia_free || !judgement.unexplained) {
        d->tie_count = judge_ties(&w->fit_data, &w->recordings[0].coverage, h, &w->fit, d->ties, diagnosis_ties_max);
    }
    gain_tie_list(d);
    return validate_curves(&w->validate_data, d, &d->curves);
}

int diagnosis_run(const struct diagnosis_request *request, struct diagnosis *out_diagnosis, struct error *out_error)
{
    struct diagnosis *d = out_diagnosis;
    struct work w = {0};
    struct hypothesis h;
    memset(d, 0, sizeof *d);
    tell(request, "reading the motion");
    int status = prepare_recordings(request, &w, d, out_error);
    if (status == 0)
        status = choose_model(request, &w.recordings[0], d, out_error);
    if (status == 0)
        choose_gain(&w, d);
    if (status == 0)
        choose_balance(&w, d);
    if (status == 0)
        choose_hold(&w, d);
    if (status == 0)
        status = look_at_oddities(request, &w, d, out_error);
    if (status == 0)
        status = prepare_evidence(&w, d, out_error);
    if (status == 0) {
        wording_runs(request->fit, request->fit_count, d->runs);
        wording_judged(request, w.parts.first_row, d->judged);
        snprintf(d->motion_from, sizeof d->motion_from, "%s", w.recordings[0].motion_from);
        tell(request, "refitting the given model");
        if (!find_causes(request, &w, d, &h) ||
            !(tell(request, "judging on data the fit has not seen"), conclude(&w, d, &h)))
            status = error_set(out_error, error_refused,
                               "%s: the fit failed: not enough memory, or a model that the data cannot "
                               "determine",
                               request->fit[0].path);
    }
    work_free(&w);
    if (status != 0)
        diagnosis_free(d);
    return status;
}

void diagnosis_free(struct diagnosis *self)
{
    validate_curves_free(&self->curves);
    memset(self, 0, sizeof *self);
}
