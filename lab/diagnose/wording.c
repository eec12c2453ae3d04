/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/wording.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/// Whether torques are in units of what one unit of the input makes.
static bool in_input(const struct diagnosis *self)
{
    return self->input_unit && !self->model_given;
}

const char *wording_input(const struct diagnosis *self)
{
    if (self->input_unit)
        return strcmp(self->input_unit, "V") == 0 ? "voltage" : "current";
    return self->linear ? "force" : "torque";
}

struct wording_units wording_units(const struct diagnosis *self)
{
    const char *speed = self->linear ? "m/s" : "rad/s";
    if (in_input(self))
        return (struct wording_units){wording_input(self), self->input_unit, speed};
    return self->linear ? (struct wording_units){"force", "N", speed} : (struct wording_units){"torque", "Nm", speed};
}

/// Replaces a unit wherever it stands after a space and is not the beginning of another word.
static void replace_unit(const char *unit, const char *by, size_t size, char *io_text)
{
    char out[wording_size];
    size_t used = 0, length = strlen(unit);
    for (const char *at = io_text; *at && used + 1 < sizeof out; at++) {
        bool word = at > io_text && at[-1] == ' ' && strncmp(at, unit, length) == 0 &&
                    !isalnum((unsigned char)at[length]) && at[length] != '/';
        if (word) {
            used += (size_t)snprintf(out + used, sizeof out - used, "%s", by);
            at += length - 1;
            used = used < sizeof out ? used : sizeof out - 1;
        } else {
            out[used++] = *at;
        }
    }
    out[used] = '\0';
    snprintf(io_text, size, "%s", out);
}

/// Takes out deviations of nothing: a number at the edge of what a fit allows it has none, and is not exact either.
static void drop_zero_deviations(char *io_text)
{
    static const char zero[] = " +- 0";
    const size_t length = sizeof zero - 1;
    for (char *at = strstr(io_text, zero); at; at = strstr(at, zero)) {
        if (at[length] == '.' || isalnum((unsigned char)at[length]))
            at += length;
        else
            memmove(at, at + length, strlen(at + length) + 1);
    }
}

void wording_in_units(const struct diagnosis *self, size_t size, char *io_text)
{
    drop_zero_deviations(io_text);
    // Longer units first: "Nm" is the beginning of "Nm s/rad".
    static const struct {
        const char *linear, *rotary, *linear_rest, *rotary_rest;
    } units[] = {{"kg", "kg m2", " s2/m", " s2/rad"},
                 {"N s/m", "Nm s/rad", " s/m", " s/rad"},
                 {"N/m", "Nm/rad", "/m", "/rad"},
                 {"N", "Nm", "", ""}};
    for (size_t i = 0; in_input(self) && i < sizeof units / sizeof units[0]; i++) {
        char by[wording_short];
        snprintf(by, sizeof by, "%s%s", self->input_unit, self->linear ? units[i].linear_rest : units[i].rotary_rest);
        replace_unit(self->linear ? units[i].linear : units[i].rotary, by, size, io_text);
    }
}

void wording_effect(int effect, char out_text[wording_short])
{
    snprintf(out_text, wording_short, "%s", sim_effects[effect]->id);
    for (char *at = out_text; *at; at++) {
        if (*at == '_') {
            *at = ' ';
        }
    }
}

/// The causes' names in one row: "cogging, load bias and inertia"; "" for none.
static void list_names(const struct diagnosis_cause *causes, size_t count, size_t size, char *out_text)
{
    size_t used = 0;
    out_text[0] = '\0';
    for (size_t i = 0; i < count && used < size; i++) {
        char name[wording_short];
        wording_effect(causes[i].effect, name);
        const char *joint = i == 0 ? "" : i + 1 == count ? " and " : ", ";
        used += (size_t)snprintf(out_text + used, size - used, "%s%s", joint, name);
    }
}

void wording_percent(double share, char out_text[wording_short])
{
    double percent = 100.0 * share;
    if (!isfinite(percent)) {
        snprintf(out_text, wording_short, "unknown");
    } else if (fabs(percent) >= 1e5) {
        snprintf(out_text, wording_short, "%.2g %%", percent);
    } else if (fabs(percent) >= 99.95) {
        snprintf(out_text, wording_short, "%.0f %%", percent);
    } else {
        snprintf(out_text, wording_short, "%#.3g %%", percent);
    }
}

void wording_evidence(double nats, char out_text[wording_short])
{
    if (isfinite(nats) && nats <= 0.0)
        snprintf(out_text, wording_short, "none beside the others");
    else
        snprintf(out_text, wording_short, isfinite(nats) ? "%.1f nats" : "unknown", nats);
}

