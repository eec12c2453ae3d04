/* SPDX-License-Identifier: MIT */
#include "lab/record/json_in.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { document_size_max = 1 << 22 };

static size_t line_of(const char *text, const char *at)
{
    size_t line = 1;
    for (const char *c = text; c < at; c++)
        line += *c == '\n';
    return line;
}

/* The whole file with a zero behind it. */
static int read_text(const char *path, char **out_text, size_t *out_length, struct error *out_error)
{
    errno = 0;
    FILE *stream = fopen(path, "rb");
    if (!stream)
        return error_set(out_error, error_refused, "%s: cannot be read: %s", path, strerror(errno));
    char *text = NULL;
    size_t length = 0, capacity = 0;
    int status = error_none;
    while (!status) {
        if (length + 1 >= capacity) {
            capacity = capacity ? 2 * capacity : 4096;
            char *grown = capacity <= document_size_max ? realloc(text, capacity) : NULL;
            if (!grown) {
                status = error_set(out_error, error_refused, "%s: is larger than %d MiB, the most for JSON", path,
                                   document_size_max >> 20);
                break;
            }
            text = grown;
        }
        size_t got = fread(text + length, 1, capacity - 1 - length, stream);
        length += got;
        if (got == 0)
            break;
    }
    if (!status && ferror(stream))
        status = error_set(out_error, error_refused, "%s: cannot be read: %s", path, strerror(errno));
    fclose(stream);
    if (status) {
        free(text);
        return status;
    }
    text[length] = '\0';
    *out_text = text;
    *out_length = length;
    return error_none;
}

/* A key twice in one object, whose path goes to `member`; cJSON would take the first, others the last. */
static bool find_duplicate(const cJSON *object, char member[json_path_size], size_t used)
{
    const cJSON *item, *other;
    cJSON_ArrayForEach(item, object)
    {
        size_t length = used;
        if (item->string) {
            int added = snprintf(member + used, json_path_size - used, "%s%s", used ? "." : "", item->string);
            length = used + (size_t)added < json_path_size ? used + (size_t)added : json_path_size - 1;
        }
        for (other = item->next; other && item->string; other = other->next)
            if (other->string && strcmp(other->string, item->string) == 0)
                return true;
        if ((cJSON_IsObject(item) || cJSON_IsArray(item)) && find_duplicate(item, member, length))
            return true;
        member[used] = '\0';
    }
    return false;
}

static int check_document(const struct json_document *self, const char *end, struct error *out_error)
{
    if (!self->root) {
        const char *at = end && end >= self->text ? end : self->text;
        // cJSON stops one past a character that it did not expect.
        while (at > self->text && strchr(" \t\r\n", *at) && *at)
            at--;
        const char *shown = *at ? at : "end of file";
        int length = (int)strcspn(shown, "\r\n");
        return error_set(out_error, error_refused, "%s:%zu: at '%.*s': is not valid JSON", self->path,
                         line_of(self->text, at), length < 20 ? length : 20, shown);
    }
    if (!cJSON_IsObject(self->root))
        return error_set(out_error, error_refused, "%s:1: an object { } was expected", self->path);
    char member[json_path_size] = "";
    if (find_duplicate(self->root, member, 0))
        return error_set(out_error, error_refused, "%s:%zu: %s: is there twice", self->path,
                         json_document_line(self, member), member);
    return error_none;
}

int json_document_read(const char *path, struct json_document *out_document, struct error *out_error)
{
    *out_document = (struct json_document){0};
    size_t length = 0;
    int status = read_text(path, &out_document->text, &length, out_error);
    if (status)
        return status;
    out_document->path = strdup(path);
    const char *zero = memchr(out_document->text, '\0', length);
    const char *end = NULL;
    if (!out_document->path) {
        status = error_set(out_error, error_refused, "%s: memory is short", path);
    } else if (zero) {
        status = error_set(out_error, error_refused, "%s:%zu: contains binary zeros: JSON text was expected", path,
                           line_of(out_document->text, zero));
    } else {
        // The length includes the zero: cJSON 1.7.15 reads one byte past a text given without it.
        out_document->root = cJSON_ParseWithLengthOpts(out_document->text, length + 1, &end, true);
        status = check_document(out_document, end, out_error);
    }
    if (status)
        json_document_free(out_document);
    return status;
}

