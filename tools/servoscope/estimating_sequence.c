/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/estimating_sequence.h"

#include "lab/estimate/assemble.h"
#include "lab/estimate/method.h"
#include "lab/record/manifest.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// No standard deviation comes from fewer.
enum { periods_min = 2 };

int estimating_check_table(const struct run *run, const struct run_sequence_segment *segment, struct error *out_error)
{
    if (!run->has_table_crc32 || run->table_crc32 == segment->table_crc32) {
        return 0;
    }
    return error_set(out_error, error_refused,
                     "%s: table_crc32 is 0x%08lx: expected 0x%08lx of %s, as its manifest says", run->path,
                     (unsigned long)run->table_crc32, (unsigned long)segment->table_crc32, segment->table);
}

static bool is_missing(const struct run_sequence_segment *segment)
{
    return !segment->run || (segment->periods < segment->periods_planned && segment->periods < periods_min);
}

/// "4, 5, 6" and dots when there are too many of them.
static void note_missing(struct estimating_segments *self, size_t number)
{
    const size_t used = strlen(self->missing);
    const size_t room = sizeof self->missing - used;
    if (room > 16) {
        snprintf(self->missing + used, room, "%s%zu", used ? ", " : "", number);
    } else if (strcmp(self->missing + used - 3, "...") != 0) {
        snprintf(self->missing + used, room, ", ...");
    }
}

static int estimate_segment(const struct run_sequence *runs, size_t index, estimating_one estimate, void *context,
                            struct frf *out_frf, struct error *out_error)
{
    const struct run_sequence_segment *segment = &runs->segments[index];
    struct error reason = {0, ""};
    char *path = manifest_beside(runs->path, segment->run);
    int status = path ? estimate(context, path, segment, out_frf, &reason)
                      : error_set(&reason, error_refused, "%s: memory is short", runs->path);
    free(path);
    return status ? error_set(out_error, status, "segment %zu: %s", index + 1, reason.message) : 0;
}

static int estimate_segments(const struct run_sequence *runs, estimating_one estimate, void *context, struct frf *out,
                             struct estimating_segments *io_segments, struct error *out_error)
{
    int status = 0;
    for (size_t i = 0; i < runs->segment_count && !status; i++) {
        if (is_missing(&runs->segments[i])) {
            note_missing(io_segments, i + 1);
            continue;
        }
        status = estimate_segment(runs, i, estimate, context, &out[io_segments->used], out_error);
        io_segments->used += status == 0;
    }
    if (!status && io_segments->used == 0) {
        status = error_set(out_error, error_refused,
                           "%s: no segment has two periods or more (%s): expected a measurement that got further",
                           runs->path, runs->stopped_by ? runs->stopped_by : "nothing was measured");
    }
    return status;
}

static int assemble(const struct run_sequence *runs, const struct frf *responses,
                    const struct estimating_segments *segments, struct frf *out_frf, struct error *out_error)
{
    struct error reason = {0, ""};
    int status = estimate_assemble(responses, segments->used, out_frf, &reason);
    if (!status) {
        bool set = estimate_set_key(out_frf, "sequence", "%s", segments->kind);
        if (set && segments->missing[0] != '\0') {
            set = estimate_set_key(out_frf, "segments_missing", "%s", segments->missing);
        }
        if (set) {
            return 0;
        }
        frf_free(out_frf);
        status = error_set(&reason, error_refused, "memory is short");
    }
    return error_set(out_error, status, "%s: %s", runs->path, reason.message);
}

int estimating_sequence(const char *path, estimating_one estimate, void *context, struct frf *out_frf,
                        struct estimating_segments *out_segments, struct error *out_error)
{
    struct run_sequence runs;
    *out_frf = (struct frf){0};
    *out_segments = (struct estimating_segments){0};
    int status = run_sequence_read(path, &runs, out_error);
    if (status) {
        return status;
    }
    snprintf(out_segments->kind, sizeof out_segments->kind, "%s", runs.kind);
    out_segments->planned = runs.segment_count;
    struct frf *responses = calloc(runs.segment_count, sizeof *responses);
    status = responses ? estimate_segments(&runs, estimate, context, responses, out_segments, out_error)
                       : error_set(out_error, error_refused, "%s: memory is short", path);
    status = status ? status : assemble(&runs, responses, out_segments, out_frf, out_error);
    for (size_t i = 0; responses && i < out_segments->used; i++) {
        frf_free(&responses[i]);
    }
    free(responses);
    run_sequence_free(&runs);
    return status;
}
