/* SPDX-License-Identifier: MIT */
#include "lab/record/manifest.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

bool manifest_is(const char *path)
{
    static const char byte_order_mark[] = "\xEF\xBB\xBF";
    char text[64] = "";
    struct stat file;
    /* What is read of a pipe is gone. */
    FILE *stream = stat(path, &file) == 0 && S_ISREG(file.st_mode) ? fopen(path, "rb") : NULL;
    if (!stream) {
        return false;
    }
    const size_t length = fread(text, 1, sizeof text - 1, stream);
    fclose(stream);
    text[length] = '\0';
    const char *at = strncmp(text, byte_order_mark, 3) == 0 ? text + 3 : text;
    return at[strspn(at, " \t\r\n")] == '{';
}

const char *manifest_name_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

char *manifest_beside(const char *manifest_path, const char *file)
{
    const size_t folder = (size_t)(manifest_name_of(manifest_path) - manifest_path);
    char *path = malloc(folder + strlen(file) + 1);
    if (path) {
        memcpy(path, manifest_path, folder);
        strcpy(path + folder, file);
    }
    return path;
}

static int refuse(const struct json_document *document, const char *parent, const char *name, const cJSON *value,
                  const char *expectation, struct error *out_error)
{
    char member[json_path_size];
    json_path_join(member, parent, name);
    return json_document_error(document, member, value, expectation, out_error);
}

int manifest_check_holds(const struct json_document *document, const char *expected, struct error *out_error)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(document->root, "holds");
    if (cJSON_IsString(item) && strcmp(item->valuestring, expected) == 0) {
        return error_none;
    }
    char expectation[160];
    snprintf(expectation, sizeof expectation, "a manifest that holds \"%s\" was expected, from servoscope %s", expected,
             strcmp(expected, "tables") == 0 ? "design" : "measure or simulate");
    return refuse(document, "", "holds", item, expectation, out_error);
}

int manifest_read_word(const struct json_document *document, const cJSON *object, const char *parent, const char *name,
                       const char *const *words, const char **out_text, struct error *out_error)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    char expectation[160] = "expected one of";
    for (size_t i = 0; words[i]; i++) {
        if (cJSON_IsString(item) && strcmp(item->valuestring, words[i]) == 0) {
            *out_text = words[i];
            return error_none;
        }
        const size_t used = strlen(expectation);
        snprintf(expectation + used, sizeof expectation - used, "%s %s", i ? "," : "", words[i]);
    }
    return refuse(document, parent, name, item, expectation, out_error);
}

/// Files lie beside their manifest, so that a folder can be moved, and a manifest from elsewhere names nothing outside.
static bool stays_beside(const char *file)
{
    const size_t length = strlen(file);
    bool climbs = strncmp(file, "../", 3) == 0 || strstr(file, "/../") != NULL || strcmp(file, "..") == 0;
    return length > 0 && file[0] != '/' && file[length - 1] != '/' && !climbs;
}

int manifest_read_file(const struct json_document *document, const cJSON *object, const char *parent, const char *name,
                       char **out_file, struct error *out_error)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    if (!cJSON_IsString(item) || !stays_beside(item->valuestring)) {
        return refuse(document, parent, name, item, "the name of a file beside this one was expected", out_error);
    }
    *out_file = strdup(item->valuestring);
    return *out_file ? error_none : error_set(out_error, error_refused, "%s: memory is short", document->path);
}

int manifest_read_whole(const struct json_document *document, const cJSON *object, const char *parent, const char *name,
                        uint64_t lowest, uint64_t highest, uint64_t *out_value, struct error *out_error)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    const double value = cJSON_IsNumber(item) ? item->valuedouble : NAN;
    if (value >= (double)lowest && value <= (double)highest && !(value < floor(value) || value > floor(value))) {
        *out_value = (uint64_t)value;
        return error_none;
    }
    char expectation[96];
    snprintf(expectation, sizeof expectation, "a whole number from %llu to %llu was expected",
             (unsigned long long)lowest, (unsigned long long)highest);
    return refuse(document, parent, name, item, expectation, out_error);
}

int manifest_read_number(const struct json_document *document, const cJSON *object, const char *parent,
                         const char *name, double lowest, double *out_value, struct error *out_error)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    const double value = cJSON_IsNumber(item) ? item->valuedouble : NAN;
    if (value >= lowest && isfinite(value)) {
        *out_value = value;
        return error_none;
    }
    char expectation[96];
    snprintf(expectation, sizeof expectation, "a number of at least %g was expected", lowest);
    return refuse(document, parent, name, item, expectation, out_error);
}

int manifest_read_crc32(const struct json_document *document, const cJSON *object, const char *parent, const char *name,
                        uint32_t *out_crc32, struct error *out_error)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    const char *text = cJSON_IsString(item) ? item->valuestring : "";
    size_t digits = 0;
    while (digits <= 8 && strncmp(text, "0x", 2) == 0 && isxdigit((unsigned char)text[2 + digits])) {
        digits++;
    }
    if (digits < 1 || digits > 8 || text[2 + digits] != '\0') {
        return refuse(document, parent, name, item, "\"0x\" and up to eight hexadecimal digits were expected",
                      out_error);
    }
    *out_crc32 = (uint32_t)strtoul(text + 2, NULL, 16);
    return error_none;
}

int manifest_read_array(const struct json_document *document, const cJSON *object, const char *parent, const char *name,
                        size_t highest, const cJSON **out_array, struct error *out_error)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    const int size = cJSON_IsArray(item) ? cJSON_GetArraySize(item) : 0;
    if (size >= 1 && (size_t)size <= highest) {
        *out_array = item;
        return error_none;
    }
    char expectation[96];
    snprintf(expectation, sizeof expectation, "an array of 1 to %zu elements was expected", highest);
    return refuse(document, parent, name, item, expectation, out_error);
}

void manifest_element(char out_path[json_path_size], const char *parent, const char *name, size_t index)
{
    char element[json_path_size];
    snprintf(element, sizeof element, "%s[%zu]", name, index);
    json_path_join(out_path, parent, element);
}

void manifest_add_crc32(cJSON *object, const char *name, uint32_t crc32)
{
    char text[16];
    snprintf(text, sizeof text, "0x%08lx", (unsigned long)crc32);
    cJSON_AddStringToObject(object, name, text);
}
