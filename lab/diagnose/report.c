/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/report.h"

#include "lab/diagnose/report_curves.h"
#include "lab/diagnose/report_misfit.h"
#include "lab/diagnose/wording.h"
#include "lab/record/atomic_file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { sentences_max = 24 };

/// The catalogue's sentences are plain ASCII for the terminal; a page has the sign.
static void with_signs(const char *text, char out_text[wording_size])
{
    size_t used = 0;
    for (const char *at = text; *at && used + 3 < wording_size; at++) {
        if (at[0] == '+' && at[1] == '-') {
            memcpy(out_text + used, "±", strlen("±"));
            used += strlen("±");
            at++;
        } else {
            out_text[used++] = *at;
        }
    }
    out_text[used] = '\0';
}

/// What the last of the models is called: where nothing was found it is the refitted one.
static const char *best_model(const struct diagnosis *self)
{
    return wording_is_extended(self) ? "extended" : "refitted";
}

static void add_verdict(struct page *page, const struct diagnosis *self)
{
    char headline[wording_size], gain[wording_size], removed_text[wording_short], sentence[wording_size] = "";
    wording_headline(self, headline);
    wording_gain(self, gain);
    double removed = wording_removed_share(self);
    wording_percent(removed, removed_text);
    if (self->cause_count > 0 && isfinite(removed) && removed > 0.0) {
        snprintf(sentence, sizeof sentence, " The extended model takes away %s of the squared error that is not noise.",
                 removed_text);
    }
    char left[wording_size] = "";
    if (self->verdict == diagnosis_unexplained) {
        wording_left(self, left);
        strcat(left, ".");
    }
    enum page_mood mood = self->verdict == diagnosis_unexplained ? page_warning : page_good;
    page_add_note(page, mood, headline, "%s%s%s%s", gain, sentence, left[0] ? " " : "", left);
}

/// The given model in one line: what it has, in its own numbers.
static void describe_model(const struct diagnosis *self, char out_text[wording_size])
{
    const struct sim_model *m = &self->given;
    const char *mass = self->linear ? "kg" : "kg m²";
    const char *damping = self->linear ? "N s/m" : "Nm s/rad";
    struct wording_units units = wording_units(self);
    int used = 0;
    if (m->structure == sim_structure_two_mass) {
        used = snprintf(out_text, wording_size, "two masses of %.4g and %.4g %s on a belt of %.4g %s",
                        m->motor_inertia_kgm2, m->load_inertia_kgm2, mass, m->belt_stiffness_Nm_per_rad,
                        self->linear ? "N/m" : "Nm/rad");
    } else {
        used = snprintf(out_text, wording_size, "rigid body of %.4g %s", m->motor_inertia_kgm2 + m->load_inertia_kgm2,
                        mass);
    }
    used += snprintf(out_text + used, wording_size - (size_t)used,
                     ", viscous friction %.4g %s, Coulomb friction %.4g %s, torque lag %.4g ms, dead time %.4g ms",
                     m->viscous_friction_Nms_per_rad, damping, m->coulomb_friction_Nm, units.torque_unit,
                     1e3 * m->torque_lag_s, 1e3 * m->dead_time_s);
    for (int e = 0; sim_effects[e] && used < wording_size; e++) {
        if (m->effect_on[e]) {
            char name[wording_short];
            wording_effect(e, name);
            used += snprintf(out_text + used, wording_size - (size_t)used, ", %s", name);
        }
    }
}

static void add_given(struct page *page, const struct diagnosis *self)
{
    char model[wording_size];
    describe_model(self, model);
    page_add_section(page, "What was given");
    page_start_pairs(page);
    page_add_pair(page, "Fitted on", "%s", self->runs);
    page_add_pair(page, "Judged on", "%s, which the fit has not seen", self->judged);
    page_add_pair(page, "Model", "%s",
                  self->model_given ? model : "none: a rigid body without friction, its inertia free");
    if (self->motion_from[0] != '\0') {
        page_add_pair(page, "Motion", "%s", self->motion_from);
    }
    for (size_t i = 0; i < self->oddities.count; i++)
        if (self->motion_from[0] == '\0' || !strstr(self->oddities.texts[i], self->motion_from))
            page_add_pair(page, "Note", "%s", self->oddities.texts[i]);
    if (self->curves.rate_hz > 0.0 && self->curves.samples > 0) {
        page_add_pair(page, "Curves below", "%zu samples at %.6g Hz (%.4g s) of the data judged on",
                      self->curves.samples, self->curves.rate_hz, (double)self->curves.samples / self->curves.rate_hz);
    }
    page_end_pairs(page);
}