void wording_estimate(double value, double deviation, char out_text[2 * wording_short])
{
    const size_t size = 2 * wording_short;
    if (!isfinite(value)) {
        snprintf(out_text, size, "unknown");
    } else if (!isfinite(deviation)) {
        snprintf(out_text, size, "%.4g ± unknown", value);
    } else if (!(deviation > 0.0)) {
        snprintf(out_text, size, "%.6g ± 0", value); // chosen, or held at its bound
    } else {
        // Two digits of the deviation, and as many places of the value.
        int places = 1 - (int)floor(log10(deviation));
        bool plain = places >= 0 && places <= 6 && fabs(value) < 1e7;
        if (plain) {
            snprintf(out_text, size, "%.*f ± %.*f", places, value, places, deviation);
        } else {
            snprintf(out_text, size, "%.4g ± %.2g", value, deviation);
        }
    }
}

/// Whether the given numbers, moved within what such numbers are usually off by, fit visibly better.
static bool refit_matters(const struct diagnosis *self)
{
    const double visibly = 1.1;
    return self->nominal.mean_rms > visibly * self->refitted.mean_rms;
}

void wording_headline(const struct diagnosis *self, char out_text[wording_size])
{
    char list[wording_size / 2];
    list_names(self->causes, self->cause_count, sizeof list, list);
    bool any = self->cause_count > 0;
    switch (self->verdict) {
    case diagnosis_explained:
        snprintf(out_text, wording_size, any ? "Explained: %s" : "Explained without a further cause%s", list);
        return;
    case diagnosis_unexplained:
        if (any) {
            snprintf(out_text, wording_size, "Not explained as a whole: %s %s, the rest has no name", list,
                     self->cause_count > 1 ? "stand" : "stands");
        } else {
            char might[wording_size / 2];
            list_names(self->candidates, self->candidate_count, sizeof might, might);
            snprintf(out_text, wording_size, "Not explained: no known cause %s%s%s", might[0] ? "stands, " : "fits",
                     might, might[0] ? " might be part of it" : "");
        }
        return;
    case diagnosis_no_discrepancy:
        break;
    }
    const char *how = refit_matters(self) ? "with its own numbers refitted" : "as given";
    snprintf(out_text, wording_size, "No discrepancy: %s the model fits within what the noise allows",
             self->detail_count > 0 ? "with the detail noted" : how);
}

bool wording_is_extended(const struct diagnosis *self)
{
    return self->cause_count + self->candidate_count + self->detail_count > 0;
}

void wording_gain(const struct diagnosis *self, char out_text[wording_size])
{
    struct wording_units units = wording_units(self);
    char nominal[wording_short], refitted[wording_short], extended[wording_short], noise[wording_short];
    wording_percent(self->nominal.validation_nrmse, nominal);
    wording_percent(self->refitted.validation_nrmse, refitted);
    wording_percent(self->extended.validation_nrmse, extended);
    wording_percent(self->noise_floor_nrmse, noise);
    const char *causes = self->cause_count > 1   ? "the causes"
                         : self->cause_count > 0 ? "the cause"
                                                 : "the detail noted";
    const char *what = self->candidate_count > 0 ? "what was found" : causes; // the extended model has both
    char with_causes[2 * wording_short] = "";
    if (wording_is_extended(self)) {
        snprintf(with_causes, sizeof with_causes, ", with %s %s", what, extended);
    }
    snprintf(
        out_text, wording_size,
        "On data the fit has not seen, %s is off by %s of the measured %s (RMS, excited band), with its own numbers "
        "refitted %s%s. The noise alone makes %s.",
        self->model_given ? "the model as given" : "a rigid body without friction", nominal, units.torque, refitted,
        with_causes, noise);
}

double wording_removed_share(const struct diagnosis *self)
{
    double floor_square = self->noise_floor_nrmse * self->noise_floor_nrmse;
    double before = self->nominal.validation_nrmse * self->nominal.validation_nrmse - floor_square;
    double after = self->extended.validation_nrmse * self->extended.validation_nrmse - floor_square;
    return before > 0.0 ? 1.0 - fmax(after, 0.0) / before : NAN;
}

/// The measurement that would show an effect, from its own description; false if it has none.
static bool next_of_effect(int effect, const char *lead, char out_text[wording_size])
{
    char name[wording_short];
    wording_effect(effect, name);
    const char *measure = sim_effects[effect]->measure;
    if (measure) {
        snprintf(out_text, wording_size, "%s %s: measure %s.", lead, name, measure);
    }
    return measure != NULL;
}

/// Whether an effect between the reference and the torque was not tested for because no reference was recorded.
static bool lacks_reference(const struct diagnosis_untestable *untestable)
{
    return sim_effects[untestable->effect]->place == sim_place_actuator &&
           strstr(untestable->why, "reference was recorded");
}

const char *wording_measure(const struct diagnosis_untestable *untestable)
{
    return lacks_reference(untestable) ? "what the controller asks for as well (the reference)"
                                       : sim_effects[untestable->effect]->measure;
}

