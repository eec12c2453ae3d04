/* SPDX-License-Identifier: MIT */
#include "lab/record/sequence_file.h"

#include "core/config.h"
#include "lab/record/json_out.h"
#include "lab/record/manifest.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char *const kinds[] = {"octaves", "dwell", "multisine", NULL};
enum { period_samples_min = 4 };
static const double rate_min_hz = 1e-6;
/// A manifest carries the rate as a decimal number, a table as a fraction.
static const double same_rate = 1e-12;
static const uint64_t periods_max = 1000000000;

static int refuse_memory(const char *path, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s: memory is short", path);
}

int sequence_file_alloc(struct sequence_file *out_self, size_t segment_count, size_t inputs, struct error *out_error)
{
    *out_self = (struct sequence_file){.inputs = inputs};
    out_self->segments = calloc(segment_count, sizeof *out_self->segments);
    for (size_t i = 0; out_self->segments && i < segment_count; i++) {
        out_self->segments[i].tables = calloc(inputs, sizeof *out_self->segments[i].tables);
        if (!out_self->segments[i].tables) {
            break;
        }
        out_self->segment_count++;
    }
    if (out_self->segment_count == segment_count) {
        return error_none;
    }
    sequence_file_free(out_self);
    return refuse_memory("sequence", out_error);
}

static int read_bins(const struct json_document *document, const cJSON *object, const char *parent,
                     size_t period_samples, struct sequence_table *table, struct error *out_error)
{
    static const char name[] = "excited_bins";
    const size_t highest = (period_samples - 1) / 2;
    const cJSON *array = NULL;
    int status = manifest_read_array(document, object, parent, name, highest, &array, out_error);
    if (status) {
        return status;
    }
    table->bins = calloc((size_t)cJSON_GetArraySize(array), sizeof *table->bins);
    if (!table->bins) {
        return refuse_memory(document->path, out_error);
    }
    const cJSON *item;
    cJSON_ArrayForEach(item, array)
    {
        const double lowest = table->bin_count ? table->bins[table->bin_count - 1] + 1.0 : 1.0;
        const double value = cJSON_IsNumber(item) ? item->valuedouble : NAN;
        if (!(value >= lowest && value <= (double)highest) || value > floor(value)) {
            char member[json_path_size];
            manifest_element(member, parent, name, table->bin_count);
            return json_document_error(document, member, item,
                                       "bins ascend from 1 and stay below half of period_samples", out_error);
        }
        table->bins[table->bin_count++] = (uint32_t)value;
    }
    return error_none;
}

static int read_table(const struct json_document *document, const cJSON *object, const char *place,
                      size_t period_samples, struct sequence_table *table, struct error *out_error)
{
    int status = manifest_read_file(document, object, place, "file", &table->file, out_error);
    status =
        status ? status : manifest_read_crc32(document, object, place, "table_crc32", &table->table_crc32, out_error);
    return status ? status : read_bins(document, object, place, period_samples, table, out_error);
}

static int read_segment(const struct json_document *document, const cJSON *object, size_t index,
                        struct sequence_file *self, struct error *out_error)
{
    struct sequence_segment *segment = &self->segments[index];
    char place[json_path_size];
    const cJSON *tables = NULL;
    manifest_element(place, "", "segments", index);
    int status = manifest_read_whole(document, object, place, "periods", 1, periods_max, &segment->periods, out_error);
    status = status ? status
                    : manifest_read_array(document, object, place, "tables", sequence_inputs_max, &tables, out_error);
    if (!status && (size_t)cJSON_GetArraySize(tables) != self->inputs) {
        char member[json_path_size];
        json_path_join(member, place, "tables");
        return error_set(out_error, error_refused, "%s:%zu: %s: %d tables: expected one for each of %zu inputs",
                         document->path, json_document_line(document, member), member, cJSON_GetArraySize(tables),
                         self->inputs);
    }
    for (size_t p = 0; !status && p < self->inputs; p++) {
        char table[json_path_size];
        manifest_element(table, place, "tables", p);
        status = read_table(document, cJSON_GetArrayItem(tables, (int)p), table, self->period_samples,
                            &segment->tables[p], out_error);
    }
    return status;
}

static int read_head(const struct json_document *document, struct sequence_file *out_head, struct error *out_error)
{
    const cJSON *root = document->root;
    uint64_t period_samples = 0;
    uint64_t inputs = 0;
    int status = manifest_check_holds(document, "tables", out_error);
    status = status ? status : manifest_read_word(document, root, "", "kind", kinds, &out_head->kind, out_error);
    status = status ? status
                    : manifest_read_number(document, root, "", "sample_rate_hz", rate_min_hz, &out_head->sample_rate_hz,
                                           out_error);
    status = status ? status
                    : manifest_read_whole(document, root, "", "period_samples", period_samples_min,
                                          SERVOSCOPE_TABLE_SAMPLES_MAX, &period_samples, out_error);
    status =
        status ? status : manifest_read_whole(document, root, "", "inputs", 1, sequence_inputs_max, &inputs, out_error);
    status = status ? status
                    : manifest_read_whole(document, root, "", "periods", 1, periods_max, &out_head->periods, out_error);
    status = status ? status : manifest_read_number(document, root, "", "settle_s", 0, &out_head->settle_s, out_error);
    status =
        status ? status : manifest_read_number(document, root, "", "test_time_s", 0, &out_head->test_time_s, out_error);
    out_head->period_samples = (size_t)period_samples;
    out_head->inputs = (size_t)inputs;
    return status;
}

