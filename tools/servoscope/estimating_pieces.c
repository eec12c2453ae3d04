/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/estimating_pieces.h"

#include "lab/estimate/clocked.h"
#include "lab/estimate/frf_mean.h"
#include "lab/estimate/method.h"
#include "lab/estimate/online.h"
#include "lab/numeric/cmplx.h"
#include "tools/servoscope/interrupt.h"

#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    leading_numbers = 1 << 19,
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
    struct clocked clocked;
    int status = clocked_cut(run, options, true, &clocked, out_error);
    if (status) {
        return status;
    }
    status = frf_mean_estimate(&clocked.recording, NULL, out_frf, out_error);
    if (!status) {
        estimate_advise(&clocked.recording, &io_summary->advice);
        io_summary->leading_periods = clocked.recording.total;
        if (!estimating_findings_measure(&clocked.recording, inputs, out_frf, &io_summary->findings) ||
            !estimating_checks_measure(&clocked, out_frf, &io_summary->checks) ||
            !estimating_summary_excite(io_summary, &clocked.recording)) {
            status = estimate_refuse_memory(out_frf, out_error);
        }
    }
    clocked_free(&clocked);
    return status;
}

static void show_rows(const struct run_stream *stream, struct terminal_line *line)
{
    const double millions = 1e-6 * (double)run_stream_rows(stream);
    terminal_line_show(line, run_stream_share(stream), "%.1f million rows, %.2f million a second", millions,
                       millions / terminal_line_elapsed_s(line));
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
        show_rows(self->stream, &line);
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
    io_summary->doubtful = leading->doubtful_count;
    io_summary->total = result->total;
    io_summary->settle = result->settle;
    io_summary->lost = result->lost;
    io_summary->first_lost_row = result->first_lost_row;
    io_summary->used = result->used;
    io_summary->transient = result->transient;
    io_summary->first_level = result->first_level;
    io_summary->last_level = result->last_level;
}

/// What the leading part tells of the whole: distortion, warnings, how far std is too small.
static bool copy_findings(const struct frf *leading, const struct estimating_checks *checks, struct frf *io_frf)
{
    for (size_t line = 0; line < io_frf->count && line < leading->count; line++) {
        if (io_frf->valid[line]) {
            io_frf->odd_distortion[line] = leading->odd_distortion[line];
            io_frf->even_distortion[line] = leading->even_distortion[line];
        }
    }
    return estimating_checks_apply(checks, io_frf);
}

