/* SPDX-License-Identifier: MIT */
#include "lab/measure/report.h"

#include "lab/measure/drift.h"
#include "lab/measure/report_parts.h"
#include "lab/measure/table_value.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { number_size = 32 };
/// A first counted period this many times further from the last than the others still holds a transient.
static const double unsettled_ratio = 2.0;
/// Fewer late samples than this leave a response as it is, for all that noise lets be seen of it.
static const double late_share = 0.01;
/// A measurement that uses more of a limit than this may meet it the next time.
static const double tight_share = 0.95;

const struct report_words *report_words_of(bool linear)
{
    static const struct report_words rotary = {{"torque", "velocity", "position"}, {"Nm", "rad/s", "rad"}};
    static const struct report_words along = {{"force", "velocity", "position"}, {"N", "m/s", "m"}};
    return linear ? &along : &rotary;
}

static void add_end_note(struct page *page, const struct run *run, const struct measure_report *report)
{
    if (report->end == measure_complete) {
        page_add_note(page, page_good, "Complete", "%zu settling and %zu counted period%s of %zu samples.",
                      run->settle_periods, run->periods, run->periods == 1 ? "" : "s", run->period_samples);
    } else {
        page_add_note(page, page_bad, "Stopped early",
                      "%s. Kept are %zu of %zu rows: %zu settling and %zu counted whole periods.", report->stopped_by,
                      run->rows, report->rows_planned, run->settle_periods, run->periods);
    }
}

void report_add_late_note(struct page *page, uint64_t late, size_t rows)
{
    if ((double)late > late_share * (double)rows) {
        page_add_note(page, page_warning, "Samples came late",
                      "%llu of %zu: a response made of them is that of uneven samples.", (unsigned long long)late,
                      rows);
    }
}

static void add_lost_note(struct page *page, const struct measure_summary *summary, const struct measure_report *report)
{
    uint64_t late = 0;
    for (size_t i = 0; i < measure_parts; i++) {
        late += report->late_in_part[i];
    }
    if (summary->lost > 0) {
        page_add_note(page, page_warning, "Samples were lost",
                      "%zu of %zu; frf leaves out the %zu of %zu counted periods that they lie in.", summary->lost,
                      summary->run->rows, summary->periods_with_lost, summary->run->periods);
    } else {
        page_add_note(page, page_good, "No sample was lost", NULL);
    }
    report_add_late_note(page, late, summary->run->rows);
}

static void add_limit_note(struct page *page, const struct measure_summary *summary,
                           const struct measure_report *report)
{
    const struct report_words *words = report_words_of(summary->run->linear);
    if (report->torque_clipped > 0) {
        page_add_note(page, page_warning, "Set-points were clipped",
                      "%u to the %s limit: the excitation is not the table's there.", (unsigned)report->torque_clipped,
                      words->name[measure_torque]);
    }
    for (size_t q = 0; q < measure_quantities; q++) {
        const struct measure_level *level = &summary->level[q];
        if (level->used > tight_share) {
            page_add_note(page, page_warning, "Near a limit", "the %s went to %.0f %% of its limit of %.4g %s.",
                          words->name[q], 100.0 * level->used, level->limit, words->unit[q]);
        }
    }
}

static void add_settling_note(struct page *page, const struct measure_summary *summary)
{
    const double first = measure_summary_first(summary, measure_velocity);
    const double usual = measure_summary_usual(summary, measure_velocity);
    if (first > unsettled_ratio * usual) {
        page_add_note(page, page_warning, "Not settled",
                      "the velocity of the first counted period is %.2g %% off the last period's, that of the others "
                      "%.2g %%: --settle %zu or more.",
                      100.0 * first, 100.0 * usual, summary->run->settle_periods + 1);
    } else if (first <= unsettled_ratio * usual) {
        page_add_note(page, page_good, "Settled",
                      "the velocity of the first counted period is %.2g %% off the last period's, that of the others "
                      "%.2g %%.",
                      100.0 * first, 100.0 * usual);
    }
}

