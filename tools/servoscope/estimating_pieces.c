/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/estimating_pieces.h"

#include "lab/estimate/frf_mean.h"
#include "lab/estimate/method.h"
#include "lab/estimate/online.h"
#include "tools/servoscope/interrupt.h"

#include <stdio.h>
#include <string.h>

enum {
    leading_numbers = 1 << 22,
    whole_numbers = 1 << 27,
    leading_periods = 4,
    piece_rows = 65536,
};

static size_t rows_of(const struct run *run, size_t numbers)
{
    size_t rows = numbers / (run->column_count > 0 ? run->column_count : 1);
    return rows > piece_rows ? rows : piece_rows;
}

static int read_whole(struct run_stream *stream, const char *method, struct error *out_error)
{
    const struct run *run = run_stream_run(stream);
    const size_t rows = rows_of(run, whole_numbers);
    int status = run_stream_fill(stream, rows, out_error);
    if (status || run_stream_ended(stream)) {
        return status;
    }
    return error_set(out_error, error_refused,
                     "%s: has more than %zu rows of %zu columns, and --method %s needs them all at once, which is more "
                     "than 1 GiB: expected a part of it, or --method mean, which reads it piece by piece",
                     run->path, rows, run->column_count, method);
}

int estimating_pieces_open(const char *path, const struct run_options *options, const char *needs_whole,
                           size_t period_samples, struct estimating_pieces *out_self, struct error *out_error)
{
    *out_self = (struct estimating_pieces){.stream = NULL};
    int status = run_stream_open(path, options, &out_self->stream, out_error);
    if (status) {
        return status;
    }
    const struct run *run = run_stream_run(out_self->stream);
    const size_t period = period_samples > 0 ? period_samples : run->period_samples;
    size_t rows = rows_of(run, leading_numbers);
    if (period < whole_numbers && rows / leading_periods < period) {
        rows = leading_periods * period;
    }
    status = run_stream_fill(out_self->stream, rows, out_error);
    if (!status && !run_stream_ended(out_self->stream) && needs_whole) {
        status = read_whole(out_self->stream, needs_whole, out_error);
    }
    const bool whole = run_stream_ended(out_self->stream);
    if (!status) {
        status = whole ? run_stream_take(out_self->stream, &out_self->run, out_error)
                       : run_stream_split(out_self->stream, &out_self->run, out_error);
    }
    if (status || whole) {
        run_stream_close(out_self->stream);
        out_self->stream = NULL;
    }
    return status;
}

void estimating_pieces_free(struct estimating_pieces *self)
{
    run_stream_close(self->stream);
    run_free(&self->run);
    *self = (struct estimating_pieces){.stream = NULL};
}

/// What the leading part shows by itself; its response serves only for that.
static int find_in_leading(const struct run *run, const struct periodic_options *options, const struct inputs *inputs,
                           struct estimating_summary *io_summary, struct frf *out_frf, struct error *out_error)
{
    struct periodic recording;
    int status = periodic_cut(run, options, &recording, out_error);
    if (status) {
        return status;
    }
    status = frf_mean_estimate(&recording, NULL, out_frf, out_error);
    if (!status) {
        estimate_advise(&recording, &io_summary->advice);
        io_summary->leading_periods = recording.total;
        if (!estimating_findings_measure(&recording, inputs, out_frf, &io_summary->findings)) {
            status = estimate_refuse_memory(out_frf, out_error);
        }
    }
    periodic_free(&recording);
    return status;
}

static int take_rest(const struct estimating_pieces *self, const struct periodic *leading, struct online *online,
                     struct error *out_error)
{
    int status = 0;
    struct terminal_line line;
    terminal_line_start(&line, self->context);
    while (!status && !run_stream_ended(self->stream)) {
        run_stream_forget(self->stream);
        status = run_stream_fill(self->stream, piece_rows, out_error);
        const struct run *piece = run_stream_run(self->stream);
        if (!status && piece->rows > 0) {
            status = online_take(online, run_column(piece, leading->input), run_column(piece, leading->output),
                                 run_column(piece, "valid"), piece->rows, out_error);
        }
        if (terminal_line_due(&line)) {
            const double rows = (double)run_stream_rows(self->stream);
            fprintf(stderr, "\r%.1f million rows   ", 1e-6 * rows);
        }
    }
    terminal_line_clear(&line);
    return status ? status : run_stream_finish(self->stream, out_error);
}

static void summarise(const struct periodic *leading, const struct online_result *result,
                      struct estimating_summary *io_summary)
{
    io_summary->period_samples = leading->period_samples;
    io_summary->period_found = leading->period_found;
    io_summary->bins_found = leading->bins_found;
    io_summary->total = result->total;
    io_summary->settle = result->settle;
    io_summary->lost = result->lost;
    io_summary->first_lost_row = result->first_lost_row;
    io_summary->used = result->used;
    io_summary->transient = result->transient;
    io_summary->first_level = result->first_level;
    io_summary->last_level = result->last_level;
}

static void copy_distortion(const struct frf *leading, struct frf *io_frf)
{
    for (size_t line = 0; line < io_frf->count && line < leading->count; line++) {
        if (io_frf->valid[line]) {
            io_frf->odd_distortion[line] = leading->odd_distortion[line];
            io_frf->even_distortion[line] = leading->even_distortion[line];
        }
    }
}

/// A leading part that is left out for settling as a whole, or nearly so, shows nothing; its transient is found anyhow.
static bool shows_settled(const struct periodic *leading, const struct periodic_options *options)
{
    const struct run *run = leading->run;
    size_t settle = options->settle == periodic_settle_given     ? options->settle_periods
                    : options->settle == periodic_settle_default ? run->settle_periods
                                                                 : 0;
    return settle + leading_periods <= leading->total;
}

static int estimate_rest(struct estimating_pieces *self, const struct periodic *leading,
                         const struct periodic_options *options, struct frf *out_frf,
                         struct estimating_summary *io_summary, struct error *out_error)
{
    struct online *online;
    struct online_result result;
    int status = online_begin(leading, options, &online, out_error);
    status = status ? status : take_rest(self, leading, online, out_error);
    if (!status) {
        status = online_end(online, run_stream_run(self->stream)->sample_rate_hz, &result, out_frf, out_error);
    }
    if (!status) {
        summarise(leading, &result, io_summary);
    }
    online_free(online);
    return status;
}

int estimating_pieces_estimate(struct estimating_pieces *self, const struct periodic_options *options,
                               const struct inputs *inputs, struct frf *out_frf, struct estimating_summary *out_summary,
                               struct error *out_error)
{
    struct periodic_options all = *options;
    struct periodic leading;
    struct frf found = {.count = 0};
    *out_summary = (struct estimating_summary){.used = 0};
    all.settle = periodic_settle_given;
    all.settle_periods = 0;
    int status = periodic_cut(&self->run, &all, &leading, out_error);
    if (status) {
        return status;
    }
    if (shows_settled(&leading, options)) {
        status = find_in_leading(&self->run, options, inputs, out_summary, &found, out_error);
    }
    status = status ? status : estimate_rest(self, &leading, options, out_frf, out_summary, out_error);
    if (!status) {
        copy_distortion(&found, out_frf);
    }
    frf_free(&found);
    periodic_free(&leading);
    return status;
}