void json_document_free(struct json_document *self)
{
    cJSON_Delete(self->root);
    free(self->text);
    free(self->path);
    *self = (struct json_document){0};
}

void json_path_join(char out_path[json_path_size], const char *parent, const char *name)
{
    bool below = parent && *parent;
    int length = snprintf(out_path, json_path_size, "%s%s%s", below ? parent : "", below ? "." : "", name);
    if (length >= json_path_size)
        memcpy(out_path + json_path_size - 4, "...", 4); // only ever shown
}

/* Position just behind a string that starts at its opening quote. */
static const char *skip_string(const char *at)
{
    for (at++; *at && *at != '"'; at++)
        if (*at == '\\' && at[1])
            at++;
    return *at ? at + 1 : at;
}

/* The opening quote of member `name` in the object that starts at `at` ('{'), NULL if there is none. The text has been
 * parsed, so brackets match. */
static const char *find_member(const char *at, const char *name, size_t name_length)
{
    int depth = 0;
    while (*at) {
        if (*at == '"') {
            const char *end = skip_string(at);
            size_t length = (size_t)(end - at) - 2;
            bool is_key = end[strspn(end, " \t\r\n")] == ':';
            if (depth == 1 && is_key && length == name_length && strncmp(at + 1, name, length) == 0)
                return at;
            at = end;
            continue;
        }
        depth += *at == '{' || *at == '[';
        depth -= *at == '}' || *at == ']';
        if (depth == 0 && (*at == '}' || *at == ']'))
            return NULL;
        at++;
    }
    return NULL;
}

/* The first character of element `index` of the array that starts at `at` ('['), NULL if it has fewer. */
static const char *find_element(const char *at, size_t index)
{
    int depth = 0;
    for (; *at; at++) {
        bool begins = depth == 1 && index == 0 && !strchr(" \t\r\n,]", *at);
        if (begins)
            return at;
        if (*at == '"')
            at = skip_string(at) - 1;
        depth += *at == '{' || *at == '[';
        depth -= *at == '}' || *at == ']';
        index -= depth == 1 && *at == ',' && index > 0;
        if (depth == 0)
            return NULL;
    }
    return NULL;
}

/* Follows "[2][0]" from the array at `at`; *io_member ends behind the last bracket. */
static const char *follow_indices(const char *at, const char **io_member)
{
    while (at && **io_member == '[') {
        char *end = NULL;
        size_t index = strtoul(*io_member + 1, &end, 10);
        at = *at == '[' ? find_element(at, index) : NULL;
        *io_member = end + (*end == ']');
    }
    return at;
}

size_t json_document_line(const struct json_document *self, const char *member)
{
    const char *at = self->text + strcspn(self->text, "{");
    for (;;) {
        size_t length = strcspn(member, ".[");
        at = find_member(at, member, length);
        if (!at)
            return 0;
        member += length;
        if (*member == '\0')
            return line_of(self->text, at);
        at = skip_string(at);
        at = follow_indices(at + strspn(at, " \t\r\n:"), &member);
        if (at && *member == '\0')
            return line_of(self->text, at);
        if (!at || *at != '{')
            return 0;
        member++;
    }
}

int json_document_error(const struct json_document *self, const char *member, const cJSON *value,
                        const char *expectation, struct error *out_error)
{
    size_t line = json_document_line(self, member);
    char place[24] = "";
    if (line > 0)
        snprintf(place, sizeof place, "%zu:", line);
    if (!value)
        return error_set(out_error, error_refused, "%s:%s %s: is missing: %s", self->path, place, member, expectation);
    bool infinite = cJSON_IsNumber(value) && !isfinite(value->valuedouble); // cJSON would print it as null
    char *text = infinite ? NULL : cJSON_PrintUnformatted(value);
    int status = error_set(out_error, error_refused, "%s:%s %s: %.40s: %s", self->path, place, member,
                           text ? text : "too large", expectation);
    cJSON_free(text);
    return status;
}

int json_document_number(const struct json_document *self, const cJSON *object, const char *parent, const char *name,
                         double *io_value, bool *out_found, struct error *out_error)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    if (out_found)
        *out_found = item != NULL;
    if (!item)
        return error_none;
    if (cJSON_IsNumber(item) && isfinite(item->valuedouble)) {
        *io_value = item->valuedouble;
        return error_none;
    }
    char member[json_path_size];
    json_path_join(member, parent, name);
    return json_document_error(self, member, item, "a finite number was expected", out_error);
}