static void add_excess(struct page *page, const struct diagnosis *self)
{
    const struct diagnosis_curves *c = &self->curves;
    struct report_excess before = report_excess_find(c, c->nominal_Nm), after = report_excess_find(c, c->extended_Nm);
    page_add_paragraph(
        page,
        "The given model's error is larger than noise explains (two standard deviations) at %zu of %zu lines, worst at "
        "%.4g Hz, by a factor of %.4g; the %s model's at %zu of them, worst at %.4g Hz, by a factor of %.4g. Of a "
        "perfect "
        "model's lines about 2 in 100 would be above by chance, %.0f here.",
        before.above, before.bins, before.worst_hz, before.worst, best_model(self), after.above, after.worst_hz,
        after.worst,
        exp(-4.0) * (double)after.bins); // |z|^2 of a circular complex Gaussian is exponential: P(|z| > 2 sigma) = e^-4
}

static void add_bands(struct figure_panel *panel, const char *name, const struct report_bands *bands,
                      const double *values, enum figure_colour colour, enum figure_marker marker)
{
    struct figure_series *points = figure_add_points(panel, name, bands->count, bands->frequency_hz, values);
    points->colour = colour;
    points->marker = marker;
}

static void add_spectrum(struct page *page, const struct diagnosis *self)
{
    struct wording_units units = wording_units(self);
    struct report_bands bands;
    struct figure figure;
    report_bands_find(&self->curves, &bands);
    if (bands.count == 0) {
        page_add_paragraph(page, "There are no spectra to compare.");
        return;
    }
    add_excess(page, self);
    char label[figure_text_max];
    snprintf(label, sizeof label, "%s error over two standard deviations of the noise", units.torque);
    figure_start(&figure, "frequency in Hz", bands.logarithmic ? axis_log : axis_linear);
    figure.legend = figure_legend_below;
    struct figure_panel *panel = figure_add_panel(&figure, label, axis_log);
    panel->height = 230;
    add_bands(panel, "model as given", &bands, bands.nominal, figure_vermilion, figure_triangle);
    if (wording_is_extended(self)) {
        add_bands(panel, "refitted", &bands, bands.refitted, figure_orange, figure_diamond);
    }
    add_bands(panel, best_model(self), &bands, bands.extended, figure_green, figure_circle);
    figure_add_limit(panel, "what noise explains", 1.0);
    char grouping[80] = "one point per line";
    if (bands.widest > 1) {
        snprintf(grouping, sizeof grouping, "RMS over bands of up to %zu neighbouring lines", bands.widest);
    }
    page_add_figure(page, &figure,
                    "How far each model's %s is off, by frequency, in units of two standard deviations (%s).",
                    units.torque, grouping);
}

/// The error of both models in panels of one scale.
static void add_error_panels(struct figure *figure, const struct diagnosis *self, size_t from, size_t count)
{
    const struct diagnosis_curves *c = &self->curves;
    struct wording_units units = wording_units(self);
    const char *const names[] = {"model as given", best_model(self)};
    const double *const errors[] = {c->residual_nominal + from, c->residual_extended + from};
    const enum figure_colour colours[] = {figure_vermilion, figure_green};
    double largest = 0.0;
    for (size_t i = 0; i < count; i++)
        largest = fmax(largest, fmax(fabs(errors[0][i]), fabs(errors[1][i]))); // fmax leaves out what is no number
    for (size_t m = 0; m < 2; m++) {
        char label[figure_text_max];
        snprintf(label, sizeof label, "%s error in %s, %s", units.torque, units.torque_unit, names[m]);
        struct figure_panel *panel = figure_add_panel(figure, label, axis_linear);
        panel->height = 110;
        if (largest > 0.0) {
            panel->low = -largest;
            panel->high = largest;
        }
        struct figure_series *line = figure_add_line(panel, "", count, c->time_s + from, errors[m]);
        line->colour = colours[m];
        line->dash = figure_solid;
    }
}

/// A twentieth of the block around the worst place, but enough samples to see the shape of an event.
static size_t zoom_width(size_t samples)
{
    const size_t least = 100;
    size_t width = samples / 20;
    width = width < least ? least : width;
    return width > samples ? samples : width;
}

