/* SPDX-License-Identifier: MIT */
/// Text exports of the TwinCAT Scope: a head, one row for each property of the channels (name, sample time, unit, ...),
/// then values, each group of channels behind its own column of time stamps in milliseconds. Separator and decimal mark
/// are settings of whoever exported it.
#include "lab/record/foreign_text.h"
#include "lab/record/format.h"
#include "lab/record/record_table.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { name_size = 160, unit_size = 32 };

struct channel {
    char name[name_size];
    size_t time, cell; ///< columns of the file
    double step_ms;    ///< 0: not said
};

struct scope {
    struct foreign_text text;
    char separator, decimal;
    size_t names, first, end; ///< lines: row of names, first row of values, behind the last one
    size_t count;
    struct channel *channels;
};

static enum format_match recognise(const unsigned char *head, size_t length)
{
    char *text = foreign_text_head(head, length);
    const bool own = text && strncmp(text, "Name", 4) == 0 && (strstr(text, "\nFile") || strstr(text, "\rFile")) &&
                     strstr(text, "Starttime of export");
    free(text);
    return own ? format_match_sure : format_match_none;
}

static int refuse(const struct scope *self, size_t line, const char *what, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s:%zu: %s", self->text.path, line + 1, what);
}

static bool begins_with(const struct scope *self, size_t line, const char *word)
{
    const char *text = self->text.lines[line];
    const size_t length = strlen(word);
    return strncmp(text, word, length) == 0 && (text[length] == self->separator || text[length] == '\0');
}

/// The head of the file has a "Name" too; the channels' is the one behind the first blank line.
static int find_rows(struct scope *self, struct error *out_error)
{
    size_t line = 0;
    while (line < self->text.count && !foreign_line_is_blank(self->text.lines[line]))
        line++;
    while (line < self->text.count && !begins_with(self, line, "Name"))
        line++;
    self->names = line;
    while (line < self->text.count && !foreign_line_is_blank(self->text.lines[line]))
        line++;
    while (line < self->text.count && foreign_line_is_blank(self->text.lines[line]))
        line++;
    self->first = line;
    while (line < self->text.count && !foreign_line_is_blank(self->text.lines[line]) && !begins_with(self, line, "EOF"))
        line++;
    self->end = line;
    return self->first < self->end
               ? 0
               : refuse(self, self->first ? self->first - 1 : 0,
                        "ends before the values: expected a row of names that begins with 'Name', a blank line, values",
                        out_error);
}

/// The row of a property, split; a count of 0 if the export has none.
static int split_property(const struct scope *self, const char *property, struct foreign_cells *out_cells,
                          struct error *out_error)
{
    *out_cells = (struct foreign_cells){0};
    for (size_t line = self->names; line < self->first; line++)
        if (begins_with(self, line, property))
            return foreign_cells_split(self->text.lines[line], self->separator, out_cells, out_error);
    return 0;
}

static const char *cell_or_empty(const struct foreign_cells *cells, size_t at)
{
    return at < cells->count ? cells->items[at] : "";
}

/// "dV (Voltage)" is dV, "(None)" nothing.
static void read_unit(const char *cell, char out_unit[unit_size])
{
    snprintf(out_unit, unit_size, "%.*s", (int)strcspn(cell, "("), cell);
    for (size_t length = strlen(out_unit); length > 0 && out_unit[length - 1] == ' ';)
        out_unit[--length] = '\0';
}

static void take_channels(struct scope *self, const struct foreign_cells *names, const struct foreign_cells *steps,
                          const struct foreign_cells *units)
{
    size_t time = 0;
    for (size_t at = 0; at < names->count; at++) {
        if (strcmp(names->items[at], "Name") == 0) {
            time = at;
            continue;
        }
        char unit[unit_size], step[32];
        struct channel *channel = &self->channels[self->count++];
        *channel = (struct channel){.time = time, .cell = at};
        read_unit(cell_or_empty(units, at), unit);
        foreign_name(names->items[at], unit, channel->name, sizeof channel->name);
        snprintf(step, sizeof step, "%s", cell_or_empty(steps, at));
        if (!foreign_is_number(foreign_number(step, self->decimal, &channel->step_ms)))
            channel->step_ms = 0;
    }
}