static void add_losses(struct page *page, const struct measure_summary *summary, const struct measure_report *report)
{
    const struct run *run = summary->run;
    const double part_s = (double)report->rows_planned / (double)measure_parts / run->sample_rate_hz;
    double time_s[measure_parts], lost[measure_parts], late[measure_parts];
    uint64_t kept_late = 0;
    page_add_section(page, "Lost and late samples");
    for (size_t i = 0; i < measure_parts; i++) {
        time_s[i] = ((double)i + 0.5) * part_s;
        lost[i] = summary->lost_in_part[i];
        late[i] = report->late_in_part[i];
        kept_late += report->late_in_part[i];
    }
    page_add_paragraph(page, "%zu of %zu samples were lost, %llu came late%s.", summary->lost, run->rows,
                       (unsigned long long)kept_late,
                       kept_late < report->counters.samples_late ? ", more of them before the first row and behind the "
                                                                   "last"
                                                                 : "");
    if (summary->lost == 0 && kept_late == 0) {
        return;
    }
    struct figure figure;
    figure_start(&figure, "time in s", axis_linear);
    figure.x_low = 0.0;
    figure.x_high = part_s * measure_parts;
    struct figure_panel *panel = figure_add_panel(&figure, "lost samples", axis_linear);
    panel->height = 80;
    panel->from_zero = true;
    figure_add_stems(panel, "lost", measure_parts, time_s, lost)->colour = figure_vermilion;
    panel = figure_add_panel(&figure, "late samples", axis_linear);
    panel->height = 80;
    panel->from_zero = true;
    figure_add_stems(panel, "late", measure_parts, time_s, late)->colour = figure_blue;
    page_add_figure(page, &figure, "Lost and late samples in each %.3g s, a hundredth of the measurement.", part_s);
}

/// NULL, which a table shows as a dash, for what is not there.
static const char *number_or_dash(double value, const char *unit, char out_text[number_size])
{
    if (!isfinite(value)) {
        return NULL;
    }
    snprintf(out_text, number_size, "%.4g%s", value, unit);
    return out_text;
}

static void add_level_table(struct page *page, const struct measure_summary *summary)
{
    static const char *const heads[] = {"",     "table, peak", "measured, peak", "limit",
                                        "used", "table, RMS",  "measured, RMS",  "unit"};
    const struct report_words *words = report_words_of(summary->run->linear);
    page_start_table(page, "Level against the table and the limits.", "lrrrrrrl", heads);
    for (size_t q = 0; q < measure_quantities; q++) {
        const struct measure_level *level = &summary->level[q];
        const double limit = level->limit > 0.0 ? level->limit : NAN;
        char text[6][number_size];
        const char *const cells[] = {
            words->name[q],
            number_or_dash(level->table_peak, "", text[0]),
            number_or_dash(level->peak, "", text[1]),
            number_or_dash(limit, "", text[2]),
            number_or_dash(limit > 0.0 ? 100.0 * level->used : NAN, " %", text[3]),
            number_or_dash(level->table_rms, "", text[4]),
            number_or_dash(level->rms, "", text[5]),
            words->unit[q],
        };
        page_add_row(page, cells);
    }
    page_end_table(page);
}

/// What the table asked for in the shown period: `out_values` NULL for a quantity that it says nothing of.
static bool take_asked(const struct measure_summary *summary, size_t quantity, size_t first_row, double *out_values)
{
    static const char *const columns[2][measure_quantities] = {{NULL, "velocity_ref_rad_per_s", "position_ref_rad"},
                                                               {NULL, "velocity_ref_m_per_s", "position_ref_m"}};
    const char *name = columns[summary->run->linear][quantity];
    const double *column = name ? run_column(summary->run, name) : NULL;
    const struct msgen_table *table = summary->table;
    if (!column && (quantity == measure_position || quantity >= table->channels)) {
        return false;
    }
    for (uint32_t n = 0; n < table->period_samples; n++) {
        const uint32_t at = (table->start_index + n) % table->period_samples;
        out_values[n] = column ? column[first_row + n] : table_value_at(table, at, (uint32_t)quantity);
    }
    return true;
}

static void add_period_panel(struct figure *figure, const struct measure_summary *summary, size_t quantity,
                             const double *time_s, double *asked)
{
    const struct report_words *words = report_words_of(summary->run->linear);
    const struct measure_level *level = &summary->level[quantity];
    const size_t length = summary->run->period_samples;
    const size_t first_row = summary->reference * length;
    char label[figure_text_max];
    snprintf(label, sizeof label, "%s in %s", words->name[quantity], words->unit[quantity]);
    struct figure_panel *panel = figure_add_panel(figure, label, axis_linear);
    panel->height = 130;
    struct figure_series *measured =
        figure_add_line(panel, "measured", length, time_s, summary->column[quantity] + first_row);
    measured->colour = figure_blue;
    measured->size = 1;
    if (take_asked(summary, quantity, first_row, asked)) {
        struct figure_series *line = figure_add_line(panel, "table", length, time_s, asked);
        line->colour = figure_vermilion;
        line->dash = figure_dashed;
        line->size = 1;
    }
    if (level->limit > 0.0) {
        snprintf(label, sizeof label, "limits ±%.4g", level->limit);
        const enum figure_dash dash = figure_add_limit(panel, label, level->limit)->dash;
        figure_add_limit(panel, "", -level->limit)->dash = dash;
    }
}

