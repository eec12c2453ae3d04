/* SPDX-License-Identifier: MIT */
#include "lab/design/report.h"

#include "lab/design/intermodulation.h"
#include "lab/design/report_rows.h"
#include "lab/design/start.h"
#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void add_panel(struct figure *figure, const struct report_row *row, size_t count, const double *time_s,
                      const double *series)
{
    char label[figure_text_max];
    snprintf(label, sizeof label, "%s in %s", row->name, row->unit);
    struct figure_panel *panel = figure_add_panel(figure, label, axis_linear);
    panel->height = 130;
    figure_add_line(panel, row->name, count, time_s, series)->size = 1;
    if (row->limit > 0) {
        snprintf(label, sizeof label, "limits ±%.4g", row->limit);
        const enum figure_dash dash = figure_add_limit(panel, label, row->limit)->dash;
        figure_add_limit(panel, "", -row->limit)->dash = dash;
    }
}

/// Why a period begins where it does, to go behind "from sample N on".
static const char *start_reason(enum design_start start)
{
    switch (start) {
    case design_start_paper:
        return ": the zero crossing of the velocity with the least acceleration, because the axis begins at rest";
    case design_start_bank:
        return ": where a bank of nominal drives, at rest before, has the least transient";
    case design_start_model:
        return ": where the drive of the given model, at rest before, has the least transient";
    case design_start_none:
        break;
    }
    return "";
}

/// One period in the order of playing, closed by its first sample: `values` holds (report_rows + 1) x (N + 1) numbers.
static void add_period(struct page *page, const struct design_request *request, const struct design_result *result,
                       const struct report_row *rows, double *values)
{
    const double step_s = (double)request->rate_den / request->rate_num_hz;
    const size_t period = result->period_samples;
    const size_t points = period + 1;
    struct figure figure;
    figure_start(&figure, "time in s", axis_linear);
    for (size_t n = 0; n < points; n++) {
        values[n] = step_s * (double)n;
        for (size_t i = 0; i < report_rows; i++) {
            values[(i + 1) * points + n] = rows[i].series[(result->start_index + n) % period];
        }
    }
    for (size_t i = 0; i < report_rows; i++) {
        // Acceleration is torque over inertia: its panel says nothing new unless it has a limit of its own.
        if (i != report_acceleration || rows[i].limit > 0) {
            add_panel(&figure, &rows[i], points, values, values + (i + 1) * points);
        }
    }
    page_add_figure(page, &figure, "One period as it is played, from sample %zu of the table on%s.",
                    result->start_index, start_reason(request->start));
}

static void add_spectrum(struct page *page, const struct design_request *request, const struct design_result *result,
                         const struct report_row *rows, double *values)
{
    const size_t count = result->bin_count;
    double *frequency_hz = values, *velocity = values + count, *torque = values + 2 * count;
    report_rows_amplitudes(request, result, frequency_hz, torque, velocity);
    struct figure figure;
    char label[figure_text_max];
    figure_start(&figure, "frequency in Hz", axis_log);
    snprintf(label, sizeof label, "%s amplitude in %s", rows[report_torque].name, rows[report_torque].unit);
    struct figure_panel *panel = figure_add_panel(&figure, label, axis_linear);
    panel->height = 110;
    panel->from_zero = true;
    figure_add_stems(panel, rows[report_torque].name, count, frequency_hz, torque);
    snprintf(label, sizeof label, "velocity amplitude in %s", rows[report_velocity].unit);
    panel = figure_add_panel(&figure, label, axis_linear);
    panel->height = 110;
    panel->from_zero = true;
    figure_add_stems(panel, "velocity", count, frequency_hz, velocity)->colour = figure_vermilion;
    page_add_figure(page, &figure, "Amplitudes of the %zu line%s%s", count, count == 1 ? "" : "s",
                    request->torque_shape ? ", in the ratios that were asked for."
                                          : ". They follow from the limits: a line gets what it may have where its "
                                            "tightest limit binds.");
}