static void add_time(struct page *page, const struct diagnosis *self)
{
    const struct diagnosis_curves *c = &self->curves;
    struct wording_units units = wording_units(self);
    if (c->samples < 2) {
        return;
    }
    struct figure figure;
    figure_start(&figure, "time in s", axis_linear);
    figure.legend = figure_legend_below;
    add_error_panels(&figure, self, 0, c->samples);
    page_add_figure(page, &figure,
                    "The %s that each model lacks over time, in the band looked at: %.3g %s RMS as given, %.3g %s "
                    "%s.",
                    units.torque, report_rms(c->residual_nominal, c->samples), units.torque_unit,
                    report_rms(c->residual_extended, c->samples), units.torque_unit, best_model(self));

    size_t width = zoom_width(c->samples), from = report_worst_stretch(c, width);
    char label[figure_text_max];
    snprintf(label, sizeof label, "speed in %s", units.speed_unit);
    figure_start(&figure, "time in s", axis_linear);
    figure.legend = figure_legend_below;
    add_error_panels(&figure, self, from, width);
    struct figure_panel *panel = figure_add_panel(&figure, label, axis_linear);
    panel->height = 110;
    figure_add_line(panel, "measured speed", width, c->time_s + from, c->velocity + from)->colour = figure_blue;
    page_add_figure(page, &figure,
                    "The same around the worst %.3g s of the given model, from %.4g s on, with the speed.",
                    (double)width / c->rate_hz, c->time_s[from]);
}

static void add_parameter_rows(struct page *page, const struct diagnosis_cause *cause, bool linear)
{
    const struct sim_effect *effect = sim_effects[cause->effect];
    char name[wording_short], evidence[wording_short];
    wording_effect(cause->effect, name);
    wording_evidence(cause->evidence, evidence);
    for (size_t i = 0; i < effect->parameter_count; i++) {
        const struct sim_parameter *parameter = &effect->parameters[i];
        char estimate[2 * wording_short], given[wording_short];
        wording_estimate(cause->values[i], cause->deviations[i], estimate);
        snprintf(given, sizeof given, "%.5g", cause->nominal[i]);
        const char *cells[] = {i == 0 ? name : "", linear ? parameter->linear_name : parameter->name, given, estimate,
                               i == 0 ? evidence : ""};
        page_add_row(page, cells);
    }
}

static void add_cause_list(struct page *page, const struct diagnosis *self, const struct diagnosis_cause *causes,
                           size_t count, const char *caption)
{
    static const char *const heads[] = {"cause", "parameter", "given", "estimate ± std", "evidence"};
    page_start_list(page);
    for (size_t i = 0; i < count; i++) {
        char name[wording_short], says[wording_size], unseen[wording_size];
        wording_effect(causes[i].effect, name);
        with_signs(causes[i].says, says);
        wording_unseen(self, &causes[i], unseen);
        page_add_item(page, name, "%s%s%s", says, unseen[0] ? " " : "", unseen);
    }
    page_end_list(page);
    page_start_table(page, caption, "llrrr", heads);
    for (size_t i = 0; i < count; i++) {
        add_parameter_rows(page, &causes[i], self->linear);
    }
    page_end_table(page);
}

static const char *why_no_cause(const struct diagnosis *self)
{
    if (self->verdict != diagnosis_no_discrepancy) {
        return "None stands: whatever was tried, a function without a name explains the data better.";
    }
    return self->candidate_count > 0 ? "None is large enough to be claimed."
                                     : "None is needed: no known cause earns more than its parameters would by chance.";
}

static void add_causes(struct page *page, const struct diagnosis *self)
{
    page_add_section(page, self->cause_count == 1 ? "The cause" : "The causes");
    if (self->cause_count == 0) {
        page_add_paragraph(page, "%s", why_no_cause(self));
    } else {
        add_cause_list(
            page, self, self->causes, self->cause_count,
            "Estimates as totals, as in the extended model's file. Evidence is what the fit's log-likelihood "
            "loses without the cause.");
    }
    if (self->candidate_count > 0) {
        page_add_subsection(page, "What might be, without being claimed");
        add_cause_list(page, self, self->candidates, self->candidate_count,
                       self->verdict == diagnosis_unexplained
                           ? "They lower the error, but do not stand where a black box may explain the rest."
                           : "They lower the error by more than chance would, but by too little to be claimed.");
    }
}

