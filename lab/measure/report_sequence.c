/* SPDX-License-Identifier: MIT */
/* The page of a sequence: one number for each segment where a single run has a figure. */
#include "lab/measure/report.h"
#include "lab/measure/report_parts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { compared = measure_velocity + 1, table_rows_max = 64 };

bool measure_page_segment_make(const struct measure_summary *summary, const struct measure_report *report,
                               struct measure_page_segment *out_self)
{
    const size_t lines = summary->line_count;
    double *values = malloc((1 + 2 * compared) * lines * sizeof *values + 1);
    *out_self = (struct measure_page_segment){
        .rows = summary->run->rows,
        .rows_planned = report->rows_planned,
        .lost = summary->lost,
        .lines = lines,
        .frequency_hz = values,
    };
    if (!values) {
        return false;
    }
    for (size_t i = 0; i < measure_parts; i++) {
        out_self->late += report->late_in_part[i];
    }
    memcpy(out_self->level, summary->level, sizeof out_self->level);
    memcpy(values, summary->frequency_hz, lines * sizeof *values);
    for (size_t q = 0; q < compared; q++) {
        out_self->first[q] = measure_summary_first(summary, (enum measure_quantity)q);
        out_self->usual[q] = measure_summary_usual(summary, (enum measure_quantity)q);
        out_self->amplitude[q] = values + (1 + q) * lines;
        out_self->table_amplitude[q] = values + (1 + compared + q) * lines;
        memcpy(out_self->amplitude[q], summary->amplitude[q], lines * sizeof *values);
        memcpy(out_self->table_amplitude[q], summary->table_amplitude[q], lines * sizeof *values);
    }
    return true;
}

void measure_page_segment_free(struct measure_page_segment *self)
{
    free(self->frequency_hz);
    self->frequency_hz = NULL;
}

/// The figures' numbers: `values` owns them all, `count` for each.
struct columns {
    double *values;
    double *number, *lost, *late, *used[measure_quantities], *first[compared], *usual[compared];
};

static bool make_columns(const struct measure_page_sequence *sequence, struct columns *out)
{
    enum { column_count = 3 + measure_quantities + 2 * compared };
    const size_t count = sequence->count;
    out->values = malloc(column_count * count * sizeof *out->values + 1);
    if (!out->values) {
        return false;
    }
    double *next = out->values;
    out->number = next;
    out->lost = next += count;
    out->late = next += count;
    for (size_t q = 0; q < measure_quantities; q++) {
        out->used[q] = next += count;
    }
    for (size_t q = 0; q < compared; q++) {
        out->first[q] = next += count;
        out->usual[q] = next += count;
    }
    for (size_t i = 0; i < count; i++) {
        const struct measure_page_segment *segment = &sequence->segments[i];
        out->number[i] = (double)(i + 1);
        out->lost[i] = (double)segment->lost;
        out->late[i] = (double)segment->late;
        for (size_t q = 0; q < measure_quantities; q++) {
            const struct measure_level *level = &segment->level[q];
            out->used[q][i] = level->limit > 0.0 ? 100.0 * level->used : 100.0 * level->peak / level->table_peak;
        }
        for (size_t q = 0; q < compared; q++) {
            out->first[q][i] = segment->first[q];
            out->usual[q][i] = segment->usual[q];
        }
    }
    return true;
}

static void add_notes(struct page *page, const struct measure_page_sequence *sequence)
{
    size_t lost = 0, rows = 0;
    uint64_t late = 0;
    for (size_t i = 0; i < sequence->count; i++) {
        lost += sequence->segments[i].lost;
        late += sequence->segments[i].late;
        rows += sequence->segments[i].rows;
    }
    if (sequence->stopped_by) {
        page_add_note(page, page_bad, "Stopped early", "%s. %zu of %zu segments of %s are shown.", sequence->stopped_by,
                      sequence->count, sequence->planned, sequence->kind);
    } else {
        page_add_note(page, page_good, "Complete", "%zu segments of %s.", sequence->count, sequence->kind);
    }
    page_add_note(page, lost > 0 ? page_warning : page_good, lost > 0 ? "Samples were lost" : "No sample was lost",
                  "%zu lost, %llu late.", lost, (unsigned long long)late);
    report_add_late_note(page, late, rows);
    if (sequence->keys) {
        report_add_bus_note(page, sequence->keys);
    }
}