static void add_period(struct page *page, const struct measure_summary *summary)
{
    const size_t length = summary->run->period_samples;
    double *values = malloc((1 + measure_quantities) * length * sizeof *values);
    struct figure figure;
    if (!values) {
        page_add_paragraph(page, "Memory was short for the figure of one period.");
        return;
    }
    figure_start(&figure, "time in s", axis_linear);
    for (size_t n = 0; n < length; n++) {
        values[n] = (double)(summary->reference * length + n) / summary->run->sample_rate_hz;
    }
    for (size_t q = 0; q < measure_quantities; q++) {
        add_period_panel(&figure, summary, q, values, values + (1 + q) * length);
    }
    const char *mode = run_key(summary->run, "mode");
    const bool cascade = mode && strcmp(mode, "cascade") == 0;
    page_add_figure(page, &figure, "Period %zu, the last without lost samples, and what the table has for it. %s",
                    summary->reference + 1,
                    cascade
                        ? "Torque or force of the table are those of its own inertia; where the drive's is another, "
                          "the controller makes up for it."
                        : "Nothing holds the speed in torque mode: the table's is that of a drive of its own "
                          "inertia without friction.");
    free(values);
}

static void add_level(struct page *page, const struct measure_summary *summary)
{
    page_add_section(page, "Level");
    add_level_table(page, summary);
    if (summary->reference < summary->whole) {
        add_period(page, summary);
    } else {
        page_add_paragraph(page, "No period came whole: none is shown.");
    }
}

static void add_settling(struct page *page, const struct measure_summary *summary)
{
    const struct report_words *words = report_words_of(summary->run->linear);
    double *numbers = malloc((summary->whole + 1) * sizeof *numbers);
    struct figure figure;
    page_add_section(page, "Settling");
    if (!numbers || summary->reference == summary->whole || summary->whole < 2) {
        page_add_paragraph(page, "Two whole periods would be needed to compare one with the other; there %s %zu.",
                           summary->whole == 1 ? "is" : "are", summary->whole);
        free(numbers);
        return;
    }
    for (size_t p = 0; p < summary->whole; p++) {
        numbers[p] = (double)(p + 1);
    }
    figure_start(&figure, "period", axis_linear);
    figure.x_low = 0.0;
    figure.x_high = (double)(summary->whole + 1);
    struct figure_panel *panel = figure_add_panel(&figure, "distance from the last period over its size", axis_log);
    for (size_t q = 0; q <= measure_velocity; q++) {
        figure_add_points(panel, words->name[q], summary->whole, numbers, summary->distance[q])->size = 5;
    }
    page_add_figure(page, &figure,
                    "RMS of what each period differs by from period %zu, over the RMS of that, means removed. A start "
                    "transient falls from the left; what stays level is noise, that of both periods. The first %zu of "
                    "%zu periods %s not count%s.",
                    summary->reference + 1, summary->run->settle_periods, summary->whole,
                    summary->run->settle_periods == 1 ? "does" : "do",
                    summary->lost > 0 ? "; periods with lost samples are left out" : "");
    free(numbers);
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a;
    const double y = *(const double *)b;
    return (x > y) - (x < y);
}

/// "the measured torque is 0.98 times the table's in the middle, 0.91 to 1.04 times": nothing where there is no table.
static void add_ratio(struct page *page, const char *name, size_t count, const double *measured, const double *table)
{
    double *ratios = malloc((count + 1) * sizeof *ratios);
    size_t found = 0;
    for (size_t i = 0; ratios && i < count; i++) {
        if (isfinite(measured[i]) && table[i] > 0.0) {
            ratios[found++] = measured[i] / table[i];
        }
    }
    if (found == 1) {
        page_add_item(page, name, "has %.3g times the table's amplitude at its line.", ratios[0]);
    } else if (found > 0) {
        qsort(ratios, found, sizeof *ratios, ascending);
        page_add_item(page, name,
                      "has %.3g times the table's amplitude at the middle one of %zu lines, %.3g to %.3g "
                      "times at all of them.",
                      ratios[found / 2], found, ratios[0], ratios[found - 1]);
    }
    free(ratios);
}

