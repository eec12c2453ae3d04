/* SPDX-License-Identifier: MIT */
#include "lab/estimate/report.h"

#include "lab/estimate/method.h"
#include "lab/estimate/report_lines.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { remark_size = 320 };

static const enum figure_colour curve_colours[frf_report_curves_max] = {figure_vermilion, figure_green, figure_purple,
                                                                        figure_orange};
static const enum figure_dash curve_dashes[frf_report_curves_max] = {figure_solid, figure_dashed, figure_dotted,
                                                                     figure_dash_dot};
static const enum figure_marker curve_markers[frf_report_curves_max] = {figure_cross, figure_triangle, figure_square,
                                                                        figure_diamond};
/// The response itself is a blue dot.
static const struct {
    enum figure_colour colour;
    enum figure_marker marker;
} overlay_looks[frf_report_overlays_max] = {
    {figure_vermilion, figure_triangle}, {figure_green, figure_square}, {figure_purple, figure_cross},
    {figure_orange, figure_diamond},     {figure_ink, figure_plus},     {figure_sky, figure_ring},
    {figure_grey, figure_triangle_down},
};

/// Two panels that show one thing: magnitude and phase.
struct bode {
    struct figure_panel *magnitude, *phase;
};

/// The lines themselves, and the region that holds them.
static void add_lines(const struct report_drawing *drawing, const struct frf_report_options *options,
                      struct bode *panels)
{
    const struct report_lines *lines = &drawing->lines;
    char region[figure_text_max];
    char mean[figure_text_max] = "measured";
    if (options->name && options->other_count > 0) {
        snprintf(mean, sizeof mean, "%s", options->name);
    }
    snprintf(region, sizeof region, drawing->factor_is_95 ? "95 %%: \xC2\xB1%.3g std" : "\xC2\xB1%.3g std",
             drawing->factor);
    if (options->run_count > 1) {
        snprintf(mean, sizeof mean, "mean of %zu runs", options->run_count);
    }
    if (drawing->is_model) {
        figure_add_band(panels->magnitude, region, lines->count, lines->frequency_hz, lines->low_db, lines->high_db);
        figure_add_line(panels->magnitude, "model, not measured", lines->count, lines->frequency_hz,
                        lines->magnitude_db);
        figure_add_line(panels->phase, "", lines->count, lines->frequency_hz, lines->phase_deg)->colour = figure_blue;
        return;
    }
    if (lines->has_std) {
        figure_add_spans(panels->magnitude, region, lines->count, lines->frequency_hz, lines->low_db, lines->high_db)
            ->colour = figure_blue;
        figure_add_spans(panels->phase, "", lines->count, lines->frequency_hz, lines->phase_low_deg,
                         lines->phase_high_deg)
            ->colour = figure_blue;
    }
    struct figure_series *points[2] = {
        figure_add_points(panels->magnitude, mean, lines->count, lines->frequency_hz, lines->magnitude_db),
        figure_add_points(panels->phase, "", lines->count, lines->frequency_hz, lines->phase_deg)};
    for (size_t i = 0; i < 2; i++) {
        points[i]->colour = figure_blue;
        points[i]->marker = figure_circle;
    }
}

/// Shapes have to be told apart: larger where there are few.
static double overlay_size_px(size_t lines)
{
    return lines <= 60 ? 6.0 : lines <= 300 ? 5.0 : lines <= 1000 ? 4.0 : 3.0;
}

static void add_overlay(const struct report_overlay *overlay, size_t look, struct bode *panels)
{
    const struct report_lines *lines = &overlay->lines;
    struct figure_panel *const panel[2] = {panels->magnitude, panels->phase};
    const double *const values[2] = {lines->magnitude_db, lines->phase_deg};
    for (size_t i = 0; i < 2; i++) {
        const char *name = i == 0 ? overlay->name : "";
        struct figure_series *series =
            overlay->is_model ? figure_add_line(panel[i], name, lines->count, lines->frequency_hz, values[i])
                              : figure_add_points(panel[i], name, lines->count, lines->frequency_hz, values[i]);
        series->colour = overlay_looks[look].colour;
        series->marker = overlay_looks[look].marker;
        series->dash = figure_dashed;
        series->size = overlay->is_model ? 0.0 : overlay_size_px(lines->count);
    }
}

static void add_overlays(const struct report_drawing *drawing, struct bode *panels)
{
    for (size_t r = 0; r < drawing->overlay_count; r++) {
        add_overlay(&drawing->overlays[r], r, panels);
    }
}

static void add_curves(const struct report_drawing *drawing, const struct frf_report_options *options,
                       struct bode *panels)
{
    for (size_t c = 0; c < options->curve_count; c++) {
        const struct frf_model_curve *model = &options->curves[c];
        const struct report_curve *curve = &drawing->curves[c];
        if (model->std) {
            figure_add_band(panels->magnitude, "", model->count, model->frequency_hz, curve->low_db, curve->high_db)
                ->colour = curve_colours[c];
        }
        struct figure_panel *const panel[2] = {panels->magnitude, panels->phase};
        const double *const values[2] = {curve->magnitude_db, curve->phase_deg};
        for (size_t i = 0; i < 2; i++) {
            const char *name = i == 0 ? model->name : "";
            struct figure_series *series =
                model->at_lines ? figure_add_points(panel[i], name, model->count, model->frequency_hz, values[i])
                                : figure_add_line(panel[i], name, model->count, model->frequency_hz, values[i]);
            series->colour = curve_colours[c];
            series->dash = curve_dashes[c];
            series->marker = curve_markers[c];
        }
    }
}