static void add_friction(struct page *page, const struct diagnosis *self)
{
    const struct diagnosis_curves *c = &self->curves;
    struct wording_units units = wording_units(self);
    struct report_friction *friction = malloc(sizeof *friction);
    if (!friction || c->curve_points < 2) {
        free(friction);
        return;
    }
    report_friction_find(c, friction);
    char x[figure_text_max], y[figure_text_max], spread[wording_size] = "";
    snprintf(x, sizeof x, "speed in %s", units.speed_unit);
    snprintf(y, sizeof y, "friction %s in %s", units.torque, units.torque_unit);
    struct figure figure;
    figure_start(&figure, x, axis_linear);
    figure.legend = figure_legend_below;
    struct figure_panel *panel = figure_add_panel(&figure, y, axis_linear);
    panel->height = 230;
    struct figure_series *points =
        figure_add_points(panel, "measured", friction->count, friction->velocity, friction->torque);
    points->colour = figure_sky;
    points->size = 3;
    struct figure_series *given =
        figure_add_line(panel, "model as given", c->curve_points, c->curve_velocity, c->curve_nominal);
    given->colour = figure_vermilion;
    given->dash = figure_dashed;
    struct figure_series *extended =
        figure_add_line(panel, best_model(self), c->curve_points, c->curve_velocity, c->curve_extended);
    extended->colour = figure_ink;
    extended->dash = figure_solid;
    if (isfinite(friction->spread)) {
        snprintf(spread, sizeof spread, " They scatter about the %s model's curve by %.3g %s RMS, standstill apart.",
                 best_model(self), friction->spread, units.torque_unit);
    }
    page_add_section(page, "Friction against speed");
    page_add_figure(page, &figure,
                    "Points: the measured %s less what moves masses, belt and whatever depends on position "
                    "(%zu of %zu samples).%s",
                    units.torque, friction->count, c->samples, spread);
    free(friction);
}

static void add_figures_row(struct page *page, const char *name, struct diagnosis_figures figures)
{
    char error[wording_short], whitened[wording_short];
    wording_percent(figures.validation_nrmse, error);
    snprintf(whitened, sizeof whitened, isfinite(figures.whitened_rms) ? "%.3f" : "unknown", figures.whitened_rms);
    const char *cells[] = {name, error, whitened};
    page_add_row(page, cells);
}

static void add_gain(struct page *page, const struct diagnosis *self)
{
    static const char *const names[] = {"model as given", "refitted", "extended"};
    static const char *const heads[] = {"model", "error on unseen data", "one-step errors over expected"};
    struct wording_units units = wording_units(self);
    const double percent[] = {100.0 * self->nominal.validation_nrmse, 100.0 * self->refitted.validation_nrmse,
                              100.0 * self->extended.validation_nrmse};
    char label[figure_text_max];
    snprintf(label, sizeof label, "%s error in %% of the measured %s", units.torque, units.torque);
    struct figure figure;
    figure_start(&figure, "", axis_linear);
    figure.legend = figure_legend_below;
    size_t models = wording_is_extended(self) ? 3 : 2;
    figure_set_categories(&figure, models, names);
    struct figure_panel *panel = figure_add_panel(&figure, label, axis_linear);
    panel->from_zero = true;
    figure_add_bars(panel, "on data the fit has not seen", models, NULL, percent)->colour = figure_blue;
    if (isfinite(self->noise_floor_nrmse)) {
        figure_add_limit(panel, "noise floor", 100.0 * self->noise_floor_nrmse);
    }
    char noise[wording_short];
    wording_percent(self->noise_floor_nrmse, noise);
    page_add_section(page, "Before and after");
    page_add_figure(page, &figure,
                    "RMS of what the model's %s is off for the measured motion, in the excited band, over the RMS "
                    "of the measured %s. A perfect model would be at the noise floor, %s.",
                    units.torque, units.torque, noise);
    page_start_table(page,
                     "Refitted: the given structure, its own numbers moved within what such numbers are usually off "
                     "by. One-step errors: RMS over "
                     "their expected standard deviation, 1 for a perfect model.",
                     "lrr", heads);
    add_figures_row(page, names[0], self->nominal);
    add_figures_row(page, names[1], self->refitted);
    if (models == 3) {
        add_figures_row(page, names[2], self->extended);
    }
    page_end_table(page);
    const char *remark = wording_refit(self);
    if (remark) {
        page_add_paragraph(page, "%s", remark);
    }
}

