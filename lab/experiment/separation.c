/* SPDX-License-Identifier: MIT */
#include "lab/experiment/separation.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const double separation_tie_nats = 6.0;

/// Runs of one separation have noise of their own: seeds lie this far apart, room for the tables of an excitation.
static const uint64_t seed_step = 16;

/// Seeds by purpose.
enum { repeats = 3, seed_of_sizes = 0, seed_of_candidates, seed_of_checks = seed_of_candidates + 2 * repeats };

struct work {
    const struct separation_request *request;
    struct separation *separation;
    size_t first; ///< index of the cause whose size is known; the other one imitates it
    size_t done, total;
};

static bool add_id(char *text, size_t size, const char *id)
{
    size_t used = strlen(text);
    return (size_t)snprintf(text + used, size - used, "%s%s", used > 0 ? ", " : "", id) < size - used;
}

static int find_cause(const char *id, int *out_effect, struct error *out_error)
{
    char ids[700] = "";
    *out_effect = sim_effect_find(id);
    for (int e = 0; sim_effects[e] && add_id(ids, sizeof ids, sim_effects[e]->id); e++) {
    }
    return *out_effect >= 0
               ? 0
               : error_set(out_error, error_usage, "--separate: no cause is called '%s', expected one of %s", id, ids);
}

int separation_parse(const char *text, int out_effects[2], struct error *out_error)
{
    char first[64] = "";
    const char *comma = strchr(text, ',');
    if (!comma || strchr(comma + 1, ',') || (size_t)(comma - text) >= sizeof first)
        return error_set(out_error, error_usage, "--separate: '%s', expected two causes, CAUSE,CAUSE", text);
    memcpy(first, text, (size_t)(comma - text));
    int status = find_cause(first, &out_effects[0], out_error);
    status = status ? status : find_cause(comma + 1, &out_effects[1], out_error);
    if (!status && out_effects[0] == out_effects[1])
        return error_set(out_error, error_usage, "--separate: '%s' is one and the same cause, expected two", text);
    return status;
}

void separation_free(struct separation *self)
{
    for (size_t i = 0; i < variant_kinds; i++)
        variant_free(&self->candidates[i].excitation);
}

static int tell(struct work *w, const char *what, struct error *out_error)
{
    const struct separation_request *r = w->request;
    if (r->progress && !r->progress(r->user, what, w->done, w->total))
        return error_set(out_error, error_refused, "interrupted: nothing was written");
    w->done++;
    return 0;
}

static int play(const struct work *w, const struct variant *excitation, const struct sim_model *drive, uint64_t seed,
                struct contest *out_contest, struct error *out_error)
{
    struct sim_model seeded = *drive;
    seeded.seed = w->request->model->seed + seed_step * seed;
    return contest_init(out_contest, &w->request->door, excitation, &seeded, &w->separation->given, out_error);
}

/// One direction: a drive with cause `index`, which the other one tries to explain.
static int compete(const struct work *w, const struct variant *excitation, size_t index, uint64_t seed,
                   struct contest_outcome *out_outcome, struct error *out_error)
{
    const struct separation_cause *cause = &w->separation->causes[index], *rival = &w->separation->causes[1 - index];
    struct contest contest;
    int status = play(w, excitation, &cause->drive, seed, &contest, out_error);
    if (status)
        return status;
    if (!contest_decide(&contest, cause->effect, cause->values, rival->effect, rival->has_values ? rival->values : NULL,
                        out_outcome))
        status = error_set(out_error, error_refused, "%s cannot be fitted to its own simulation",
                           sim_effects[cause->effect]->id);
    contest_free(&contest);
    return status;
}

static int take_causes_out(struct work *w, struct error *out_error)
{
    struct separation *s = w->separation;
    s->given = *w->request->model;
    for (size_t i = 0; i < 2; i++)
        cause_take_out(w->request->effects[i], &s->given, &s->causes[i]);
    int status = cause_check(s->causes[0].effect, &s->given, out_error);
    status = status ? status : cause_check(s->causes[1].effect, &s->given, out_error);
    w->first = s->causes[0].source != separation_of_model && s->causes[1].source == separation_of_model;
    return status;
}