/// A leading part that is left out for settling as a whole, or nearly so, shows nothing.
static bool shows_settled(const struct run *run, const struct periodic_options *options)
{
    const size_t period = options->period_samples > 0 ? options->period_samples : run->period_samples;
    const size_t settle = options->settle == periodic_settle_given     ? options->settle_periods
                          : options->settle == periodic_settle_default ? run->settle_periods
                                                                       : 0;
    return period == 0 || settle + leading_periods <= run->rows / period;
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

/// One part's cut, with the lines and the period of the first; settling concerns the first alone.
static int estimate_part(const struct run *part, const struct periodic_options *options, struct periodic *io_first,
                         struct frf *out_frf, struct estimating_summary *io_summary, struct error *out_error)
{
    const bool is_first = io_first->bins == NULL;
    struct periodic_options own = *options;
    struct clocked clocked;
    if (!is_first) {
        own.period_samples = io_first->period_samples;
        own.bins = io_first->bins;
        own.bin_count = io_first->bin_count;
        own.settle = periodic_settle_given;
        own.settle_periods = 0;
    }
    int status = clocked_cut(part, &own, true, &clocked, out_error);
    if (status) {
        return status;
    }
    struct periodic *recording = &clocked.recording;
    io_summary->total += recording->total;
    io_summary->lost += recording->lost;
    io_summary->used += recording->used;
    io_summary->last_level = periodic_last_level(recording);
    status = frf_mean_estimate(recording, NULL, out_frf, out_error);
    if (is_first) {
        io_summary->period_samples = recording->period_samples;
        io_summary->period_found = recording->period_found;
        io_summary->bins_found = recording->bins_found;
        io_summary->doubtful = recording->doubtful_count;
        io_summary->settle = recording->settle;
        io_summary->transient = recording->transient;
        io_summary->first_level = periodic_first_level(recording);
        io_summary->first_lost_row = recording->first_lost_row;
        io_first->period_samples = recording->period_samples;
        io_first->bin_count = recording->bin_count;
        io_first->bins = recording->bins;
        recording->bins = NULL;
    }
    clocked_free(&clocked);
    return status;
}

/// Adds a part to the mean of all, weighed by its periods; std holds variances meanwhile. A line has to be valid in
/// all.
static void add_part(const struct frf *part, struct frf *io_frf)
{
    const double before = (double)io_frf->periods;
    const double own = (double)part->periods;
    const double share = own / (before + own);
    for (size_t line = 0; line < io_frf->count; line++) {
        const double kept = (1.0 - share) * (1.0 - share);
        io_frf->frequency_hz[line] += share * (part->frequency_hz[line] - io_frf->frequency_hz[line]);
        io_frf->real[line] += share * (part->real[line] - io_frf->real[line]);
        io_frf->imag[line] += share * (part->imag[line] - io_frf->imag[line]);
        io_frf->std[line] = kept * io_frf->std[line] + share * share * part->std[line] * part->std[line];
        io_frf->valid[line] = io_frf->valid[line] && part->valid[line];
    }
    io_frf->degrees_of_freedom += part->degrees_of_freedom;
    io_frf->periods += part->periods;
}

static int take_parts(struct estimating_pieces *self, const struct periodic_options *options, struct periodic *io_first,
                      struct frf *io_frf, size_t *out_count, struct estimating_summary *io_summary,
                      struct error *out_error)
{
    const size_t rows = self->run.rows;
    struct terminal_line line;
    terminal_line_start(&line, self->context);
    int status = estimate_part(&self->run, options, io_first, io_frf, io_summary, out_error);
    for (size_t i = 0; i < io_frf->count && !status; i++) {
        io_frf->std[i] *= io_frf->std[i];
    }
    while (!status && !run_stream_ended(self->stream)) {
        struct run part;
        struct frf one = {.count = 0};
        status = run_stream_fill(self->stream, rows, out_error);
        status = status ? status : run_stream_split(self->stream, &part, out_error);
        if (status) {
            break;
        }
        part.periods = 0;
        /* The last one may be too short to tell its own clock. */
        if (part.rows / io_first->period_samples >= clock_fewest_periods) {
            status = estimate_part(&part, options, io_first, &one, io_summary, out_error);
        }
        if (!status && one.count == io_frf->count) {
            add_part(&one, io_frf);
            ++*out_count;
        }
        frf_free(&one);
        run_free(&part);
        show_rows(self->stream, &line);
    }
    terminal_line_clear(&line);
    return status ? status : run_stream_finish(self->stream, out_error);
}

static int estimate_parts(struct estimating_pieces *self, const struct periodic_options *options, struct frf *out_frf,
                          struct estimating_summary *io_summary, struct error *out_error)
{
    struct periodic first = {.bins = NULL};
    size_t count = 1;
    int status = take_parts(self, options, &first, out_frf, &count, io_summary, out_error);
    for (size_t line = 0; line < out_frf->count && !status; line++) {
        const bool valid = out_frf->valid[line];
        const double complex response = CMPLX(out_frf->real[line], out_frf->imag[line]);
        estimate_set_line(out_frf, line, response, valid ? sqrt(out_frf->std[line]) : INFINITY);
    }
    if (!status && !(estimate_set_key(out_frf, "parts", "%zu", count) && estimate_set_confidence(out_frf))) {
        status = estimate_refuse_memory(out_frf, out_error);
    }
    if (status) {
        frf_free(out_frf);
    }
    free(first.bins);
    return status;
}

/// All of the leading part's periods, also those that may be left out, for the sums to come.
static int estimate_online(struct estimating_pieces *self, const struct periodic_options *options, struct frf *out_frf,
                           struct estimating_summary *io_summary, struct error *out_error)
{
    struct periodic_options all = *options;
    struct periodic leading;
    all.settle = periodic_settle_given;
    all.settle_periods = 0;
    int status = periodic_cut(&self->run, &all, &leading, out_error);
    if (!status) {
        status = estimate_rest(self, &leading, options, out_frf, io_summary, out_error);
        periodic_free(&leading);
    }
    return status;
}

int estimating_pieces_estimate(struct estimating_pieces *self, const struct periodic_options *options,
                               const struct inputs *inputs, struct frf *out_frf, struct estimating_summary *out_summary,
                               struct error *out_error)
{
    struct frf found = {.count = 0};
    *out_summary = (struct estimating_summary){.used = 0};
    *out_frf = (struct frf){.count = 0};
    int status = 0;
    if (shows_settled(&self->run, options)) {
        status = find_in_leading(&self->run, options, inputs, out_summary, &found, out_error);
    }
    if (!status && out_summary->checks.clock.state == clock_off) {
        status = estimate_parts(self, options, out_frf, out_summary, out_error);
    } else if (!status) {
        status = estimate_online(self, options, out_frf, out_summary, out_error);
    }
    if (!status && !(copy_findings(&found, &out_summary->checks, out_frf) &&
                     (out_summary->leading_periods == 0 ||
                      estimate_set_key(out_frf, "leading_periods", "%zu", out_summary->leading_periods)))) {
        status = estimate_refuse_memory(out_frf, out_error);
    }
    frf_free(&found);
    return status;
}
