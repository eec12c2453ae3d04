/* SPDX-License-Identifier: MIT */
#include "lab/record/run_sequence.h"

#include "lab/record/json_out.h"
#include "lab/record/manifest.h"

#include <stdlib.h>
#include <string.h>

static const char *const kinds[] = {"octaves", "dwell", "multisine", NULL};
static const uint64_t periods_max = UINT64_C(1) << 53;

static int refuse_memory(const char *path, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s: memory is short", path);
}

int run_sequence_alloc(struct run_sequence *out_self, size_t segment_count, struct error *out_error)
{
    *out_self = (struct run_sequence){0};
    out_self->segments = calloc(segment_count, sizeof *out_self->segments);
    if (!out_self->segments) {
        return refuse_memory("sequence of runs", out_error);
    }
    out_self->segment_count = segment_count;
    return error_none;
}

static int read_segment(const struct json_document *document, const cJSON *object, const char *place,
                        struct run_sequence_segment *segment, struct error *out_error)
{
    const cJSON *run = cJSON_GetObjectItemCaseSensitive(object, "run");
    int status = manifest_read_file(document, object, place, "table", &segment->table, out_error);
    status =
        status ? status : manifest_read_crc32(document, object, place, "table_crc32", &segment->table_crc32, out_error);
    status = status ? status
                    : manifest_read_whole(document, object, place, "periods_planned", 1, periods_max,
                                          &segment->periods_planned, out_error);
    if (!status && run && !cJSON_IsNull(run)) {
        status = manifest_read_file(document, object, place, "run", &segment->run, out_error);
        status = status ? status
                        : manifest_read_whole(document, object, place, "periods", 0, segment->periods_planned,
                                              &segment->periods, out_error);
    }
    return status;
}

static int read_stopped_by(const struct json_document *document, struct run_sequence *self, struct error *out_error)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(document->root, "stopped_by");
    if (!item) {
        return error_none;
    }
    if (!cJSON_IsString(item)) {
        return json_document_error(document, "stopped_by", item, "a text was expected", out_error);
    }
    self->stopped_by = strdup(item->valuestring);
    return self->stopped_by ? error_none : refuse_memory(document->path, out_error);
}

static int read_document(const struct json_document *document, struct run_sequence *out_self, struct error *out_error)
{
    const char *kind = NULL;
    const cJSON *segments = NULL;
    int status = manifest_check_holds(document, "runs", out_error);
    status = status ? status : manifest_read_word(document, document->root, "", "kind", kinds, &kind, out_error);
    status = status ? status
                    : manifest_read_array(document, document->root, "", "segments", run_sequence_segments_max,
                                          &segments, out_error);
    status = status ? status : run_sequence_alloc(out_self, (size_t)cJSON_GetArraySize(segments), out_error);
    if (status) {
        return status;
    }
    out_self->kind = kind;
    out_self->path = strdup(document->path);
    status = out_self->path ? read_stopped_by(document, out_self, out_error) : refuse_memory(document->path, out_error);
    for (size_t i = 0; !status && i < out_self->segment_count; i++) {
        char place[json_path_size];
        manifest_element(place, "", "segments", i);
        status = read_segment(document, cJSON_GetArrayItem(segments, (int)i), place, &out_self->segments[i], out_error);
    }
    return status;
}

int run_sequence_read(const char *path, struct run_sequence *out_self, struct error *out_error)
{
    struct json_document document;
    *out_self = (struct run_sequence){0};
    int status = json_document_read(path, &document, out_error);
    if (status) {
        return status;
    }
    status = read_document(&document, out_self, out_error);
    json_document_free(&document);
    if (status) {
        run_sequence_free(out_self);
    }
    return status;
}

static cJSON *json_of_segment(const struct run_sequence_segment *segment)
{
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "table", segment->table);
    manifest_add_crc32(object, "table_crc32", segment->table_crc32);
    if (segment->run) {
        cJSON_AddStringToObject(object, "run", segment->run);
    } else {
        cJSON_AddNullToObject(object, "run");
    }
    cJSON_AddNumberToObject(object, "periods", (double)segment->periods);
    cJSON_AddNumberToObject(object, "periods_planned", (double)segment->periods_planned);
    return object;
}

bool run_sequence_complete(const struct run_sequence *self)
{
    for (size_t i = 0; i < self->segment_count; i++) {
        if (self->segments[i].periods < self->segments[i].periods_planned) {
            return false;
        }
    }
    return true;
}

int run_sequence_write(const char *path, const struct run_sequence *self, struct error *out_error)
{
    cJSON *root = cJSON_CreateObject();
    cJSON_AddStringToObject(root, "holds", "runs");
    cJSON_AddStringToObject(root, "kind", self->kind);
    cJSON_AddBoolToObject(root, "complete", run_sequence_complete(self));
    if (self->stopped_by) {
        cJSON_AddStringToObject(root, "stopped_by", self->stopped_by);
    }
    cJSON *segments = cJSON_AddArrayToObject(root, "segments");
    for (size_t i = 0; i < self->segment_count; i++) {
        cJSON_AddItemToArray(segments, json_of_segment(&self->segments[i]));
    }
    int status = root ? json_write(path, root, out_error) : refuse_memory(path, out_error);
    cJSON_Delete(root);
    return status;
}

void run_sequence_free(struct run_sequence *self)
{
    for (size_t i = 0; i < self->segment_count; i++) {
        free(self->segments[i].table);
        free(self->segments[i].run);
    }
    free(self->segments);
    free(self->stopped_by);
    free(self->path);
    *self = (struct run_sequence){0};
}