static int design_candidates(struct work *w, struct error *out_error)
{
    struct separation *s = w->separation;
    int status = 0;
    for (size_t i = 0; !status && i < variant_longer; i++) {
        status = tell(w, "designing", out_error);
        status = status ? status
                        : variant_design(&w->request->basis, (enum variant_kind)i,
                                         &s->candidates[variant_as_given].excitation, &s->candidates[i].excitation,
                                         out_error);
    }
    return status;
}

/// Plays a drive with a cause as the excitation as given moves it.
static int try_size(void *user, const struct separation_cause *cause, double *out_nats, struct error *out_error)
{
    const struct work *w = user;
    struct contest contest;
    const struct variant *given = &w->separation->candidates[variant_as_given].excitation;
    int status = play(w, given, &cause->drive, seed_of_sizes, &contest, out_error);
    if (status)
        return status;
    *out_nats = fmax(contest_evidence(&contest, cause->effect, cause->values), 0.0);
    contest_free(&contest);
    return 0;
}

/// Sizes that nobody has said.
static int choose_size(struct work *w, const struct contest *without, struct separation_cause *cause,
                       struct error *out_error)
{
    const struct cause_trial trial = {.without = without, .evidence = try_size, .user = w};
    int status = 0;
    if (cause->source == separation_of_scan)
        status = cause_choose_size(&trial, cause, out_error);
    if (!status)
        cause_make_drive(&w->separation->given, cause);
    return status;
}

/// The first cause as the model or its scan has it; the second as it imitates the first best, if it does at all.
static int choose_sizes(struct work *w, struct error *out_error)
{
    struct separation *s = w->separation;
    const struct variant *given = &s->candidates[variant_as_given].excitation;
    struct separation_cause *first = &s->causes[w->first], *second = &s->causes[1 - w->first];
    struct contest without;
    struct contest_outcome outcome;
    int status = tell(w, "choosing sizes", out_error);
    status = status ? status : play(w, given, &s->given, seed_of_sizes, &without, out_error);
    if (status)
        return status;
    status = choose_size(w, &without, first, out_error);
    status = status ? status : compete(w, given, w->first, seed_of_sizes, &outcome, out_error);
    if (!status && outcome.rival.named[second->effect] && outcome.rival_evidence > 2.0 * separation_tie_nats) {
        double unused[sim_effect_parameters_max];
        hypothesis_parameters(&outcome.rival, second->effect, NULL, second->values, unused);
        hypothesis_model(&outcome.rival, NULL, &second->drive);
        second->source = separation_of_rival;
        second->has_values = true;
    } else if (!status) {
        status = choose_size(w, &without, second, out_error);
    }
    contest_free(&without);
    return status;
}

/// Beyond this the right cause does not explain its own simulation: what else would be said there means nothing.
static const double most_misfit = 4.0;

/// What one excitation says of both directions under one noise.
struct verdict {
    double nats; ///< the smaller
    double evidence[2], misfit[2];
};

static int compete_both(const struct work *w, const struct variant *excitation, uint64_t seed,
                        struct verdict *out_verdict, struct error *out_error)
{
    out_verdict->nats = INFINITY;
    for (size_t i = 0; i < 2; i++) {
        struct contest_outcome outcome;
        int status = compete(w, excitation, i, seed + i, &outcome, out_error);
        if (status)
            return status;
        out_verdict->nats = fmin(out_verdict->nats, outcome.nats);
        out_verdict->evidence[i] = outcome.evidence;
        out_verdict->misfit[i] = outcome.misfit;
    }
    return 0;
}

static int check_misfit(const struct separation *s, const struct verdict *verdict, struct error *out_error)
{
    for (size_t i = 0; i < 2; i++)
        if (!(verdict->misfit[i] <= most_misfit))
            return error_set(out_error, error_refused,
                             "diagnosis does not explain %s there, even knowing it: misfit %.3g, expected about 1",
                             sim_effects[s->causes[i].effect]->id, verdict->misfit[i]);
    return 0;
}

