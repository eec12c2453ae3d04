/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/measured_page.h"

#include "lab/page/page.h"
#include "lab/record/atomic_file.h"
#include "lab/record/manifest.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#ifndef SERVOSCOPE_VERSION
#define SERVOSCOPE_VERSION "0.1.0"
#endif

static int start(const char *path, const char *out, const char *subtitle, struct atomic_file *out_file,
                 struct page *out_page, struct error *out_error)
{
    char title[300];
    FILE *stream = atomic_file_open(out_file, path, out_error);
    if (!stream) {
        return error_refused;
    }
    snprintf(title, sizeof title, "Measurement %s", manifest_name_of(out));
    page_start(out_page, stream, title, subtitle);
    return 0;
}

static int finish(const char *path, struct page *page, struct atomic_file *file, struct error *out_error)
{
    if (page_end(page, "servoscope " SERVOSCOPE_VERSION) == 0) {
        return atomic_file_commit(file, out_error);
    }
    const int reason = errno;
    atomic_file_discard(file);
    return error_set(out_error, error_refused, "%s: writing failed: %s", path, strerror(reason));
}

int measured_page_write(const char *path, const struct measured *measured, const struct measure_plan *plan,
                        struct error *out_error)
{
    struct atomic_file file;
    struct page page;
    struct measure_summary summary;
    char subtitle[320];
    const struct run *run = measured->run;
    const char *mode = run_key(run, "mode");
    if (!measure_summary_make(run, plan->table, &plan->limits, measured->report->rows_planned, &summary)) {
        return error_set(out_error, error_refused, "%s: memory is short", path);
    }
    snprintf(subtitle, sizeof subtitle, "%s, mode %s, %zu of %zu rows at %.6g Hz", measured->source, mode ? mode : "",
             run->rows, measured->report->rows_planned, run->sample_rate_hz);
    int status = start(path, measured->path, subtitle, &file, &page, out_error);
    if (!status) {
        measure_page_sections(&page, &summary, measured->report);
        status = finish(path, &page, &file, out_error);
    }
    measure_summary_free(&summary);
    return status;
}

int measured_page_write_sequence(const char *path, const char *out, const char *source,
                                 const struct measure_page_sequence *sequence, struct error *out_error)
{
    struct atomic_file file;
    struct page page;
    char subtitle[320];
    snprintf(subtitle, sizeof subtitle, "%s, %zu of %zu segments of %s", source, sequence->count, sequence->planned,
             sequence->kind);
    int status = start(path, out, subtitle, &file, &page, out_error);
    if (!status) {
        measure_page_sequence_sections(&page, sequence);
        status = finish(path, &page, &file, out_error);
    }
    return status;
}