/// Names of the quantities that their limit holds back, "torque (99.9 % of 1 Nm), velocity (99.5 % of 3 rad/s)", or of
/// all others that have one. Returns how many.
static size_t write_limits(const struct report_row *rows, bool binding, size_t size, char *out_text)
{
    size_t count = 0;
    size_t used = 0;
    out_text[0] = '\0';
    for (size_t i = 0; i < report_rows; i++) {
        const double share = rows[i].used;
        if (rows[i].limit > 0 && (share >= REPORT_NEARLY_ALL) == binding && used < size) {
            used += (size_t)snprintf(out_text + used, size - used, "%s%s (%.1f %% of %.4g %s)", count > 0 ? ", " : "",
                                     rows[i].name, 100 * share, rows[i].limit, rows[i].unit);
            count++;
        }
    }
    return count;
}

/// The result in a box: what was reached, which limit holds it back, and what more there could be.
static void add_result(struct page *page, const struct design_result *result, const struct report_row *rows)
{
    char headline[128], binding[256], others[256];
    const struct report_row *torque = &rows[report_torque];
    const size_t bound = write_limits(rows, true, sizeof binding, binding);
    const size_t free_ones = write_limits(rows, false, sizeof others, others);
    snprintf(headline, sizeof headline, "Effective %s %.4f %s, %.0f %% of the bound", torque->name,
             result->effective_torque_Nm, torque->unit, 100 * result->effective_torque_Nm / result->bound_Nm);
    page_add_note(page, bound > 0 ? page_good : page_warning, headline,
                  "%s%s%s%s. No phases give more than %.4f %s with these amplitudes. Crest factor of the %s: %.3f.",
                  bound > 0 ? "Held back by the limit of the " : "No limit is used up", binding,
                  free_ones > 0 ? "; not by that of the " : "", others, result->bound_Nm, torque->unit, torque->name,
                  result->crest_factor);
    if (result->interrupted) {
        page_add_note(page, page_warning, "Interrupted", "The search was not finished: this is the best so far.");
    }
}

/// Between the samples a drive that interpolates the table goes further than at them.
static void add_excess(struct page *page, const struct report_row *rows)
{
    const double tolerance = 1.0005;
    for (size_t i = 0; i < report_rows; i++) {
        if (rows[i].limit > 0 && rows[i].peak_continuous > tolerance * rows[i].limit) {
            page_add_note(page, page_warning, "Beyond a limit between the samples",
                          "The %s reaches %.5g %s there, %.1f %% of its limit; --grid continuous holds it there too.",
                          rows[i].name, rows[i].peak_continuous, rows[i].unit,
                          100 * rows[i].peak_continuous / rows[i].limit);
        }
    }
}

static void add_table(struct page *page, const struct report_row *rows)
{
    static const char *const heads[] = {"peak of", "at the samples", "in between", "limit", "used", "unit"};
    page_start_table(page, "Peaks against limits.", "lrrrrl", heads);
    for (size_t i = 0; i < report_rows; i++) {
        char at[32], between[32], limit[32], used[32];
        const struct report_row *row = &rows[i];
        snprintf(at, sizeof at, "%.5g", row->peak);
        snprintf(between, sizeof between, "%.5g", row->peak_continuous);
        snprintf(limit, sizeof limit, "%.5g", row->limit);
        snprintf(used, sizeof used, "%.1f %%", 100 * row->peak_continuous / row->limit);
        const bool limited = row->limit > 0;
        const char *const cells[] = {row->name, at, between, limited ? limit : NULL, limited ? used : NULL, row->unit};
        page_add_row(page, cells);
    }
    page_end_table(page);
}