static void add_segments(struct page *page, const struct measure_page_sequence *sequence, const struct columns *columns)
{
    const struct report_words *words = report_words_of(sequence->linear);
    struct figure figure;
    page_add_section(page, "Segments");
    page_add_paragraph(page, "Single periods and the settling within a segment are not shown for a sequence: each "
                             "segment has a run file of its own.");
    figure_start(&figure, "segment", axis_linear);
    figure.x_low = 0.0;
    figure.x_high = (double)(sequence->count + 1);
    struct figure_panel *panel = figure_add_panel(&figure, "lost and late samples", axis_linear);
    panel->height = 80;
    panel->from_zero = true;
    figure_add_points(panel, "lost", sequence->count, columns->number, columns->lost);
    figure_add_points(panel, "late", sequence->count, columns->number, columns->late);
    panel = figure_add_panel(&figure, "peak in % of the limit or, without one, of the table", axis_linear);
    panel->from_zero = true;
    for (size_t q = 0; q < measure_quantities; q++) {
        char name[figure_text_max];
        const bool limited = sequence->segments[0].level[q].limit > 0.0;
        snprintf(name, sizeof name, "%s, of the %s", words->name[q], limited ? "limit" : "table's");
        figure_add_points(panel, name, sequence->count, columns->number, columns->used[q]);
    }
    panel = figure_add_panel(&figure, "distance from the last period over its size", axis_log);
    for (size_t q = 0; q < compared; q++) {
        char name[figure_text_max];
        snprintf(name, sizeof name, "%s, first counted", words->name[q]);
        figure_add_points(panel, name, sequence->count, columns->number, columns->first[q]);
        snprintf(name, sizeof name, "%s, others", words->name[q]);
        figure_add_points(panel, name, sequence->count, columns->number, columns->usual[q]);
    }
    page_add_figure(page, &figure,
                    "One value for each of the %zu segments. A first counted period much further from the segment's "
                    "last than the others still held the transient of its start.",
                    sequence->count);
}

static void add_table(struct page *page, const struct measure_page_sequence *sequence)
{
    static const char *const heads[] = {"segment", "rows", "planned", "lost", "late"};
    char caption[96];
    const size_t shown = sequence->count < table_rows_max ? sequence->count : table_rows_max;
    snprintf(caption, sizeof caption, "%s%zu segments.", shown < sequence->count ? "The first " : "", shown);
    page_start_table(page, caption, "lrrrr", heads);
    for (size_t i = 0; i < shown; i++) {
        const struct measure_page_segment *segment = &sequence->segments[i];
        char text[4][24];
        snprintf(text[0], sizeof text[0], "%zu", segment->rows);
        snprintf(text[1], sizeof text[1], "%zu", segment->rows_planned);
        snprintf(text[2], sizeof text[2], "%zu", segment->lost);
        snprintf(text[3], sizeof text[3], "%llu", (unsigned long long)segment->late);
        const char *const cells[] = {segment->name, text[0], text[1], text[2], text[3]};
        page_add_row(page, cells);
    }
    page_end_table(page);
}

/// All segments' lines, one after the other.
static void add_spectrum(struct page *page, const struct measure_page_sequence *sequence)
{
    size_t count = 0;
    for (size_t i = 0; i < sequence->count; i++) {
        count += sequence->segments[i].lines;
    }
    double *values = malloc((1 + 2 * compared) * count * sizeof *values + 1);
    page_add_section(page, "Amplitudes at the lines");
    if (!values) {
        page_add_paragraph(page, "Memory was short for the amplitudes.");
        return;
    }
    double *const amplitude[compared] = {values + count, values + 2 * count};
    double *const table_amplitude[compared] = {values + 3 * count, values + 4 * count};
    size_t at = 0;
    for (size_t i = 0; i < sequence->count; i++) {
        const struct measure_page_segment *segment = &sequence->segments[i];
        const size_t bytes = segment->lines * sizeof *values;
        memcpy(values + at, segment->frequency_hz, bytes);
        for (size_t q = 0; q < compared; q++) {
            memcpy(amplitude[q] + at, segment->amplitude[q], bytes);
            memcpy(table_amplitude[q] + at, segment->table_amplitude[q], bytes);
        }
        at += segment->lines;
    }
    report_add_spectrum(page, sequence->linear, count, values, amplitude, table_amplitude,
                        " of all segments, each from its own run");
    free(values);
}

void measure_page_sequence_sections(struct page *page, const struct measure_page_sequence *sequence)
{
    struct columns columns;
    add_notes(page, sequence);
    if (sequence->keys) {
        report_add_bus(page, sequence->keys);
    }
    if (sequence->count == 0) {
        page_add_paragraph(page, "No segment was measured: there is nothing to show.");
        return;
    }
    if (make_columns(sequence, &columns)) {
        add_segments(page, sequence, &columns);
        free(columns.values);
    } else {
        page_add_paragraph(page, "Memory was short for the figures of the segments.");
    }
    add_table(page, sequence);
    add_spectrum(page, sequence);
}
