/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/designing.h"

#include "lab/design/report.h"
#include "lab/page/page.h"
#include "lab/record/atomic_file.h"
#include "lab/record/manifest.h"
#include "lab/record/table_file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef SERVOSCOPE_VERSION
#define SERVOSCOPE_VERSION "0.1.0"
#endif

int designing_table(const struct design_request *request, const struct design_result *result, struct table *out_table,
                    struct error *out_error)
{
    const uint32_t samples = (uint32_t)result->period_samples;
    int status = table_alloc(out_table, samples, msgen_channels_max, (uint32_t)result->bin_count, out_error);
    if (status) {
        return status;
    }
    out_table->rate_num_hz = request->rate_num_hz;
    out_table->rate_den = request->rate_den;
    out_table->start_index = (uint32_t)result->start_index;
    out_table->linear = request->linear;
    out_table->travel_per_period = result->travel_per_period_rad;
    memcpy(out_table->bins, result->bins, result->bin_count * sizeof *result->bins);
    memcpy(out_table->torque, result->torque_Nm, samples * sizeof(double));
    memcpy(out_table->velocity, result->velocity_rad_per_s, samples * sizeof(double));
    memcpy(out_table->position, result->position_rad, samples * sizeof(double));
    memcpy(out_table->acceleration, result->acceleration_rad_per_s2, samples * sizeof(double));
    return 0;
}

int designing_write(const char *prefix, const struct design_request *request, const struct design_result *result,
                    struct error *out_error)
{
    static const struct {
        const char *ending;
        int (*write)(const char *path, struct table *table, struct error *out_error);
    } files[] = {{".csv", table_file_write_csv}, {".h", table_file_write_header}, {".mst", table_file_write_mst}};
    struct table table = {0};
    const size_t path_size = strlen(prefix) + 5;
    char *path = malloc(path_size);
    int status = path ? designing_table(request, result, &table, out_error)
                      : error_set(out_error, error_refused, "memory is short for the file names");
    for (size_t i = 0; !status && i < sizeof files / sizeof files[0]; i++) {
        snprintf(path, path_size, "%s%s", prefix, files[i].ending);
        status = files[i].write(path, &table, out_error);
    }
    table_free(&table);
    free(path);
    return status;
}

int designing_report(const char *path, const char *prefix, const struct design_request *request,
                     const struct design_result *result, struct error *out_error)
{
    const char *name = manifest_name_of(prefix);
    const double rate_hz = (double)request->rate_num_hz / request->rate_den;
    char title[192], subtitle[320];
    struct atomic_file file;
    struct page page;
    FILE *stream = atomic_file_open(&file, path, out_error);
    if (!stream) {
        return error_refused;
    }
    snprintf(title, sizeof title, "Excitation %s", name);
    snprintf(subtitle, sizeof subtitle, "%s.mst: %zu lines, %.6g to %.6g Hz, %zu samples at %.6g Hz a period", name,
             result->bin_count, rate_hz * result->bins[0] / (double)result->period_samples,
             rate_hz * result->bins[result->bin_count - 1] / (double)result->period_samples, result->period_samples,
             rate_hz);
    page_start(&page, stream, title, subtitle);
    design_report_sections(&page, request, result);
    // A write error is kept by the stream, and commit reports it with the path and the reason.
    (void)page_end(&page, "servoscope " SERVOSCOPE_VERSION);
    return atomic_file_commit(&file, out_error);
}
