/* SPDX-License-Identifier: MIT */
#include "lab/design/report_sequence.h"

#include "lab/design/report.h"
#include "lab/design/report_rows.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// What is kept of a table: a row.
struct design_report_table {
    char *name;
    size_t lines;
    double first_hz, last_hz;
    double effective_Nm, bound_Nm;
    double used[report_rows]; ///< share of each limit; 0 without one
};

/// The overview comes first, but is known last: the numbers that it takes are left free.
enum { overview_sections = 1, overview_figures = 2, overview_tables = 1 };

bool design_report_sequence_begin(struct design_report_sequence *out)
{
    *out = (struct design_report_sequence){0};
    out->stream = open_memstream(&out->text, &out->size);
    out->page = (struct page){
        .out = out->stream, .sections = overview_sections, .figures = overview_figures, .tables = overview_tables};
    return out->stream != NULL;
}

static bool grow(struct design_report_sequence *self, size_t lines)
{
    struct design_report_table *tables = realloc(self->tables, (self->count + 1) * sizeof *tables);
    if (!tables) {
        return false;
    }
    self->tables = tables;
    double *numbers = realloc(self->lines, 3 * (self->line_count + lines) * sizeof *numbers);
    if (!numbers) {
        return false;
    }
    self->lines = numbers;
    return true;
}

/// The three arrays lie behind each other, so that they move apart when they grow.
static void take_lines(struct design_report_sequence *self, const struct design_request *request,
                       const struct design_result *result)
{
    const size_t before = self->line_count, now = before + result->bin_count;
    memmove(self->lines + 2 * now, self->lines + 2 * before, before * sizeof *self->lines);
    memmove(self->lines + now, self->lines + before, before * sizeof *self->lines);
    report_rows_amplitudes(request, result, self->lines + before, self->lines + now + before,
                           self->lines + 2 * now + before);
    self->line_count = now;
}

bool design_report_sequence_add(struct design_report_sequence *self, const char *name,
                                const struct design_request *request, const struct design_result *result)
{
    struct report_row rows[report_rows];
    char *copy = strdup(name);
    if (!copy || !grow(self, result->bin_count)) {
        free(copy);
        return false;
    }
    report_rows_make(request, result, rows);
    take_lines(self, request, result);
    struct design_report_table *table = &self->tables[self->count];
    *table = (struct design_report_table){
        .name = copy,
        .lines = result->bin_count,
        .first_hz = self->lines[self->line_count - result->bin_count],
        .last_hz = self->lines[self->line_count - 1],
        .effective_Nm = result->effective_torque_Nm,
        .bound_Nm = result->bound_Nm,
    };
    for (size_t i = 0; i < report_rows; i++) {
        table->used[i] = rows[i].used;
    }
    self->linear = request->linear;
    if (self->count < design_report_tables_shown) {
        design_report_section(&self->page, name, request, result);
    }
    self->count++;
    return true;
}

static const char *name_of(const struct design_report_sequence *self, size_t row)
{
    static const char *const names[2][report_rows] = {{"torque", "velocity", "position", "acceleration"},
                                                      {"force", "velocity", "position", "acceleration"}};
    return names[self->linear][row];
}

/// "torque", "torque, velocity", "none".
static void write_binding(const struct design_report_sequence *self, const struct design_report_table *table,
                          char out_text[64])
{
    size_t used = 0;
    snprintf(out_text, 64, "none");
    for (size_t i = 0; i < report_rows; i++) {
        if (table->used[i] >= REPORT_NEARLY_ALL && used < 64) {
            used += (size_t)snprintf(out_text + used, 64 - used, "%s%s", used > 0 ? ", " : "", name_of(self, i));
        }
    }
}

static void add_note(struct page *page, const struct design_report_sequence *self)
{
    char headline[128], counts[256] = "";
    double lowest = INFINITY, highest = 0.0;
    size_t used = 0;
    for (size_t t = 0; t < self->count; t++) {
        lowest = fmin(lowest, self->tables[t].effective_Nm);
        highest = fmax(highest, self->tables[t].effective_Nm);
    }
    for (size_t i = 0; i < report_rows; i++) {
        size_t bound = 0;
        for (size_t t = 0; t < self->count; t++) {
            bound += self->tables[t].used[i] >= REPORT_NEARLY_ALL;
        }
        if (bound > 0) {
            used += (size_t)snprintf(counts + used, sizeof counts - used, "%sthe limit of the %s holds back %zu",
                                     used > 0 ? ", " : "", name_of(self, i), bound);
        }
    }
    snprintf(headline, sizeof headline, "Effective %s %.4g to %.4g %s", name_of(self, report_torque), lowest, highest,
             self->linear ? "N" : "Nm");
    page_add_note(page, used > 0 ? page_good : page_warning, headline, "Of %zu tables %s.", self->count,
                  used > 0 ? counts : "none uses up a limit");
}