static void add_untestable(struct page *page, const struct diagnosis *self)
{
    static const char *const heads[] = {"cause", "why not", "what to measure"};
    page_add_section(page, "What these recordings cannot tell");
    if (self->untestable_count == 0) {
        page_add_paragraph(page, "Every cause that is known would have shown.");
        return;
    }
    page_start_table(page, "Causes that were not tested for.", "lll", heads);
    for (size_t i = 0; i < self->untestable_count; i++) {
        char name[wording_short];
        wording_effect(self->untestable[i].effect, name);
        const char *cells[] = {name, self->untestable[i].why, wording_measure(&self->untestable[i])};
        page_add_row(page, cells);
    }
    page_end_table(page);
}

static void add_next(struct page *page, const struct diagnosis *self)
{
    char(*sentences)[wording_size] = malloc(sentences_max * sizeof *sentences);
    size_t count = sentences ? wording_next(self, sentences_max, sentences) : 0;
    page_add_section(page, "Ties, and what to measure next");
    if (self->tie_count == 0 && self->verdict != diagnosis_unexplained) {
        page_add_paragraph(page, "No two causes explain these recordings equally well.");
    }
    if (count > 0) {
        page_start_list(page);
        for (size_t i = 0; i < count; i++) {
            page_add_item(page, i < self->tie_count ? "Tie" : "Next", "%s", sentences[i]);
        }
        page_end_list(page);
    }
    free(sentences);
}

static void add_rest(struct page *page, const struct diagnosis *self)
{
    page_add_section(page, "What stays unexplained");
    if (self->verdict == diagnosis_unexplained) {
        char left[wording_size];
        wording_left(self, left);
        bool one_gap = !misfit_is_left(&self->misfit, misfit_extended) && self->rest_shape >= 0;
        page_add_note(page, page_warning,
                      one_gap ? "What was found is one thing that has no name" : "Something is left that has no name",
                      "%s.", left);
    } else {
        page_add_paragraph(page, "Nothing that stands out of the noise.");
    }
    if (isfinite(self->fit_misfit) && isfinite(self->extended.whitened_rms)) {
        page_add_paragraph(page,
                           "On the fitted runs the %s model's mean squared error is %.2f times what the noise "
                           "explains; on unseen data its one-step errors are %.2f times what was expected.",
                           best_model(self), self->fit_misfit, self->extended.whitened_rms);
    }
}

/// What a function without a name could still take away.
static void add_ceiling(struct page *page, const struct diagnosis *self)
{
    if (!isfinite(self->black_box_rms) || !isfinite(self->extended.mean_rms))
        return;
    page_add_paragraph(
        page,
        "A black box (any function of speed and of position, a short filter) that learns on the fitted "
        "runs what the %s model leaves there brings its errors on unseen data from %.3f to %.3f times "
        "the noise (mean of the periods, where there are periods; a perfect model stays below %.3f nineteen "
        "times in twenty).",
        best_model(self), self->extended.mean_rms, self->black_box_rms, self->mean_rms_chance);
}

void diagnosis_report_sections(struct page *page, const struct diagnosis *self)
{
    add_verdict(page, self);
    add_given(page, self);
    page_add_section(page, self->verdict == diagnosis_no_discrepancy ? "How well the model fits" : "What is wrong");
    add_spectrum(page, self);
    add_time(page, self);
    report_misfit_add(page, self, best_model(self));
    add_causes(page, self);
    add_friction(page, self);
    add_gain(page, self);
    add_rest(page, self);
    add_ceiling(page, self);
    add_untestable(page, self);
    add_next(page, self);
}

int diagnosis_report(const struct diagnosis *self, const char *path, struct error *out_error)
{
    struct atomic_file file;
    struct page page;
    FILE *stream = atomic_file_open(&file, path, out_error);
    if (!stream) {
        return error_refused;
    }
    page_start(&page, stream, "What the simulation gets wrong", self->runs);
    diagnosis_report_sections(&page, self);
    // A write error is kept by the stream, and commit reports it with the path and the reason.
    (void)page_end(&page, "servoscope diagnose. Symbols and methods: docs/theory.md, Diagnosis.");
    return atomic_file_commit(&file, out_error);
}