static void add_pairs(struct page *page, const struct design_request *request, const struct design_result *result,
                      double line_hz, const struct report_row *rows)
{
    const char *unit = rows[report_torque].unit;
    page_start_pairs(page);
    page_add_pair(page, "method", "%s, limits held %s", result->method,
                  request->grid == design_grid_continuous ? "at every instant" : "at the samples");
    page_add_pair(page, "lines", "%zu, %.6g to %.6g Hz", result->bin_count, line_hz * result->bins[0],
                  line_hz * result->bins[result->bin_count - 1]);
    page_add_pair(page, "period", "%zu samples, %.6g s", result->period_samples, 1 / line_hz);
    page_add_pair(page, request->linear ? "moved mass" : "inertia", "%.6g %s", request->inertia_kgm2,
                  request->linear ? "kg" : "kg m²");
    page_add_pair(page, request->linear ? "effective force" : "effective torque", "%.4f %s, crest factor %.3f",
                  result->effective_torque_Nm, unit, result->crest_factor);
    if (result->effective_torque_continuous_Nm < result->effective_torque_Nm) {
        page_add_pair(page, "held between samples too", "it would be %.4f %s", result->effective_torque_continuous_Nm,
                      unit);
    }
    page_add_pair(page, "bound", "%.4f %s, reached: %.0f %%; no phases give more", result->bound_Nm, unit,
                  100 * result->effective_torque_Nm / result->bound_Nm);
    page_add_pair(page, "start", "sample %zu", result->start_index);
    if (result->expected_transient >= 0) {
        page_add_pair(page, "start transient", "%.2g %% of the motion's energy in the first period (%s)",
                      100 * result->expected_transient,
                      request->start == design_start_model ? "of the model given"
                                                           : "expected: mean over a bank of nominal drives");
    }
    page_end_pairs(page);
}

/// One order's products, on lines and beside them: `values` holds 4 x map->count numbers.
static void add_map_panel(struct figure *figure, const char *label, const struct design_product_map *map,
                          const double *products, const double *frequency_hz, double *values)
{
    struct figure_panel *panel = figure_add_panel(figure, label, axis_log);
    double *on_lines = values, *on_free = values + map->count;
    for (size_t i = 0; i < map->count; i++) {
        on_lines[i] = map->excited[i] ? products[i] : NAN;
        on_free[i] = map->excited[i] ? NAN : products[i];
    }
    panel->height = 110;
    struct figure_series *points = figure_add_points(panel, "on a line", map->count, frequency_hz, on_lines);
    points->colour = figure_vermilion;
    points->marker = figure_triangle;
    points = figure_add_points(panel, "on a free bin", map->count, frequency_hz, on_free);
    points->colour = figure_blue;
    points->marker = figure_ring;
}

static void add_map(struct page *page, const struct design_result *result, double line_hz)
{
    struct design_product_map map;
    struct figure figure;
    if (!design_intermodulation_map(result->bin_count, result->bins, &map)) {
        page_add_paragraph(page, "Memory was short for the map of products.");
        return;
    }
    double *values = malloc(5 * map.count * sizeof *values);
    if (values) {
        for (size_t i = 0; i < map.count; i++) {
            values[i] = line_hz * map.bins[i];
        }
        figure_start(&figure, "frequency in Hz", axis_log);
        add_map_panel(&figure, "number of products of second order", &map, map.second_order, values,
                      values + map.count);
        add_map_panel(&figure, "number of products of third order", &map, map.third_order, values,
                      values + 3 * map.count);
        page_add_figure(
            page, &figure,
            "Intermodulation map: how many sums and differences of two and of three lines fall on each of "
            "the %zu bins from the lowest to the highest line. On a line they pass for the drive's response; "
            "on a free bin they show its distortion. A bin without a point has none.",
            map.count);
    }
    free(values);
    design_product_map_free(&map);
}

static void add_products(struct page *page, const struct design_result *result, double line_hz)
{
    struct design_intermodulation counts;
    char text[512];
    page_add_section(page, "What a nonlinear drive makes of the lines");
    if (design_intermodulation_count(result->bin_count, result->bins, &counts)) {
        design_intermodulation_describe(&counts, text, sizeof text);
        page_add_paragraph(page, "%s", text);
        design_intermodulation_free(&counts);
    }
    add_map(page, result, line_hz);
}

/// Above these the map of starts takes longer than the rest of the page.
enum { start_samples_max = 1 << 15, start_lines_max = 2000 };

static bool has_start_map(const struct design_request *request, const struct design_result *result)
{
    return result->expected_transient >= 0 && result->period_samples == request->period_samples &&
           !(fabs(result->travel_per_period_rad) > 0) && result->period_samples <= start_samples_max &&
           result->bin_count <= start_lines_max;
}