void report_add_spectrum(struct page *page, bool linear, size_t count, const double *frequency_hz,
                         double *const amplitude[], double *const table_amplitude[], const char *what)
{
    const struct report_words *words = report_words_of(linear);
    struct figure figure;
    page_start_list(page);
    for (size_t q = 0; q <= measure_velocity; q++) {
        add_ratio(page, words->name[q], count, amplitude[q], table_amplitude[q]);
    }
    page_end_list(page);
    figure_start(&figure, "frequency in Hz", axis_log);
    for (size_t q = 0; q <= measure_velocity; q++) {
        char label[figure_text_max];
        snprintf(label, sizeof label, "%s amplitude in %s", words->name[q], words->unit[q]);
        struct figure_panel *panel = figure_add_panel(&figure, label, axis_log);
        panel->height = 140;
        struct figure_series *points = figure_add_points(panel, "table", count, frequency_hz, table_amplitude[q]);
        points->colour = figure_vermilion;
        points->marker = figure_square;
        points->size = 5;
        points = figure_add_points(panel, "measured", count, frequency_hz, amplitude[q]);
        points->colour = figure_blue;
        points->marker = figure_circle;
        points->size = 3;
    }
    page_add_figure(page, &figure, "Amplitudes at the %zu excited line%s%s.", count, count == 1 ? "" : "s", what);
}

static void add_spectrum(struct page *page, const struct measure_summary *summary)
{
    char what[96];
    page_add_section(page, "Amplitudes at the lines");
    if (summary->averaged == 0) {
        page_add_paragraph(page, "No period came whole: there are no amplitudes to show.");
        return;
    }
    snprintf(what, sizeof what, ", of the mean of %zu %s period%s", summary->averaged,
             summary->run->periods > 0 ? "counted" : "settling", summary->averaged == 1 ? "" : "s");
    report_add_spectrum(page, summary->run->linear, summary->line_count, summary->frequency_hz, summary->amplitude,
                        summary->table_amplitude, what);
}

/// Later half of the counted periods against the earlier half.
static void add_drift(struct page *page, const struct measure_summary *summary)
{
    const struct report_words *words = report_words_of(summary->run->linear);
    struct measure_drift drift;
    struct figure figure;
    page_add_section(page, "Whether it stayed the same");
    if (!measure_drift_find(summary, &drift)) {
        page_add_paragraph(page, "Memory was short for this section.");
        return;
    }
    if (!drift.over_two_std[0]) {
        page_add_paragraph(page,
                           "Four counted periods without lost samples would be needed to compare the end with the "
                           "beginning; there %s %zu.",
                           drift.periods[0] + drift.periods[1] == 1 ? "is" : "are",
                           drift.periods[0] + drift.periods[1]);
        return;
    }
    page_add_paragraph(
        page,
        "From the first %zu counted periods to the last %zu, the %s changes by more than 2 std at %zu of "
        "%zu lines, the %s at %zu; noise alone would do that at about %.2g %% of them.",
        drift.periods[0], drift.periods[1], words->name[measure_torque], drift.beyond[measure_torque], drift.line_count,
        words->name[measure_velocity], drift.beyond[measure_velocity], 100.0 * drift.chance);
    figure_start(&figure, "frequency in Hz", axis_log);
    struct figure_panel *panel = figure_add_panel(&figure, "change over 2 std, end less beginning", axis_log);
    for (size_t q = 0; q <= measure_velocity; q++) {
        figure_add_points(panel, words->name[q], drift.line_count, summary->frequency_hz, drift.over_two_std[q]);
    }
    figure_add_limit(panel, "1: within 2 std", 1.0);
    page_add_figure(page, &figure,
                    "Difference of the means over both halves of the measurement at each line, over 2 std of it, from "
                    "the scatter of the periods in each half.");
    measure_drift_free(&drift);
}

void measure_page_sections(struct page *page, const struct measure_summary *summary,
                           const struct measure_report *report)
{
    const struct run *run = summary->run;
    add_end_note(page, run, report);
    add_lost_note(page, summary, report);
    report_add_bus_note(page, run);
    add_limit_note(page, summary, report);
    add_settling_note(page, summary);
    report_add_bus(page, run);
    add_losses(page, summary, report);
    add_level(page, summary);
    add_settling(page, summary);
    add_spectrum(page, summary);
    add_drift(page, summary);
}