static void add_bode(const struct report_drawing *drawing, const struct frf_report_options *options, const char *units,
                     struct figure *figure)
{
    char label[figure_text_max];
    snprintf(label, sizeof label, "magnitude in dB, 0 dB is %s", units);
    struct bode panels = {figure_add_panel(figure, label, axis_linear), NULL};
    panels.phase = figure_add_panel(figure, "phase in degrees", axis_degrees);
    panels.magnitude->height = 220;
    panels.phase->height = 140;
    add_overlays(drawing, &panels);
    add_lines(drawing, options, &panels);
    add_curves(drawing, options, &panels);
}

static void add_deviations(const struct report_drawing *drawing, const char *units, struct figure *figure)
{
    const struct report_lines *lines = &drawing->lines;
    char label[figure_text_max];
    snprintf(label, sizeof label, "standard deviation in dB, 0 dB is %s", units);
    struct figure_panel *panel = figure_add_panel(figure, label, axis_linear);
    panel->height = 110;
    struct figure_series *total = figure_add_points(panel, lines->noise_differs ? "std, total" : "std", lines->count,
                                                    lines->frequency_hz, lines->std_db);
    total->colour = figure_ink;
    total->marker = figure_diamond;
    if (lines->noise_differs) {
        struct figure_series *noise =
            figure_add_points(panel, "std of the noise", lines->count, lines->frequency_hz, lines->noise_db);
        noise->colour = figure_grey;
        noise->marker = figure_cross;
    }
}

static void add_coherence(const struct report_drawing *drawing, struct figure *figure)
{
    const struct report_lines *lines = &drawing->lines;
    struct figure_panel *panel = figure_add_panel(figure, "coherence", axis_linear);
    panel->height = 90;
    panel->low = 0.0;
    panel->high = 1.02;
    figure_add_points(panel, "coherence", lines->count, lines->frequency_hz, lines->coherence)->marker = figure_square;
}

static void add_residuals(const struct report_drawing *drawing, const struct frf_report_options *options,
                          struct figure *figure)
{
    const struct report_lines *lines = &drawing->lines;
    const bool models = options->curve_count > 0;
    struct figure_panel *panel = figure_add_panel(
        figure, models ? "residual over 2 std: measured less model" : "residual over 2 std: measured less smooth curve",
        axis_log);
    panel->height = 120;
    for (size_t c = 0; c < options->curve_count; c++) {
        struct figure_series *points = figure_add_points(panel, options->curves[c].name, lines->count,
                                                         lines->frequency_hz, drawing->curves[c].over_two_std);
        points->colour = curve_colours[c];
        points->marker = curve_markers[c];
    }
    if (!models && !drawing->is_model) {
        figure_add_points(panel, "from neighbours", lines->count, lines->frequency_hz, drawing->over_two_std);
    }
    figure_add_limit(panel, "1: within 2 std", 1.0);
}

/// How far every run or other response is from the first.
static void add_differences(const struct report_drawing *drawing, struct figure *figure)
{
    char label[figure_text_max];
    snprintf(label, sizeof label, "difference over 2 std, from %s", drawing->first);
    struct figure_panel *panel = figure_add_panel(figure, label, axis_log);
    panel->height = 120;
    for (size_t r = 0; r < drawing->overlay_count; r++) {
        const struct report_overlay *overlay = &drawing->overlays[r];
        if (drawing->runs_drawn > 0 && r == 0) {
            continue; // the first itself
        }
        struct figure_series *points = figure_add_points(panel, overlay->name, overlay->lines.count,
                                                         overlay->lines.frequency_hz, overlay->over_two_std);
        points->colour = overlay_looks[r].colour;
        points->marker = overlay_looks[r].marker;
        points->size = overlay_size_px(overlay->lines.count);
    }
    figure_add_limit(panel, "1: within 2 std", 1.0);
}

/// What it was made of: periods, segments, or rows.
static void write_amount(const struct frf *frf, char out_text[remark_size])
{
    const char *segments = estimate_key(frf, "segments");
    const char *rows = estimate_key(frf, "rows");
    out_text[0] = '\0';
    if (frf->periods > 0) {
        snprintf(out_text, remark_size, ", from %zu period%s", frf->periods, frf->periods == 1 ? "" : "s");
    } else if (segments[0] && rows[0]) {
        snprintf(out_text, remark_size, ", from %s segments of %s rows without a period", segments, rows);
    } else if (rows[0]) {
        snprintf(out_text, remark_size, ", from %s rows without a period", rows);
    }
}