static int read_channels(struct scope *self, struct error *out_error)
{
    struct foreign_cells names = {0}, steps = {0}, units = {0};
    int status = split_property(self, "Name", &names, out_error);
    if (!status)
        status = split_property(self, "SampleTime[ms]", &steps, out_error);
    if (!status)
        status = split_property(self, "Unit", &units, out_error);
    if (!status) {
        self->channels = calloc(names.count + 1, sizeof *self->channels);
        status = self->channels ? 0 : error_set(out_error, error_refused, "%s: memory is short", self->text.path);
    }
    if (!status)
        take_channels(self, &names, &steps, &units);
    foreign_cells_free(&names);
    foreign_cells_free(&steps);
    foreign_cells_free(&units);
    return status ? status : self->count ? 0 : refuse(self, self->names, "names no channel", out_error);
}

static bool same_step(double a, double b)
{
    return fabs(a - b) <= 1e-6 * fmax(a, b);
}

/// The sample time of --rate, else that of the most channels, the shorter one of two.
static double choose_step(const struct scope *self, double rate_hz, struct format_notes *io_notes)
{
    size_t most = 0;
    double best = rate_hz > 0.0 ? 1000.0 / rate_hz : 0.0;
    bool several = false;
    for (size_t i = 0; i < self->count; i++) {
        size_t count = 0;
        for (size_t k = 0; k < self->count; k++)
            count += same_step(self->channels[k].step_ms, self->channels[i].step_ms);
        several = several || count < self->count;
        if (rate_hz > 0.0)
            continue;
        const double step = self->channels[i].step_ms;
        best = count > most || (count == most && step < best) ? step : best;
        most = count > most ? count : most;
    }
    if (several && !(rate_hz > 0.0))
        format_notes_add(io_notes, format_assumed, "sample time %g ms, that of most channels (--rate chooses another)",
                         best);
    return best;
}

/// How many of a channel's values make one step; 0: its step is longer, or no whole part of it.
static size_t stride_of(const struct channel *channel, double step_ms)
{
    const double ratio = channel->step_ms > 0.0 ? step_ms / channel->step_ms : 1.0;
    const double whole = floor(ratio + 0.5);
    return whole >= 1.0 && fabs(ratio - whole) < 1e-6 * whole ? (size_t)whole : 0;
}

/// Values of all rows: `rows` times `width` numbers, NaN where a cell is empty.
static int read_values(struct scope *self, size_t width, double *out_values, struct error *out_error)
{
    for (size_t line = self->first; line < self->end; line++) {
        struct foreign_cells cells;
        double *row = out_values + (line - self->first) * width;
        int status = foreign_cells_split(self->text.lines[line], self->separator, &cells, out_error);
        for (size_t at = 0; at < width && !status; at++) {
            row[at] = NAN;
            if (at < cells.count && foreign_number(cells.items[at], self->decimal, &row[at]) == foreign_value_text)
                status = error_set(out_error, error_refused, "%s:%zu: cell %zu: '%s' is not a number", self->text.path,
                                   line + 1, at + 1, cells.items[at]);
        }
        foreign_cells_free(&cells);
        if (status)
            return status;
    }
    return 0;
}

/// Where a channel's values at the common times are: the row of time `start_ms`, then every stride-th.
struct run_of_values {
    size_t first, count;
};

