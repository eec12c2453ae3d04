/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/remarks.h"

#include <ctype.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const level_names[] = {
    [remark_fact] = "fact", [remark_advice] = "advice", [remark_warning] = "warning"};
static const char lost[] = "memory was short: not everything that was found is said here";

void remarks_about(struct remarks *self, const char *path)
{
    self->about = path;
}

/// Makes room for one more; NULL if memory is short.
static struct remark *grow(struct remarks *self)
{
    struct remark *grown = realloc(self->items, (self->count + 1) * sizeof *grown);
    if (!grown) {
        return NULL;
    }
    self->items = grown;
    return &grown[self->count];
}

void remarks_add(struct remarks *self, enum remark_level level, const char *id, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    char *text = NULL;
    size_t size = 0;
    FILE *stream = open_memstream(&text, &size);
    bool written = stream && vfprintf(stream, format, arguments) >= 0;
    written = stream && fclose(stream) == 0 && written;
    va_end(arguments);
    struct remark *added = written ? grow(self) : NULL;
    char *about = added ? strdup(self->about ? self->about : "") : NULL;
    if (!about) {
        self->short_of_memory = true;
        free(text);
        return;
    }
    *added = (struct remark){level, id, about, text};
    self->count++;
}

static bool begins_file(const struct remarks *self, size_t i)
{
    return i == 0 || strcmp(self->items[i].about, self->items[i - 1].about) != 0;
}

void remarks_print(const struct remarks *self)
{
    for (size_t i = 0; i < self->count; i++) {
        const struct remark *one = &self->items[i];
        const bool first = begins_file(self, i);
        printf("%s%s%s%s\n", first ? one->about : "  ", first ? ": " : "",
               one->level == remark_warning ? "warning: " : "", one->text);
    }
    if (self->short_of_memory) {
        printf("%s\n", lost);
    }
}

void remarks_add_json(const struct remarks *self, cJSON *io_object)
{
    cJSON *list = cJSON_AddArrayToObject(io_object, "findings");
    for (size_t i = 0; i < self->count; i++) {
        const struct remark *one = &self->items[i];
        cJSON *object = cJSON_CreateObject();
        cJSON_AddStringToObject(object, "id", one->id);
        cJSON_AddStringToObject(object, "level", level_names[one->level]);
        cJSON_AddStringToObject(object, "file", one->about);
        cJSON_AddStringToObject(object, "says", one->text);
        cJSON_AddItemToArray(list, object);
    }
    if (self->short_of_memory) {
        cJSON_AddBoolToObject(io_object, "findings_incomplete", true);
    }
}

enum { heading_size = 48 };

/// "period_correlation" as a heading: "Period correlation".
static void write_heading(const char *id, char out_text[heading_size])
{
    snprintf(out_text, heading_size, "%s", id);
    for (char *at = out_text; *at; at++) {
        *at = *at == '_' ? ' ' : *at;
    }
    out_text[0] = (char)toupper((unsigned char)out_text[0]);
}

static bool is_same_warning(const struct remark *a, const struct remark *b)
{
    return a->level == remark_warning && b->level == remark_warning && strcmp(a->text, b->text) == 0;
}

static bool was_said_before(const struct remarks *self, size_t i)
{
    for (size_t before = 0; before < i; before++) {
        if (is_same_warning(&self->items[before], &self->items[i])) {
            return true;
        }
    }
    return false;
}

/// One note for all files that have the same warning.
static void add_warning(const struct remarks *self, size_t i, struct page *page)
{
    const struct remark *one = &self->items[i];
    char heading[heading_size];
    char others[48] = "";
    size_t count = 0;
    for (size_t later = i + 1; later < self->count; later++) {
        count += is_same_warning(one, &self->items[later]);
    }
    if (count > 0) {
        snprintf(others, sizeof others, " and %zu more", count);
    }
    write_heading(one->id, heading);
    page_add_note(page, page_warning, heading, "%s%s: %s.", one->about, others, one->text);
}

void remarks_add_warnings(const struct remarks *self, struct page *page)
{
    size_t warnings = 0;
    for (size_t i = 0; i < self->count; i++) {
        if (self->items[i].level == remark_warning && !was_said_before(self, i)) {
            add_warning(self, i, page);
            warnings++;
        }
    }
    if (self->short_of_memory) {
        page_add_note(page, page_warning, "Incomplete", "%s.", lost);
    } else if (warnings == 0) {
        page_add_note(page, page_good, "No warnings", NULL);
    }
}

void remarks_add_lists(const struct remarks *self, struct page *page)
{
    bool open = false;
    for (size_t i = 0; i < self->count; i++) {
        const struct remark *one = &self->items[i];
        if (begins_file(self, i)) {
            if (open) {
                page_end_list(page);
            }
            page_add_subsection(page, one->about);
            page_start_list(page);
            open = true;
        }
        if (one->level != remark_warning) {
            char heading[heading_size];
            write_heading(one->id, heading);
            page_add_item(page, heading, "%s.", one->text);
        }
    }
    if (open) {
        page_end_list(page);
    }
}

void remarks_free(struct remarks *self)
{
    for (size_t i = 0; i < self->count; i++) {
        free(self->items[i].about);
        free(self->items[i].text);
    }
    free(self->items);
    *self = (struct remarks){0};
}