/// The mean over a few noises of one excitation. One that cannot be played on these drives, or not be explained, is no
/// candidate.
static int measure_candidate(struct work *w, struct separation_candidate *c, struct error *out_error)
{
    struct error why = {0};
    int status = tell(w, c->excitation.says, out_error), failed = 0;
    if (status || c->excitation.table_count == 0)
        return status;
    c->nats = c->evidence[0] = c->evidence[1] = 0.0;
    for (uint64_t i = 0; !failed && i < repeats; i++) {
        struct verdict verdict;
        failed = compete_both(w, &c->excitation, seed_of_candidates + 2 * i, &verdict, &why);
        failed = failed ? failed : check_misfit(w->separation, &verdict, &why);
        if (failed)
            break;
        c->nats += verdict.nats / repeats;
        c->evidence[0] += verdict.evidence[0] / repeats;
        c->evidence[1] += verdict.evidence[1] / repeats;
    }
    c->measured = !failed;
    if (failed)
        snprintf(c->excitation.why_not, sizeof c->excitation.why_not, "%.*s", (int)sizeof c->excitation.why_not - 1,
                 why.message);
    return 0;
}

/// The cheapest that is enough, else the best that is more than a tie.
static void choose(const struct separation_request *request, struct separation *s)
{
    s->chosen = -1;
    s->enough = false;
    for (int i = 0; i < variant_kinds; i++) {
        const struct separation_candidate *c = &s->candidates[i];
        if (!c->measured || !(c->nats >= separation_tie_nats))
            continue;
        bool enough = c->nats >= request->enough_nats;
        const struct separation_candidate *best = s->chosen >= 0 ? &s->candidates[s->chosen] : NULL;
        bool better = !best || (enough && !s->enough) || (!enough && !s->enough && c->nats > best->nats) ||
                      (enough && s->enough && c->excitation.test_time_s < best->excitation.test_time_s);
        if (better) {
            s->chosen = i;
            s->enough = enough;
        }
    }
}

/// The one that gains most in a second; NULL: none gains anything.
static const struct separation_candidate *most_promising(const struct separation *s)
{
    const double promising_nats = 1.0;
    const struct separation_candidate *best = NULL;
    for (size_t i = 0; i < variant_longer; i++) {
        const struct separation_candidate *c = &s->candidates[i];
        if (c->measured && c->nats > promising_nats &&
            (!best || c->nats / c->excitation.test_time_s > best->nats / best->excitation.test_time_s))
            best = c;
    }
    return best;
}

/// Where none is enough: the most promising one for as long as it takes. Nats grow with the periods, if not exactly:
/// what few periods say of the noise is a guess.
static int prolong_best(struct work *w, struct error *out_error)
{
    enum { passes = 3 };
    const double margin = 1.3, most_times = 16.0;
    struct separation *s = w->separation;
    struct separation_candidate *longer = &s->candidates[variant_longer];
    const struct separation_candidate *best = most_promising(s);
    double nats = best ? best->nats : 0.0, times = 1.0;
    int status = 0;
    if (!best)
        snprintf(longer->excitation.why_not, sizeof longer->excitation.why_not, "none separates them");
    for (int pass = 0; !status && nats > 0.0 && nats < w->request->enough_nats && pass < passes; pass++) {
        double needed = ceil(times * margin * w->request->enough_nats / nats);
        if (!(times < most_times))
            break;
        times = fmin(fmax(needed, times + 1.0), most_times);
        variant_free(&longer->excitation);
        status = variant_prolong(&best->excitation, (size_t)times, &longer->excitation, out_error);
        status = status ? status : measure_candidate(w, longer, out_error);
        nats = longer->measured ? longer->nats : 0.0;
    }
    return status;
}