/// Cells may be empty between the first value and the last: those are gaps, for foreign_take_run to mark.
static struct run_of_values find_values(const struct scope *self, const struct channel *channel, const double *values,
                                        size_t width, double start_ms, double step_ms, size_t stride)
{
    const size_t rows = self->end - self->first;
    struct run_of_values found = {0, 0};
    while (found.first < rows && !(values[found.first * width + channel->time] >= start_ms - 0.01 * step_ms))
        found.first++;
    if (found.first == rows || values[found.first * width + channel->time] > start_ms + 0.01 * step_ms)
        return found;
    for (size_t row = found.first, at = 1; row < rows; row += stride, at++)
        if (!isnan(values[row * width + channel->time]) && !isnan(values[row * width + channel->cell]))
            found.count = at;
    return found;
}

/// Where the common times begin: when all channels have begun, at a time of one that has no more values than wanted.
static double start_of(const struct scope *self, double step_ms, const double *values, size_t width)
{
    double start = -INFINITY;
    for (size_t i = 0; i < self->count; i++)
        if (stride_of(&self->channels[i], step_ms) && values[self->channels[i].time] > start)
            start = values[self->channels[i].time];
    for (size_t i = 0; i < self->count; i++)
        for (size_t row = 0; stride_of(&self->channels[i], step_ms) == 1 && row < self->end - self->first; row++)
            if (values[row * width + self->channels[i].time] >= start)
                return values[row * width + self->channels[i].time];
    return start;
}

static void note_channel(const struct channel *channel, size_t stride, size_t count, double step_ms,
                         struct format_notes *io_notes)
{
    if (stride == 0)
        format_notes_add(io_notes, format_lost, "%s: sampled every %g ms, no part of %g ms", channel->name,
                         channel->step_ms, step_ms);
    else if (count == 0)
        format_notes_add(io_notes, format_lost, "%s: has no value at the times of the others", channel->name);
    else if (stride > 1)
        format_notes_add(io_notes, format_lost, "%s: of %zu values in %g ms only the first is kept, without a filter",
                         channel->name, stride, step_ms);
}

static int add_channel(struct text_table *table, const char *name, const double *values, size_t width, size_t cell,
                       struct run_of_values at, size_t stride, size_t rows, double scale, struct error *out_error)
{
    double *data = malloc(rows * sizeof *data);
    if (!data)
        return error_set(out_error, error_refused, "%s: memory is short", table->path);
    for (size_t n = 0; n < rows; n++)
        data[n] = scale * values[(at.first + n * stride) * width + cell];
    return record_table_add_column(table, name, data, rows, out_error);
}

/// The common times, and the lines of the file that they stand in.
static int add_time(const struct scope *self, struct text_table *table, const double *values, size_t width, size_t cell,
                    struct run_of_values at, size_t stride, size_t rows, struct error *out_error)
{
    const int status = add_channel(table, "time_s", values, width, cell, at, stride, rows, 1e-3, out_error);
    for (size_t n = 0; !status && n < rows; n++)
        table->row_line[n] = self->first + at.first + n * stride + 1;
    return status;
}

/// Channels begin and end a row apart; more is the end of a shorter one, and what the others have behind it is lost.
static void note_shortest(const struct scope *self, const struct run_of_values *at, size_t rows,
                          struct format_notes *io_notes)
{
    size_t longest = 0;
    for (size_t i = 0; at && i < self->count; i++)
        longest = at[i].count > longest ? at[i].count : longest;
    for (size_t i = 0; at && i < self->count; i++)
        if (at[i].count == rows && longest > rows + 1) {
            format_notes_add(io_notes, format_lost,
                             "%s: ends after %zu values, others after %zu: only so many are kept",
                             self->channels[i].name, rows, longest);
        }
}

/// The channel whose times and lines stand for all: one that has a value in each row of its own, else any.
static size_t find_clock(const struct scope *self, const struct run_of_values *at, double step_ms)
{
    size_t clock = self->count;
    for (size_t i = self->count; at && i-- > 0;)
        if (at[i].count > 0 && (clock == self->count || stride_of(&self->channels[i], step_ms) == 1 ||
                                stride_of(&self->channels[clock], step_ms) != 1))
            clock = i;
    return clock;
}