/// `values` holds 1 + 1 + report_rows numbers for each table.
static void add_reached(struct page *page, const struct design_report_sequence *self, double *values)
{
    const size_t count = self->count;
    double *number = values, *effective = values + count;
    char label[figure_text_max];
    struct figure figure;
    figure_start(&figure, "number of the table", axis_linear);
    figure.x_low = 0.0;
    figure.x_high = (double)(count + 1);
    for (size_t t = 0; t < count; t++) {
        number[t] = (double)(t + 1);
        effective[t] = self->tables[t].effective_Nm;
        for (size_t i = 0; i < report_rows; i++) {
            values[(2 + i) * count + t] = self->tables[t].used[i] > 0 ? 100 * self->tables[t].used[i] : NAN;
        }
    }
    snprintf(label, sizeof label, "effective %s in %s", name_of(self, report_torque), self->linear ? "N" : "Nm");
    struct figure_panel *panel = figure_add_panel(&figure, label, axis_linear);
    panel->height = 110;
    panel->from_zero = true;
    figure_add_points(panel, "", count, number, effective);
    panel = figure_add_panel(&figure, "use of each limit in %", axis_linear);
    panel->height = 110;
    panel->from_zero = true;
    for (size_t i = 0; i < report_rows; i++) {
        if (self->tables[0].used[i] > 0) {
            figure_add_points(panel, name_of(self, i), count, number, values + (2 + i) * count);
        }
    }
    figure_add_limit(panel, "limit", 100);
    page_add_figure(page, &figure, "What each of the %zu tables reaches, and how much of each limit it uses.", count);
}

static void add_amplitudes(struct page *page, const struct design_report_sequence *self)
{
    const size_t count = self->line_count;
    const char *units[2] = {self->linear ? "N" : "Nm", self->linear ? "m/s" : "rad/s"};
    struct figure figure;
    figure_start(&figure, "frequency in Hz", axis_log);
    for (size_t i = 0; i < 2; i++) {
        char label[figure_text_max];
        const char *name = name_of(self, i == 0 ? report_torque : report_velocity);
        snprintf(label, sizeof label, "%s amplitude in %s", name, units[i]);
        struct figure_panel *panel = figure_add_panel(&figure, label, axis_linear);
        panel->height = 110;
        struct figure_series *stems = figure_add_stems(panel, name, count, self->lines, self->lines + (i + 1) * count);
        stems->colour = i == 0 ? figure_blue : figure_vermilion;
    }
    page_add_figure(page, &figure, "Amplitudes of the %zu lines of all tables.", count);
}

static void add_rows(struct page *page, const struct design_report_sequence *self)
{
    static const char *const heads[] = {"table",     "lines", "from Hz",      "to Hz",
                                        "effective", "unit",  "of the bound", "held back by"};
    page_start_table(page, "All tables.", "lrrrrlrl", heads);
    for (size_t t = 0; t < self->count; t++) {
        const struct design_report_table *table = &self->tables[t];
        char lines[24], first[24], last[24], effective[24], share[24], binding[64];
        snprintf(lines, sizeof lines, "%zu", table->lines);
        snprintf(first, sizeof first, "%.5g", table->first_hz);
        snprintf(last, sizeof last, "%.5g", table->last_hz);
        snprintf(effective, sizeof effective, "%.4g", table->effective_Nm);
        snprintf(share, sizeof share, "%.0f %%", 100 * table->effective_Nm / table->bound_Nm);
        write_binding(self, table, binding);
        const char *cells[] = {table->name, lines, first, last, effective, self->linear ? "N" : "Nm", share, binding};
        page_add_row(page, cells);
    }
    page_end_table(page);
}

bool design_report_sequence_write(struct design_report_sequence *self, struct page *page)
{
    double *values = malloc((2 + report_rows) * (self->count + 1) * sizeof *values);
    const bool whole = fflush(self->stream) == 0 && !ferror(self->stream);
    if (!values || !whole || self->count == 0) {
        free(values);
        return false;
    }
    add_note(page, self);
    page_add_section(page, "All tables");
    add_reached(page, self, values);
    add_amplitudes(page, self);
    add_rows(page, self);
    if (self->count > design_report_tables_shown) {
        page_add_paragraph(page, "The first %d tables are shown one by one below; each has its period in a CSV file.",
                           (int)design_report_tables_shown);
    }
    fwrite(self->text, 1, self->size, page->out);
    page->sections = self->page.sections;
    page->figures = self->page.figures;
    page->tables = self->page.tables;
    free(values);
    return true;
}

void design_report_sequence_free(struct design_report_sequence *self)
{
    if (self->stream) {
        fclose(self->stream);
    }
    free(self->text);
    for (size_t t = 0; t < self->count; t++) {
        free(self->tables[t].name);
    }
    free(self->tables);
    free(self->lines);
    *self = (struct design_report_sequence){0};
}
