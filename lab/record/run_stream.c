/* SPDX-License-Identifier: MIT */
#include "lab/record/run_stream.h"

#include "lab/record/format.h"
#include "lab/record/run_checks.h"
#include "lab/record/run_guess.h"
#include "lab/record/run_names.h"
#include "lab/record/text_stream.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* Rows are checked in pieces that the cache still holds. */
enum { piece_rows = 65536 };

struct run_stream {
    struct run_options options;
    struct text_stream text;
    struct run_map_plan plan;
    struct run_checks checks;
    struct run run;     /* sees the columns and keys of text.table, and owns its bins */
    size_t key_count;   /* keys in front of the names */
    double key_rate_hz; /* the rate that the keys say, 0: none */
    bool forgot;
};

static void view(struct run_stream *self)
{
    run_view_table(&self->text.table, &self->run);
    self->run.sample_rate_hz = self->key_rate_hz;
    self->run.sample_rate_hz = run_checks_rate(&self->checks, &self->run, &self->options);
}

static int read_keys(struct run_stream *self, struct error *out_error)
{
    int status = run_read_keys(&self->text.table, &self->run, out_error);
    self->key_rate_hz = self->run.sample_rate_hz;
    self->key_count = self->text.table.key_count;
    return status;
}

/* Foreign columns get names, their cells have to be numbers from then on, and a key says so. */
static int guess_names(struct run_stream *self, struct run_map *out_map, struct error *out_error)
{
    const size_t keep_count = sizeof self->options.keep / sizeof self->options.keep[0];
    int status = run_guess_map(&self->text.table, self->options.keep, keep_count, out_map, out_error);
    for (size_t i = 0; !status && i < out_map->count; i++)
        for (size_t c = 0; c < self->text.cell_count; c++)
            if (strcmp(self->text.table.columns[c].name, out_map->entries[i].source) == 0)
                self->text.kinds[c] = text_cell_number;
    return status ? status : run_guess_note(out_map, &self->text.table, out_error);
}

/* A table of another program that is refused here may be one that convert reads: whoever is refused is told. */
static int say_convert(const char *path, int status, struct error *io_error)
{
    struct error ignored;
    const struct record_format *format;
    struct stat file;
    const bool told =
        !io_error || strstr(io_error->message, "servoscope convert") || strstr(io_error->message, "--map");
    if (status != error_refused || told || stat(path, &file) != 0 || !S_ISREG(file.st_mode) ||
        format_by_content(path, &format, &ignored) != 0)
        return status;
    const size_t length = strlen(io_error->message);
    if (strcmp(format->name, "text") == 0 || strcmp(format->name, "twincat") == 0)
        snprintf(io_error->message + length, sizeof io_error->message - length,
                 "; 'servoscope convert' makes a run of other programs' tables");
    return status;
}

static int open_all(struct run_stream *self, const char *path, struct error *out_error)
{
    struct run_map map = {0};
    int status = run_check_options(&self->options, out_error);
    if (!status)
        status = run_map_parse(&map, self->options.map, out_error);
    if (!status)
        status = say_convert(path, text_stream_open(path, run_map_judge, &map, &self->text, out_error), out_error);
    if (!status && self->options.guess && map.count == 0) {
        run_map_free(&map);
        status = guess_names(self, &map, out_error);
    }
    if (!status)
        status = run_map_rename(&map, &self->text.table, &self->plan, out_error);
    run_map_free(&map);
    if (!status)
        status = run_check_names(&self->text.table, &self->run, out_error);
    if (!status)
        status = read_keys(self, out_error);
    if (!status) {
        run_view_table(&self->text.table, &self->run);
        run_checks_begin(&self->checks, &self->run, &self->options);
        view(self);
    }
    return status;
}

int run_stream_open(const char *path, const struct run_options *options, struct run_stream **out_self,
                    struct error *out_error)
{
    struct run_stream *self = calloc(1, sizeof *self);
    *out_self = NULL;
    if (!self)
        return error_set(out_error, error_refused, "%s: memory is short", path);
    self->options = options ? *options : (struct run_options){0};
    int status = open_all(self, path, out_error);
    self->options.map = NULL;
    if (status)
        run_stream_close(self);
    else
        *out_self = self;
    return status;
}