/// Channels that have values at the common times become columns, as long as the shortest of them.
static int make_table(struct scope *self, double step_ms, const double *values, size_t width, struct text_table *table,
                      struct format_notes *io_notes, struct error *out_error)
{
    struct run_of_values *at = calloc(self->count, sizeof *at);
    const double start = start_of(self, step_ms, values, width);
    size_t rows = SIZE_MAX;
    int status = at ? 0 : error_set(out_error, error_refused, "%s: memory is short", self->text.path);
    for (size_t i = 0; i < self->count && !status; i++) {
        const size_t stride = stride_of(&self->channels[i], step_ms);
        if (stride)
            at[i] = find_values(self, &self->channels[i], values, width, start, step_ms, stride);
        note_channel(&self->channels[i], stride, at[i].count, step_ms, io_notes);
        rows = at[i].count && at[i].count < rows ? at[i].count : rows;
    }
    note_shortest(self, at, rows, io_notes);
    const size_t clock = find_clock(self, at, step_ms);
    if (!status && clock < self->count)
        status = add_time(self, table, values, width, self->channels[clock].time, at[clock],
                          stride_of(&self->channels[clock], step_ms), rows, out_error);
    for (size_t i = 0; i < self->count && !status && clock < self->count; i++) {
        const struct channel *channel = &self->channels[i];
        if (at[i].count > 0)
            status = add_channel(table, channel->name, values, width, channel->cell, at[i], stride_of(channel, step_ms),
                                 rows, 1.0, out_error);
    }
    const bool timed = clock < self->count;
    free(at);
    return status || timed ? status : refuse(self, self->first, "no channel has values at that sample time", out_error);
}

static size_t width_of(const struct scope *self)
{
    return self->channels[self->count - 1].cell + 1;
}

/// A comma in a value is a decimal mark wherever commas do not separate.
static char find_decimal(const struct scope *self)
{
    for (size_t line = self->first; line < self->end; line++)
        if (self->separator != ',' && strchr(self->text.lines[line], ','))
            return ',';
    return '.';
}

static int convert(struct scope *self, const struct format_options *options, struct run *out_run,
                   struct format_notes *io_notes, struct error *out_error)
{
    int status = find_rows(self, out_error);
    self->decimal = status ? '.' : find_decimal(self);
    if (!status)
        status = read_channels(self, out_error);
    if (status)
        return status;
    const size_t width = width_of(self);
    const double step_ms = choose_step(self, options->run.rate_hz, io_notes);
    double *values = malloc((self->end - self->first) * width * sizeof *values);
    struct text_table table;
    status = record_table_start(&table, self->text.path, out_error);
    if (!status && !values)
        status = error_set(out_error, error_refused, "%s: memory is short", self->text.path);
    if (!status)
        status = read_values(self, width, values, out_error);
    if (!status)
        status = make_table(self, step_ms, values, width, &table, io_notes, out_error);
    free(values);
    if (!status)
        return foreign_take_run(&table, options, out_run, io_notes, out_error);
    text_table_free(&table);
    return status;
}

static int read_scope(const char *path, const struct format_options *options, struct record *out_record,
                      struct format_notes *io_notes, struct error *out_error)
{
    struct scope self = {.count = 0};
    *out_record = (struct record){.kind = record_run};
    int status = foreign_text_read(path, &self.text, out_error);
    if (status)
        return status;
    self.separator = self.text.lines[0][strlen("Name")];
    status = convert(&self, options, &out_record->run, io_notes, out_error);
    free(self.channels);
    foreign_text_free(&self.text);
    return status;
}

const struct record_format record_format_scope = {
    .name = "twincat",
    .summary = "text exports of the TwinCAT Scope, whatever separator and decimal mark",
    .recognise = recognise,
    .read = read_scope,
};
