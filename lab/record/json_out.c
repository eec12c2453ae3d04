/* SPDX-License-Identifier: MIT */
#include "lab/record/json_out.h"

#include "lab/record/atomic_file.h"
#include "lab/record/number.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* Deeper trees than any of ours would only come from a mistake that made a circle. */
enum { depth_max = 64, indent_width = 2 };

static void print_string(FILE *stream, const char *text)
{
    fputc('"', stream);
    for (const char *c = text ? text : ""; *c; c++) {
        unsigned char code = (unsigned char)*c;
        if (code == '"' || code == '\\')
            fprintf(stream, "\\%c", code);
        else if (code == '\n')
            fputs("\\n", stream);
        else if (code == '\t')
            fputs("\\t", stream);
        else if (code < 0x20)
            fprintf(stream, "\\u%04x", code);
        else
            fputc(code, stream);
    }
    fputc('"', stream);
}

static void print_number(FILE *stream, double value)
{
    char text[number_text_size];
    if (!isfinite(value)) {
        fputs("null", stream);
        return;
    }
    number_format(value, text);
    fputs(text, stream);
}

static void print_value(FILE *stream, const cJSON *item, int depth);

static void print_indent(FILE *stream, int depth)
{
    fprintf(stream, "\n%*s", depth * indent_width, "");
}

static bool is_flat(const cJSON *array)
{
    const cJSON *item;
    cJSON_ArrayForEach(item, array) if (cJSON_IsArray(item) || cJSON_IsObject(item)) return false;
    return true;
}

static void print_array(FILE *stream, const cJSON *array, int depth)
{
    bool flat = is_flat(array);
    const cJSON *item;
    fputc('[', stream);
    cJSON_ArrayForEach(item, array)
    {
        if (item != array->child)
            fputs(flat ? ", " : ",", stream);
        if (!flat)
            print_indent(stream, depth + 1);
        print_value(stream, item, depth + 1);
    }
    if (!flat)
        print_indent(stream, depth);
    fputc(']', stream);
}

static void print_object(FILE *stream, const cJSON *object, int depth)
{
    const cJSON *item;
    fputc('{', stream);
    cJSON_ArrayForEach(item, object)
    {
        if (item != object->child)
            fputc(',', stream);
        print_indent(stream, depth + 1);
        print_string(stream, item->string);
        fputs(": ", stream);
        print_value(stream, item, depth + 1);
    }
    if (object->child)
        print_indent(stream, depth);
    fputc('}', stream);
}

static void print_value(FILE *stream, const cJSON *item, int depth)
{
    if (depth > depth_max)
        fputs("null", stream);
    else if (cJSON_IsObject(item))
        print_object(stream, item, depth);
    else if (cJSON_IsArray(item))
        print_array(stream, item, depth);
    else if (cJSON_IsNumber(item))
        print_number(stream, item->valuedouble);
    else if (cJSON_IsString(item))
        print_string(stream, item->valuestring);
    else if (cJSON_IsRaw(item))
        fputs(item->valuestring, stream);
    else
        fputs(cJSON_IsTrue(item) ? "true" : cJSON_IsFalse(item) ? "false" : "null", stream);
}

void json_print(FILE *stream, const cJSON *root)
{
    print_value(stream, root, 0);
    fputc('\n', stream);
}

int json_print_stdout(const cJSON *root, struct error *out_error)
{
    json_print(stdout, root);
    if (fflush(stdout) != 0 || ferror(stdout))
        return error_set(out_error, error_refused, "standard output does not take the result: %s", strerror(errno));
    return error_none;
}

int json_write(const char *path, const cJSON *root, struct error *out_error)
{
    struct atomic_file file;
    FILE *stream = atomic_file_open(&file, path, out_error);
    if (!stream)
        return error_refused;
    json_print(stream, root);
    return atomic_file_commit(&file, out_error);
}
