/* SPDX-License-Identifier: MIT */
#include "lab/measure/table_bytes.h"

#include "lab/record/table_file.h"

#include <stdio.h>
#include <stdlib.h>

static uint8_t *read_all(const char *path, size_t size)
{
    FILE *stream = fopen(path, "rb");
    uint8_t *bytes = malloc(size);
    if (stream && bytes && fread(bytes, 1, size, stream) != size) {
        free(bytes);
        bytes = NULL;
    }
    if (!stream) {
        free(bytes);
        return NULL;
    }
    fclose(stream);
    return bytes;
}

int table_bytes_read(const char *path, struct table_bytes *out_table, struct error *out_error)
{
    *out_table = (struct table_bytes){0};
    struct table table;
    int status = table_file_read(path, &table, out_error);
    if (status) {
        return status;
    }
    size_t size = table_file_bytes(&table);
    table_free(&table);
    out_table->bytes = read_all(path, size);
    enum core_status opened = core_err_table_truncated;
    if (out_table->bytes) {
        opened = msgen_table_open(out_table->bytes, size, &out_table->view);
    }
    if (opened == core_ok) {
        return 0;
    }
    table_bytes_free(out_table);
    return error_set(out_error, error_refused, "%s: changed while it was read: %s", path, core_status_str(opened));
}

void table_bytes_free(struct table_bytes *self)
{
    free(self->bytes);
    *self = (struct table_bytes){0};
}
