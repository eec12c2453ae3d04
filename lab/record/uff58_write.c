/* SPDX-License-Identifier: MIT */
#define _XOPEN_SOURCE 700 /* fmemopen */
#include "lab/record/uff58.h"

#include "lab/record/number.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { values_per_line_doubles = 4 };

static bool is_of_number(char c)
{
    return (c >= '0' && c <= '9') || c == ' ' || c == '-' || c == '+' || c == 'e';
}

/* A field of `width` with `digits` behind the point, one fewer where a long exponent would touch the field before. The
 * locale's decimal mark is the only character that a point has to replace. */
static void write_real(FILE *stream, double value, int width, int digits)
{
    char text[64];
    double size = fabs(value);
    bool long_exponent = size >= 1e100 || (size > 0 && size < 1e-99);
    snprintf(text, sizeof text, "%*.*e", width, digits - (long_exponent ? 1 : 0), value);
    for (char *c = text; *c; c++)
        *c = is_of_number(*c) ? *c : '.';
    fputs(text, stream);
}

static void write_ordinate(FILE *stream, double value)
{
    write_real(stream, value, 20, 12);
}

static void write_abscissa(FILE *stream, double value)
{
    write_real(stream, value, 13, 5);
}

double uff_abscissa_rounded(double value)
{
    char text[64];
    double rounded = value;
    FILE *stream = fmemopen(text, sizeof text, "w");
    if (stream) {
        write_abscissa(stream, value);
        fclose(stream);
        (void)number_parse(text, strlen(text), &rounded);
    }
    return rounded;
}

/* A line of text may not be empty. */
static const char *or_none(const char *text)
{
    return text[0] ? text : "NONE";
}

static void write_axis(FILE *stream, const struct uff_axis *axis)
{
    fprintf(stream, "%10d%5d%5d%5d %-20.20s %-20.20s\n", axis->quantity, axis->length_exponent, axis->force_exponent,
            axis->temperature_exponent, or_none(axis->label), or_none(axis->units));
}

static void write_dof(FILE *stream, const struct uff_dof *dof)
{
    fprintf(stream, " %-10.10s%10ld%4d", or_none(dof->name), dof->node, dof->direction);
}

static void write_values(FILE *stream, const struct uff58 *f)
{
    int on_line = 0, per_line = f->even ? values_per_line_doubles : f->complex ? 3 : 4;
    for (size_t n = 0; n < f->count; n++) {
        if (!f->even) {
            write_abscissa(stream, f->abscissa_values[n]);
            on_line++;
        }
        write_ordinate(stream, f->real[n]);
        on_line++;
        if (f->complex) {
            write_ordinate(stream, f->imag[n]);
            on_line++;
        }
        if (on_line >= per_line || n + 1 == f->count) {
            fputc('\n', stream);
            on_line = 0;
        }
    }
}

static void write_binary(FILE *stream, double value)
{
    uint64_t bits;
    unsigned char bytes[8];
    memcpy(&bits, &value, sizeof bits);
    for (int i = 0; i < 8; i++)
        bytes[i] = (unsigned char)(bits >> (8 * i));
    fwrite(bytes, 1, sizeof bytes, stream);
}

static void write_binary_values(FILE *stream, const struct uff58 *f)
{
    for (size_t n = 0; n < f->count; n++) {
        if (!f->even)
            write_binary(stream, f->abscissa_values[n]);
        write_binary(stream, f->real[n]);
        if (f->complex)
            write_binary(stream, f->imag[n]);
    }
    fputc('\n', stream);
}

/* The line of the dataset's number; a binary one says byte order (1 little), IEEE (2), text lines and bytes behind. */
static void write_number_line(FILE *stream, const struct uff58 *f, bool binary)
{
    size_t bytes = f->count * ((f->even ? 0u : 8u) + (f->complex ? 16u : 8u));
    if (binary)
        fprintf(stream, "%6d%c%6d%6d%12d%12zu%6d%6d%12d%12d\n", 58, 'b', 1, 2, 11, bytes, 0, 0, 0, 0);
    else
        fprintf(stream, "%6d\n", 58);
}

void uff_write_header(FILE *stream, const char *description, const char *program)
{
    fprintf(stream, "    -1\n   151\nNONE\n%.80s\n%.80s\n", or_none(description), or_none(program));
    // No dates: the same input gives the same file.
    fprintf(stream, "%20s%10d%10d%10d\n%20s\n%.80s\n%20s\n    -1\n", "", 0, 0, 0, "", or_none(program), "");
    // Units: 1 is SI (m, N), temperatures 1 absolute; the factors convert to SI, the last is the temperature's offset.
    fprintf(stream, "    -1\n   164\n%10d%-20s%10d\n", 1, "SI: Meter (newton)", 1);
    for (int i = 0; i < 4; i++) {
        write_real(stream, i < 3 ? 1 : 0, 25, 17);
        fputs(i < 2 ? "" : "\n", stream);
    }
    fputs("    -1\n", stream);
}

void uff_write_function(FILE *stream, const struct uff58 *f, bool binary)
{
    fputs("    -1\n", stream);
    write_number_line(stream, f, binary);
    for (int i = 0; i < uff_id_lines; i++)
        fprintf(stream, "%.80s\n", or_none(f->id[i]));
    fprintf(stream, "%5d%10d%5d%10ld", f->function_type, 1, 1, f->load_case);
    write_dof(stream, &f->response);
    write_dof(stream, &f->reference);
    fprintf(stream, "\n%10d%10zu%10d", f->complex ? 6 : 4, f->count, f->even ? 1 : 0);
    write_abscissa(stream, f->even ? f->abscissa_min : 0);
    write_abscissa(stream, f->even ? f->abscissa_step : 0);
    write_abscissa(stream, f->z_value);
    fputc('\n', stream);
    write_axis(stream, &f->abscissa);
    write_axis(stream, &f->numerator);
    write_axis(stream, &f->denominator);
    write_axis(stream, &f->z_axis);
    if (binary)
        write_binary_values(stream, f);
    else
        write_values(stream, f);
    fputs("    -1\n", stream);
}
