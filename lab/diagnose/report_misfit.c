/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/report_misfit.h"

#include "lab/diagnose/wording.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static void axis_label(const struct diagnosis *self, enum misfit_axis_kind kind, char out_text[figure_text_max])
{
    struct wording_units units = wording_units(self);
    switch (kind) {
    case misfit_frequency:
        snprintf(out_text, figure_text_max, "frequency in Hz");
        return;
    case misfit_speed:
        snprintf(out_text, figure_text_max, "speed in %s", units.speed_unit);
        return;
    case misfit_position:
        snprintf(out_text, figure_text_max, "position in %s", self->linear ? "m" : "rad");
        return;
    case misfit_level:
        snprintf(out_text, figure_text_max, "size of the %s in %s", units.torque, units.torque_unit);
        return;
    case misfit_direction:
    case misfit_time:
    case misfit_axes:
        break;
    }
    snprintf(out_text, figure_text_max, "time in s");
}

/// One axis as arrays for a figure.
struct points {
    double place[misfit_parts_max], rms[misfit_models][misfit_parts_max];
};

static double take_points(const struct misfit_axis *axis, bool logarithmic, struct points *out)
{
    double largest = 0.0;
    for (size_t i = 0; i < axis->parts; i++) {
        const struct misfit_part *p = &axis->part[i];
        out->place[i] = logarithmic ? sqrt(p->low * p->high) : 0.5 * (p->low + p->high);
        for (int m = 0; m < misfit_models; m++) {
            out->rms[m][i] = misfit_rms(p, (enum misfit_model)m);
            largest = fmax(largest, out->rms[m][i]);
        }
    }
    return largest;
}

static bool is_logarithmic(const struct misfit_axis *axis, enum misfit_axis_kind kind)
{
    const double wide = 30.0; // as the parts are split
    return kind == misfit_frequency && axis->part[0].low > 0.0 &&
           axis->part[axis->parts - 1].high > wide * axis->part[0].low;
}

static void add_figure(struct page *page, const struct diagnosis *self, enum misfit_axis_kind kind, const char *best)
{
    static const char *const captions[misfit_axes] = {[misfit_frequency] = "Residual over expected against frequency.",
                                                      [misfit_speed] = "Residual over expected against speed.",
                                                      [misfit_position] = "Residual over expected against position.",
                                                      [misfit_time] = "Residual over expected over the whole run.",
                                                      [misfit_level] = "Residual over expected against the level."};
    const struct misfit_axis *axis = &self->misfit.axes[kind];
    const double far = 5.0; // times the noise: a linear axis would hide what is near it
    struct points points;
    struct figure figure;
    char label[figure_text_max];
    bool logarithmic = is_logarithmic(axis, kind);
    double largest = take_points(axis, logarithmic, &points);
    axis_label(self, kind, label);
    figure_start(&figure, label, logarithmic ? axis_log : axis_linear);
    figure.width = figure_width_half;
    figure.legend = figure_legend_below;
    struct figure_panel *panel =
        figure_add_panel(&figure, "residual over expected, RMS", largest > far ? axis_log : axis_linear);
    panel->height = 120;
    panel->from_zero = largest <= far;
    struct figure_series *given =
        figure_add_points(panel, "model as given", axis->parts, points.place, points.rms[misfit_given]);
    given->colour = figure_vermilion;
    given->marker = figure_triangle;
    struct figure_series *left = figure_add_points(panel, best, axis->parts, points.place, points.rms[misfit_extended]);
    left->colour = figure_green;
    left->marker = figure_circle;
    figure_add_limit(panel, "noise", 1.0);
    page_add_figure(page, &figure, "%s", captions[kind]);
}