void wording_detail(const struct diagnosis_cause *detail, struct oddities *io_oddities)
{
    oddities_add(io_oddities, "%s Every drive has some: it is in the extended model, but no cause.", detail->says);
}

const char *wording_refit(const struct diagnosis *self)
{
    const double visibly = 1.1;
    bool worse = self->refitted.validation_nrmse > visibly * self->nominal.validation_nrmse;
    if (self->extended.validation_nrmse > 1.0 && wording_is_extended(self))
        return "An error above 100 % is further from the measured torque than no model at all would be: the motion is "
               "recorded too coarsely to say what accelerates, or the structure is another one.";
    return worse ? "Refitting made the error larger: a fit weighs every frequency by its noise, this error does not. A "
                   "wrong "
                   "structure fits where the noise is smallest and pays for it elsewhere."
                 : NULL;
}

/// What would show the effects not tested for; those that wait for the same column in one sentence.
static size_t next_of_untestable(const struct diagnosis *self, size_t max, char (*out_texts)[wording_size])
{
    struct diagnosis_cause waiting[sim_effects_max] = {{0}};
    size_t count = 0, waiting_count = 0;
    for (size_t i = 0; i < self->untestable_count; i++) {
        if (lacks_reference(&self->untestable[i]))
            waiting[waiting_count++].effect = self->untestable[i].effect;
        else if (count < max)
            count += next_of_effect(self->untestable[i].effect, "To test for", out_texts[count]);
    }
    if (waiting_count > 0 && count < max) {
        char list[wording_size / 2];
        list_names(waiting, waiting_count, sizeof list, list);
        snprintf(out_texts[count++], wording_size,
                 "To test for %s: record beside the %s what the controller asked for (its reference).", list,
                 wording_input(self));
    }
    return count;
}

/// While something is unexplained: what would confirm the candidates, and what would show the effects not tested for.
static size_t next_of_open(const struct diagnosis *self, size_t max, char (*out_texts)[wording_size])
{
    size_t count = 0;
    if (max > 0)
        wording_closer(self, out_texts[count++]);
    for (size_t i = 0; i < self->candidate_count && count < max; i++)
        count += next_of_effect(self->candidates[i].effect, "To confirm or rule out", out_texts[count]);
    return count + next_of_untestable(self, max - count, out_texts + count);
}

/// What is worth taking over into the model, NULL if nothing is.
static const char *next_of_model(const struct diagnosis *self)
{
    if (self->verdict == diagnosis_explained && self->cause_count > 0) {
        return "Take over the extended model (--extended M.json writes it; servoscope simulate and measure --drive "
               "sim:M.json run it).";
    }
    if (self->verdict == diagnosis_no_discrepancy && refit_matters(self)) {
        return "Take over the refitted numbers (--extended M.json writes them).";
    }
    return NULL;
}

size_t wording_next(const struct diagnosis *self, size_t max, char (*out_texts)[wording_size])
{
    size_t count = 0;
    for (; count < self->tie_count && count < max; count++) {
        char one[wording_short], other[wording_short];
        wording_effect(self->ties[count].effects[0], one);
        if (self->ties[count].effects[1] == diagnosis_gain)
            snprintf(other, sizeof other, "the gain of the input");
        else
            wording_effect(self->ties[count].effects[1], other);
        snprintf(out_texts[count], wording_size, "To tell %s from %s: %s.", one, other, self->ties[count].next);
    }
    if (self->verdict == diagnosis_unexplained) {
        count += next_of_open(self, max - count, out_texts + count);
    }
    if (self->held_back && count < max) {
        snprintf(out_texts[count++], wording_size,
                 "Record a second run with other phases and give it with --validate: now a part of the only run stands "
                 "in for it.");
    }
    const char *take_over = next_of_model(self);
    if (take_over && count < max) {
        snprintf(out_texts[count++], wording_size, "%s", take_over);
    }
    return count;
}

void wording_runs(const struct run *runs, size_t count, char out_text[wording_runs_size])
{
    size_t used = 0;
    out_text[0] = '\0';
    for (size_t i = 0; i < count && used < wording_runs_size - 1; i++)
        used += (size_t)snprintf(out_text + used, wording_runs_size - used, "%s%s", i > 0 ? ", " : "",
                                 runs[i].path ? runs[i].path : "run");
}

void wording_judged(const struct diagnosis_request *request, size_t held_from, char out_text[wording_runs_size])
{
    const struct run *first = &request->fit[0];
    const char *name = first->path ? first->path : "the only run";
    size_t n = first->period_samples;
    if (request->validate_count > 0)
        wording_runs(request->validate, request->validate_count, out_text);
    else if (n > 0 && held_from % n == 0)
        snprintf(out_text, wording_runs_size, "periods %zu to %zu of %s", held_from / n + 1, first->rows / n, name);
    else
        snprintf(out_text, wording_runs_size, "%s from %.4g s on", name, (double)held_from / first->sample_rate_hz);
}