static void write_delay(const struct frf *frf, const struct frf_report_options *options, double known_s,
                        char out_text[remark_size])
{
    const double removed_s = atof(estimate_key(frf, "delay_removed_s"));
    const char *held = options->known_delay_s > 0.0 ? NULL : "half a sample: the input is held between samples";
    const char *reason = options->delay_reason ? options->delay_reason : held;
    size_t used = 0;
    out_text[0] = '\0';
    if (removed_s != 0.0) {
        used = (size_t)snprintf(out_text, remark_size,
                                " A known delay of %.4g ms has been taken out of the response, here and in its file.",
                                1e3 * removed_s);
    }
    if (known_s > 0.0) {
        snprintf(out_text + used, remark_size - used,
                 " The known delay of %.4g ms%s%s%s is taken out of the phase shown; the file has it.", 1e3 * known_s,
                 reason ? " (" : "", reason ? reason : "", reason ? ")" : "");
    }
}

static void write_degrees(const struct frf *frf, char out_text[remark_size])
{
    out_text[0] = '\0';
    if (frf->degrees_of_freedom > 0.0) {
        snprintf(out_text, remark_size, ", with %.0f degrees of freedom", frf->degrees_of_freedom);
    }
}

static void add_smoothness(struct page *page, const struct smoothness *smoothness)
{
    const int neighbours = 2 * smoothness_half_width;
    if (smoothness->lines == 0) {
        page_add_paragraph(page, "Fewer than %d lines have a standard deviation: none is compared with its neighbours.",
                           neighbours + 1);
    } else if (smoothness_is_coarse(smoothness)) {
        page_add_paragraph(page,
                           "The lines are too coarse for a smooth curve through the %d neighbours of each: the "
                           "response bends between them, and the residual below is mostly the curve's.",
                           neighbours);
    } else {
        page_add_paragraph(page,
                           "Each line is compared with a smooth curve through its %d neighbours: %zu of %zu lines are "
                           "more than 2 std of the difference away, and half of them further than %.2g times what std "
                           "explains: 1 for a linear drive.",
                           neighbours, smoothness->beyond, smoothness->lines, smoothness->ratio);
    }
}

/// A file that others wrote may not say what it is of.
static const char *name_or(const char *name, const char *otherwise)
{
    return name[0] ? name : otherwise;
}

static void add_sentences(struct page *page, const struct frf *frf, const struct report_drawing *drawing,
                          const struct frf_report_options *options)
{
    const struct report_lines *lines = &drawing->lines;
    char amount[remark_size];
    write_amount(frf, amount);
    page_add_paragraph(page, "From %s to %s%s%s%s, %zu of %zu line%s valid.", name_or(frf->input, "the input"),
                       name_or(frf->output, "the output"), frf->method[0] ? " by method " : "", frf->method, amount,
                       lines->count, frf->count, frf->count == 1 ? "" : "s");
    if (options->curve_count == 0 && !drawing->is_model) {
        add_smoothness(page, &drawing->smoothness);
    }
    if (options->run_count > frf_report_overlays_max) {
        page_add_paragraph(page, "%zu runs are too many to be drawn one by one: the mean is shown.",
                           options->run_count);
    }
    if (options->curve_count + drawing->overlay_count == 0) {
        return;
    }
    page_start_list(page);
    for (size_t r = drawing->runs_drawn > 0; r < drawing->overlay_count; r++) {
        char says[2 * remark_size];
        difference_say(&drawing->overlays[r].difference, drawing->first, says, sizeof says);
        page_add_item(page, drawing->overlays[r].name, "%s", says);
    }
    for (size_t c = 0; c < options->curve_count; c++) {
        const struct report_curve *curve = &drawing->curves[c];
        page_add_item(page, options->curves[c].name,
                      "is off by more than 2 std at %zu of %zu lines; noise alone would do that at %.2g %% of them.",
                      curve->beyond, curve->compared, 100.0 * difference_chance(frf->degrees_of_freedom));
    }
    page_end_list(page);
}

void frf_report_section(struct page *page, const struct frf *frf, const struct frf_report_options *options)
{
    static const struct frf_report_options none = {0};
    struct report_drawing drawing;
    struct figure figure;
    char units[report_units_size];
    char delay[remark_size];
    char degrees[remark_size];
    options = options ? options : &none;
    page_add_section(page, "Frequency response");
    if (!report_drawing_make(frf, options, &drawing)) {
        page_add_paragraph(page, "Memory was short for this section.");
        report_drawing_free(&drawing);
        return;
    }
    add_sentences(page, frf, &drawing, options);
    report_units(frf->units, units);
    figure_start(&figure, "frequency in Hz", axis_log);
    add_bode(&drawing, options, units, &figure);
    add_deviations(&drawing, units, &figure);
    if (drawing.lines.has_coherence) {
        add_coherence(&drawing, &figure);
    }
    add_residuals(&drawing, options, &figure);
    if (drawing.overlay_count > 0) {
        add_differences(&drawing, &figure);
    }
    write_delay(frf, options, drawing.known_delay_s, delay);
    write_degrees(frf, degrees);
    page_add_figure(page, &figure, "%s to %s; std is that of the complex value%s.%s", name_or(frf->input, "The input"),
                    name_or(frf->output, "the output"), degrees, delay);
    report_drawing_free(&drawing);
}