/// Both directions beside each other.
static void add_directions(struct page *page, const struct diagnosis *self, const char *best)
{
    static const char *const ways[] = {"backward", "forward"};
    const struct misfit_axis *axis = &self->misfit.axes[misfit_direction];
    struct points points;
    struct figure figure;
    take_points(axis, false, &points);
    figure_start(&figure, "direction", axis_linear);
    figure.width = figure_width_half;
    figure.legend = figure_legend_below;
    figure_set_categories(&figure, axis->parts, ways);
    struct figure_panel *panel = figure_add_panel(&figure, "residual over expected, RMS", axis_linear);
    panel->height = 120;
    panel->from_zero = true;
    figure_add_bars(panel, "model as given", axis->parts, NULL, points.rms[misfit_given])->colour = figure_vermilion;
    struct figure_series *left = figure_add_bars(panel, best, axis->parts, NULL, points.rms[misfit_extended]);
    left->colour = figure_green;
    left->dash = figure_dashed;
    figure_add_limit(panel, "noise", 1.0);
    page_add_figure(page, &figure, "Residual over expected by direction of motion.");
}

static void add_figures(struct page *page, const struct diagnosis *self, const char *best)
{
    static const enum misfit_axis_kind kinds[] = {misfit_speed,     misfit_position, misfit_level,
                                                  misfit_direction, misfit_time,     misfit_frequency};
    size_t in_row = 0;
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        if (self->misfit.axes[kinds[i]].parts < 2)
            continue;
        if (in_row == 0)
            page_start_row(page);
        if (kinds[i] == misfit_direction)
            add_directions(page, self, best);
        else
            add_figure(page, self, kinds[i], best);
        in_row = (in_row + 1) % 2;
        if (in_row == 0)
            page_end_row(page);
    }
    if (in_row != 0)
        page_end_row(page);
}

static void describe_cell(const struct diagnosis *self, enum misfit_axis_kind kind, enum misfit_model model,
                          char out_text[wording_size])
{
    const struct misfit_range *range = &self->misfit.axes[kind].range[model];
    char place[wording_size - 80];
    if (!misfit_is_left(&self->misfit, model)) {
        snprintf(out_text, wording_size, "nothing beyond noise");
    } else if (!range->found) {
        snprintf(out_text, wording_size, "everywhere alike");
    } else {
        char words[wording_size];
        wording_range(self, kind, range, words);
        snprintf(place, sizeof place, "%.*s", (int)sizeof place - 1, words);
        snprintf(out_text, wording_size, "%s: %.0f %% of it, in %.2g %% of the values", place, 100.0 * range->share,
                 100.0 * range->values);
    }
}

static void add_table(struct page *page, const struct diagnosis *self, const char *best)
{
    static const char *const names[misfit_axes] = {"frequency", "speed", "position", "direction", "time", "level"};
    char left[wording_short];
    snprintf(left, sizeof left, "%s model", best);
    const char *heads[] = {"by", "model as given", left};
    page_start_table(page,
                     "Where the squared residuals beyond noise lie most densely. A range is named where it holds far "
                     "more of them than of the recording.",
                     "lll", heads);
    for (int a = 0; a < misfit_axes; a++) {
        char given[wording_size], extended[wording_size];
        if (self->misfit.axes[a].parts < 2)
            continue;
        describe_cell(self, (enum misfit_axis_kind)a, misfit_given, given);
        describe_cell(self, (enum misfit_axis_kind)a, misfit_extended, extended);
        const char *cells[] = {names[a], given, extended};
        page_add_row(page, cells);
    }
    page_end_table(page);
}

void report_misfit_add(struct page *page, const struct diagnosis *self, const char *best)
{
    const struct misfit *m = &self->misfit;
    char given[wording_short], left[wording_short], where[wording_size];
    if (!(m->values > 0.0))
        return;
    page_add_subsection(page, "Where it is wrong");
    wording_percent(misfit_noise_share(m, misfit_given), given);
    wording_percent(misfit_noise_share(m, misfit_extended), left);
    wording_where(self, m, misfit_given, where);
    page_add_paragraph(page,
                       "Of what the model as given leaves, squared and weighed by its expectation, noise makes %s; "
                       "of what the %s model leaves, %s.%s%s%s",
                       given, best, left, where[0] ? " The given model's misfit lies " : "", where,
                       where[0] ? "." : "");
    add_figures(page, self, best);
    add_table(page, self, best);
}