int run_stream_fill(struct run_stream *self, size_t rows, struct error *out_error)
{
    int status = error_none;
    while (!status && !self->text.ended && self->text.table.rows < rows) {
        size_t first = self->text.table.rows;
        size_t piece = rows - first < piece_rows ? rows - first : piece_rows;
        status = text_stream_fill(&self->text, first + piece, out_error);
        status = say_convert(self->text.table.path, status, out_error);
        if (!status)
            status = run_map_fill(&self->plan, &self->text.table, first, out_error);
        self->run.sample_rate_hz = self->key_rate_hz;
        if (!status)
            status = run_checks_rows(&self->checks, &self->text.table, &self->run, first, out_error);
    }
    view(self);
    return status;
}

const struct run *run_stream_run(const struct run_stream *self)
{
    return &self->run;
}

bool run_stream_ended(const struct run_stream *self)
{
    return self->text.ended;
}

size_t run_stream_rows(const struct run_stream *self)
{
    return self->text.row_total;
}
double run_stream_share(const struct run_stream *self)
{
    return text_stream_share(&self->text);
}

void run_stream_forget(struct run_stream *self)
{
    text_stream_forget_rows(&self->text);
    self->forgot = true;
    view(self);
}

static char *copy_text(const char *text, bool *io_done)
{
    char *copy = strdup(text);
    *io_done = *io_done && copy;
    return copy;
}

/* A run without rows that owns copies of everything else. */
static bool copy_header(const struct run *run, struct run *out)
{
    bool done = true;
    *out = *run;
    out->rows = 0;
    out->path = copy_text(run->path, &done);
    out->columns = calloc(run->column_count + 1, sizeof *out->columns);
    out->keys = calloc(run->key_count + 1, sizeof *out->keys);
    out->bins = run->bins ? malloc(run->bin_count * sizeof *out->bins) : NULL;
    if (!out->columns || !out->keys || (run->bins && !out->bins)) {
        out->column_count = out->columns ? run->column_count : 0;
        out->key_count = out->keys ? run->key_count : 0;
        return false;
    }
    for (size_t c = 0; c < run->column_count; c++)
        out->columns[c].name = copy_text(run->columns[c].name, &done);
    for (size_t k = 0; k < run->key_count; k++)
        out->keys[k] = (struct run_key){copy_text(run->keys[k].key, &done), copy_text(run->keys[k].value, &done)};
    if (run->bins)
        memcpy(out->bins, run->bins, run->bin_count * sizeof *out->bins);
    return done;
}

int run_stream_split(struct run_stream *self, struct run *out_run, struct error *out_error)
{
    if (!copy_header(&self->run, out_run)) {
        run_free(out_run);
        return error_set(out_error, error_refused, "%s: memory is short", self->run.path);
    }
    out_run->rows = self->run.rows;
    for (size_t c = 0; c < out_run->column_count; c++)
        out_run->columns[c].data = text_stream_give_column(&self->text, c);
    run_stream_forget(self);
    return error_none;
}

/* What was forgotten has been understood without these keys. */
static int check_late_keys(const struct run_stream *self, struct error *out_error)
{
    const struct text_table *table = &self->text.table;
    for (size_t k = self->key_count; k < table->key_count && self->forgot; k++)
        if (run_is_field_key(table->keys[k].key))
            return error_set(out_error, error_refused,
                             "%s:%zu: %s: in a recording that is too large for memory this key has to stand in front "
                             "of the row of names (line %zu)",
                             table->path, table->key_line[k], table->keys[k].key, table->names_line);
    return error_none;
}

int run_stream_finish(struct run_stream *self, struct error *out_error)
{
    int status = check_late_keys(self, out_error);
    if (!status && self->text.table.key_count > self->key_count)
        status = read_keys(self, out_error);
    self->run.sample_rate_hz = self->key_rate_hz;
    if (!status)
        status = run_checks_end(&self->checks, &self->text.table, &self->run, &self->options, out_error);
    return say_convert(self->text.table.path, status, out_error);
}

int run_stream_take(struct run_stream *self, struct run *out_run, struct error *out_error)
{
    *out_run = (struct run){0};
    int status = run_stream_finish(self, out_error);
    if (status)
        return status;
    run_move_table(&self->text.table, &self->run);
    *out_run = self->run;
    self->run = (struct run){0};
    return error_none;
}

void run_stream_close(struct run_stream *self)
{
    if (!self)
        return;
    free(self->run.bins);
    run_map_plan_free(&self->plan);
    text_stream_close(&self->text);
    free(self);
}