/// Start transient over the sample at which the period could begin; `values` holds 3 N numbers.
static void add_start_map(struct page *page, const struct design_request *request, const struct design_result *result,
                          double *values)
{
    const size_t period = result->period_samples;
    const double step_s = (double)request->rate_den / request->rate_num_hz;
    double *time_s = values, *percent = values + period, *sorted = values + 2 * period;
    if (!design_start_shares(request, result, percent)) {
        return;
    }
    size_t least = 0;
    for (size_t n = 0; n < period; n++) {
        time_s[n] = step_s * (double)n;
        percent[n] *= 100;
        least = percent[n] < percent[least] ? n : least;
    }
    memcpy(sorted, percent, period * sizeof *sorted);
    struct figure figure;
    figure_start(&figure, "begin of playing, time in the table in s", axis_linear);
    struct figure_panel *panel = figure_add_panel(&figure, "start transient in % of the motion's energy", axis_log);
    panel->height = 120;
    figure_add_line(panel, "begun there", period, time_s, percent)->size = 1;
    struct figure_series *chosen =
        figure_add_points(panel, "as chosen", 1, &time_s[result->start_index], &percent[result->start_index]);
    chosen->colour = figure_vermilion;
    chosen->marker = figure_diamond;
    chosen->size = 9;
    page_add_figure(page, &figure,
                    "Energy of the start transient in the first period, of %s that is at rest before. Chosen: sample "
                    "%zu with %.2g %%; the least is %.2g %% at sample %zu, the median of all %.2g %%.",
                    request->start == design_start_model ? "the drive given" : "the mean over a bank of nominal drives",
                    result->start_index, percent[result->start_index], percent[least], least,
                    statistics_median(sorted, period));
}

static void add_start(struct page *page, const struct design_request *request, const struct design_result *result,
                      double *values)
{
    page_add_section(page, "Start");
    page_add_paragraph(page, "Playing begins at sample %zu of the table%s.", result->start_index,
                       start_reason(request->start));
    if (result->expected_transient >= 0) {
        page_add_paragraph(page, "In the first period %.2g %% of the motion's energy is start transient (%s).",
                           100 * result->expected_transient,
                           request->start == design_start_model ? "of the model given"
                                                                : "expected: mean over a bank of nominal drives");
    }
    if (values && has_start_map(request, result)) {
        add_start_map(page, request, result, values);
    }
}

static void add_excitation(struct page *page, const struct design_request *request, const struct design_result *result,
                           const struct report_row *rows, double *values)
{
    add_table(page, rows);
    if (values) {
        add_period(page, request, result, rows, values);
        add_spectrum(page, request, result, rows, values);
    } else {
        page_add_paragraph(page, "Memory was short for the figures of this section.");
    }
}

void design_report_sections(struct page *page, const struct design_request *request, const struct design_result *result)
{
    const double rate_hz = (double)request->rate_num_hz / request->rate_den;
    const double line_hz = rate_hz / (double)result->period_samples;
    // The lines fit too: there are fewer than half as many of them as samples.
    double *values = malloc((report_rows + 1) * (result->period_samples + 1) * sizeof *values);
    struct report_row rows[report_rows];
    report_rows_make(request, result, rows);
    add_result(page, result, rows);
    add_excess(page, rows);
    page_add_section(page, "Excitation");
    add_excitation(page, request, result, rows, values);
    add_products(page, result, line_hz);
    add_start(page, request, result, values);
    page_add_section(page, "How it was made");
    add_pairs(page, request, result, line_hz, rows);
    free(values);
}

void design_report_section(struct page *page, const char *heading, const struct design_request *request,
                           const struct design_result *result)
{
    double *values = malloc((report_rows + 1) * (result->period_samples + 1) * sizeof *values);
    struct report_row rows[report_rows];
    report_rows_make(request, result, rows);
    page_add_section(page, heading);
    add_result(page, result, rows);
    add_excess(page, rows);
    add_excitation(page, request, result, rows, values);
    free(values);
}