static int check_chosen(struct work *w, struct error *out_error)
{
    struct separation *s = w->separation;
    int status = 0;
    for (s->checked = 0; !status && s->chosen >= 0 && s->checked < separation_checks; s->checked++) {
        struct verdict verdict;
        status = tell(w, "checking with fresh noise", out_error);
        status = status ? status
                        : compete_both(w, &s->candidates[s->chosen].excitation, seed_of_checks + 2 * s->checked,
                                       &verdict, out_error);
        if (!status)
            s->checked_nats[s->checked] = verdict.nats;
    }
    return status;
}

/// Why nothing separates them: too small to be seen at all, or alike in every motion.
static void explain(struct separation *s)
{
    const char *ids[2] = {sim_effects[s->causes[0].effect]->id, sim_effects[s->causes[1].effect]->id};
    double evidence[2] = {0.0, 0.0}, most = -INFINITY;
    for (size_t i = 0; i < variant_kinds; i++)
        for (size_t cause = 0; s->candidates[i].measured && cause < 2; cause++) {
            evidence[cause] = fmax(evidence[cause], s->candidates[i].evidence[cause]);
            most = fmax(most, s->candidates[i].nats);
        }
    size_t fainter = evidence[1] < evidence[0];
    if (isinf(most))
        snprintf(
            s->reason, sizeof s->reason,
            "%.200s under the excitation as given, and likewise under the others: more noise than the model has, or "
            "another size, may help",
            s->candidates[variant_as_given].excitation.why_not);
    else if (evidence[fainter] < 2.0 * separation_tie_nats)
        snprintf(s->reason, sizeof s->reason,
                 "%s is too small to be seen: %.3g nats over the model without it at best; it takes a larger one, less "
                 "noise or more time to say what it is",
                 ids[fainter], evidence[fainter]);
    else
        snprintf(s->reason, sizeof s->reason,
                 "%s and %s do the same in every motion tried: seen with %.0f and %.0f nats, they differ by %.1f at "
                 "most; within these limits they are one cause under two names, so take the simpler one",
                 ids[0], ids[1], evidence[0], evidence[1], fmax(most, 0.0));
}

int separation_run(const struct separation_request *request, struct separation *out_separation, struct error *out_error)
{
    struct separation *s = out_separation;
    struct work w = {.request = request, .separation = s, .total = 2 * variant_kinds + 1 + separation_checks};
    memset(s, 0, sizeof *s);
    s->chosen = -1;
    s->candidates[variant_longer].excitation = (struct variant){.kind = variant_longer, .why_not = "not needed"};
    int status = take_causes_out(&w, out_error);
    status = status ? status : design_candidates(&w, out_error);
    status = status ? status : choose_sizes(&w, out_error);
    for (size_t i = 0; !status && i < variant_longer; i++)
        status = measure_candidate(&w, &s->candidates[i], out_error);
    if (!status) {
        choose(request, s);
        status = s->enough ? 0 : prolong_best(&w, out_error);
    }
    if (!status) {
        choose(request, s);
        status = check_chosen(&w, out_error);
    }
    if (!status && s->chosen < 0)
        explain(s);
    if (status)
        separation_free(s);
    return status;
}

void separation_describe_cause(const struct separation *self, size_t index, char *out_text, size_t size)
{
    static const char *const from[] = {
        [separation_of_model] = "as the model has it",
        [separation_of_scan] = "a size that the excitation as given shows clearly",
        [separation_of_rival] = "where it imitates the other best under the excitation as given",
    };
    const struct separation_cause *cause = &self->causes[index];
    const struct sim_effect *e = sim_effects[cause->effect];
    size_t used = (size_t)snprintf(out_text, size, "%s", e->id);
    for (size_t i = 0; i < e->parameter_count && used < size; i++) {
        const struct sim_parameter *p = &e->parameters[i];
        used += (size_t)snprintf(out_text + used, size - used, "%s %s %.4g", i > 0 ? "," : ":",
                                 self->given.linear ? p->linear_name : p->name, cause->values[i]);
    }
    if (used < size)
        snprintf(out_text + used, size - used, " (%s)", from[cause->source]);
}
