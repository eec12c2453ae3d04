/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/comparing.h"

#include "lab/estimate/difference.h"
#include "lab/estimate/report.h"
#include "lab/estimate/report_distortion.h"
#include "lab/page/page.h"
#include "lab/record/atomic_file.h"
#include "lab/record/json_out.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef SERVOSCOPE_VERSION
#define SERVOSCOPE_VERSION "0.1.0"
#endif

enum { says_size = 640 };

static const char *without_folder(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash && slash[1] ? slash + 1 : path;
}

void comparing_short_names(const struct option_values *paths, const char **out_names)
{
    for (size_t i = 0; i < paths->count; i++) {
        const char *name = without_folder(paths->items[i]);
        bool alone = true;
        for (size_t k = 0; k < paths->count; k++) {
            alone = alone && (k == i || strcmp(name, without_folder(paths->items[k])) != 0);
        }
        out_names[i] = alone ? name : paths->items[i];
    }
}

static int refuse_memory(struct error *out_error)
{
    return error_set(out_error, error_refused, "memory is short");
}

int comparing_read(const struct option_values *paths, struct comparing *out, struct error *out_error)
{
    out->responses = calloc(paths->count + 1, sizeof *out->responses);
    out->names = calloc(paths->count + 1, sizeof *out->names);
    if (!out->responses || !out->names) {
        return refuse_memory(out_error);
    }
    comparing_short_names(paths, out->names);
    int status = 0;
    for (size_t i = 0; i < paths->count && !status; i++) {
        status = frf_read(paths->items[i], &out->responses[i], out_error);
        out->count += !status;
    }
    return status;
}

int comparing_check(const struct comparing *self, const struct frf *first, const char *first_name,
                    struct error *out_error)
{
    for (size_t i = 0; i < self->count; i++) {
        if (strcmp(self->responses[i].units, first->units) != 0) {
            return error_set(out_error, error_refused, "%s: a response in %s, expected %s as in %s", self->names[i],
                             self->responses[i].units, first->units, first_name);
        }
    }
    return 0;
}

int comparing_print(const struct comparing *self, const struct frf *first, const char *first_name,
                    struct error *out_error)
{
    for (size_t i = 0; i < self->count; i++) {
        struct difference difference;
        char says[says_size];
        if (!difference_measure(first, &self->responses[i], NULL, &difference)) {
            return refuse_memory(out_error);
        }
        difference_say(&difference, first_name, says, sizeof says);
        printf("%s %s\n", self->names[i], says);
    }
    return 0;
}

static void add_number(cJSON *object, const char *name, double value)
{
    if (isfinite(value)) {
        cJSON_AddNumberToObject(object, name, value);
    } else {
        cJSON_AddNullToObject(object, name);
    }
}

int comparing_add_json(const struct comparing *self, const struct frf *first, cJSON *io_object, struct error *out_error)
{
    if (self->count == 0) {
        return 0;
    }
    cJSON *list = cJSON_AddArrayToObject(io_object, "differences");
    for (size_t i = 0; i < self->count; i++) {
        struct difference difference;
        if (!difference_measure(first, &self->responses[i], NULL, &difference)) {
            return refuse_memory(out_error);
        }
        cJSON *object = cJSON_CreateObject();
        cJSON_AddStringToObject(object, "file", self->names[i]);
        cJSON_AddNumberToObject(object, "lines_in_common", (double)difference.common);
        cJSON_AddNumberToObject(object, "lines_compared", (double)difference.compared);
        cJSON_AddNumberToObject(object, "lines_beyond", (double)difference.beyond);
        add_number(object, "median_db", difference.middle_db);
        add_number(object, "worst_over_two_std", difference.compared > 0 ? difference.worst : NAN);
        add_number(object, "worst_hz", difference.compared > 0 ? difference.worst_hz : NAN);
        add_number(object, "chance", difference.chance);
        cJSON_AddItemToArray(list, object);
    }
    return 0;
}

static int write_page(const struct comparing_request *request, const struct comparing *all, struct error *out_error)
{
    struct atomic_file file;
    struct page page;
    char title[600];
    char subtitle[320];
    const struct frf_report_options options = {
        .name = all->names[0],
        .other_count = all->count - 1,
        .others = all->responses + 1,
        .other_names = all->names + 1,
    };
    FILE *stream = atomic_file_open(&file, request->report, out_error);
    if (!stream) {
        return error_refused;
    }
    if (all->count == 1) {
        snprintf(title, sizeof title, "Frequency response %s", all->names[0]);
    } else if (all->count == 2) {
        snprintf(title, sizeof title, "Frequency responses %s and %s", all->names[0], all->names[1]);
    } else {
        snprintf(title, sizeof title, "Frequency responses %s and %zu more", all->names[0], all->count - 1);
    }
    snprintf(subtitle, sizeof subtitle, "%s to %s, as saved", all->responses[0].input, all->responses[0].output);
    page_start(&page, stream, title, all->responses[0].input[0] ? subtitle : NULL);
    frf_report_section(&page, &all->responses[0], &options);
    frf_report_distortion_section(&page, &all->responses[0], NULL);
    // A write error is kept by the stream, and commit reports it with the path and the reason.
    (void)page_end(&page, "servoscope " SERVOSCOPE_VERSION);
    return atomic_file_commit(&file, out_error);
}

static int tell(const struct comparing *all, const struct command_context *context, struct error *out_error)
{
    const struct comparing others = {all->count - 1, all->responses + 1, all->names + 1};
    if (context->json) {
        cJSON *object = cJSON_CreateObject();
        cJSON_AddStringToObject(object, "file", all->names[0]);
        int status = comparing_add_json(&others, &all->responses[0], object, out_error);
        status = status ? status : json_print_stdout(object, out_error);
        cJSON_Delete(object);
        return status;
    }
    return context->quiet ? 0 : comparing_print(&others, &all->responses[0], all->names[0], out_error);
}

int comparing_run(const struct comparing_request *request, const struct command_context *context,
                  struct error *out_error)
{
    struct option_values paths = *request->first;
    struct comparing all = {0};
    for (size_t i = 0; i < request->others->count && paths.count < option_values_max; i++) {
        paths.items[paths.count++] = request->others->items[i];
    }
    if (paths.count < 2 && !request->report) {
        return error_set(out_error, error_usage,
                         "%s: a response already, expected another one to compare it with (--compare) or --report",
                         paths.items[0]);
    }
    int status = comparing_read(&paths, &all, out_error);
    status = status ? status : comparing_check(&all, &all.responses[0], all.names[0], out_error);
    status = status || !request->report ? status : write_page(request, &all, out_error);
    status = status ? status : tell(&all, context, out_error);
    comparing_free(&all);
    return status;
}

void comparing_free(struct comparing *self)
{
    for (size_t i = 0; self->responses && i < self->count; i++) {
        frf_free(&self->responses[i]);
    }
    free(self->responses);
    free(self->names);
    *self = (struct comparing){0};
}