static int read_document(const struct json_document *document, struct sequence_file *out_self, struct error *out_error)
{
    struct sequence_file head = {0};
    const cJSON *segments = NULL;
    int status = read_head(document, &head, out_error);
    status = status ? status
                    : manifest_read_array(document, document->root, "", "segments", sequence_segments_max, &segments,
                                          out_error);
    status =
        status ? status : sequence_file_alloc(out_self, (size_t)cJSON_GetArraySize(segments), head.inputs, out_error);
    if (status) {
        return status;
    }
    head.segment_count = out_self->segment_count;
    head.segments = out_self->segments;
    head.path = strdup(document->path);
    *out_self = head;
    if (!head.path) {
        return refuse_memory(document->path, out_error);
    }
    size_t index = 0;
    const cJSON *item;
    cJSON_ArrayForEach(item, segments)
    {
        status = read_segment(document, item, index++, out_self, out_error);
        if (status) {
            return status;
        }
    }
    return error_none;
}

int sequence_file_read(const char *path, struct sequence_file *out_self, struct error *out_error)
{
    struct json_document document;
    *out_self = (struct sequence_file){0};
    int status = json_document_read(path, &document, out_error);
    if (status) {
        return status;
    }
    status = read_document(&document, out_self, out_error);
    json_document_free(&document);
    if (status) {
        sequence_file_free(out_self);
    }
    return status;
}

static cJSON *json_of_table(const struct sequence_table *table)
{
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "file", table->file);
    manifest_add_crc32(object, "table_crc32", table->table_crc32);
    cJSON *bins = cJSON_AddArrayToObject(object, "excited_bins");
    for (size_t k = 0; k < table->bin_count; k++) {
        cJSON_AddItemToArray(bins, cJSON_CreateNumber(table->bins[k]));
    }
    return object;
}

int sequence_file_write(const char *path, const struct sequence_file *self, struct error *out_error)
{
    cJSON *root = cJSON_CreateObject();
    cJSON_AddStringToObject(root, "holds", "tables");
    cJSON_AddStringToObject(root, "kind", self->kind);
    cJSON_AddNumberToObject(root, "sample_rate_hz", self->sample_rate_hz);
    cJSON_AddNumberToObject(root, "period_samples", (double)self->period_samples);
    cJSON_AddNumberToObject(root, "inputs", (double)self->inputs);
    cJSON_AddNumberToObject(root, "periods", (double)self->periods);
    cJSON_AddNumberToObject(root, "settle_s", self->settle_s);
    cJSON_AddNumberToObject(root, "test_time_s", self->test_time_s);
    cJSON *segments = cJSON_AddArrayToObject(root, "segments");
    for (size_t i = 0; i < self->segment_count; i++) {
        cJSON *segment = cJSON_CreateObject();
        cJSON_AddNumberToObject(segment, "periods", (double)self->segments[i].periods);
        cJSON *tables = cJSON_AddArrayToObject(segment, "tables");
        for (size_t p = 0; p < self->inputs; p++) {
            cJSON_AddItemToArray(tables, json_of_table(&self->segments[i].tables[p]));
        }
        cJSON_AddItemToArray(segments, segment);
    }
    int status = root ? json_write(path, root, out_error) : refuse_memory(path, out_error);
    cJSON_Delete(root);
    return status;
}

int sequence_file_check_table(const struct sequence_file *self, size_t segment, size_t input, const char *path,
                              uint32_t crc32, double rate_hz, size_t period_samples, struct error *out_error)
{
    const struct sequence_table *table = &self->segments[segment].tables[input];
    if (crc32 != table->table_crc32) {
        return error_set(out_error, error_refused,
                         "%s: table_crc32 is 0x%08lx, but %s names 0x%08lx: they are not of one design", path,
                         (unsigned long)crc32, self->path, (unsigned long)table->table_crc32);
    }
    if (!(fabs(rate_hz - self->sample_rate_hz) <= same_rate * self->sample_rate_hz) ||
        period_samples != self->period_samples) {
        return error_set(out_error, error_refused,
                         "%s: %zu samples at %.9g Hz, but %s names %zu samples at %.9g Hz: they are not of one design",
                         path, period_samples, rate_hz, self->path, self->period_samples, self->sample_rate_hz);
    }
    return error_none;
}

void sequence_file_free(struct sequence_file *self)
{
    for (size_t i = 0; i < self->segment_count; i++) {
        struct sequence_table *tables = self->segments[i].tables;
        for (size_t p = 0; tables && p < self->inputs; p++) {
            free(tables[p].file);
            free(tables[p].bins);
        }
        free(tables);
    }
    free(self->segments);
    free(self->path);
    *self = (struct sequence_file){0};
}
