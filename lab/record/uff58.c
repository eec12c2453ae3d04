/* SPDX-License-Identifier: MIT */
#include "lab/record/uff58.h"

#include "lab/record/number.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

enum {
    line_size = 512,        /* lines of datasets 58, 151 and 164 have 80 characters */
    shown_max = 40,         /* characters of a line that a message quotes */
    functions_max = 65536,  /* a channel each */
    ascii_lines_of_58b = 11 /* records 1 to 11 */
};

struct reader {
    const char *path;
    gzFile file;
    size_t number; /* of the line in text, from 1 */
    char text[line_size];
    bool ended;
    struct error *out_error;
};

static int refuse(const struct reader *self, const char *what)
{
    return error_set(self->out_error, error_refused, "%s:%zu: '%.*s': %s", self->path, self->number, shown_max,
                     self->text, what);
}

static int cut_off(const struct reader *self, const char *what)
{
    return error_set(self->out_error, error_refused, "%s:%zu: the file ends early: %s was expected", self->path,
                     self->number + 1, what);
}

static int short_of_memory(const struct reader *self)
{
    return error_set(self->out_error, error_refused, "%s:%zu: memory is short", self->path, self->number);
}

/* zlib reports a gzip file that was cut off only once its data is used up. */
static int end_of_file(struct reader *self)
{
    int code = Z_OK;
    (void)gzerror(self->file, &code);
    self->ended = true;
    self->text[0] = '\0';
    if (code == Z_OK || code == Z_STREAM_END)
        return error_none;
    return error_set(self->out_error, error_refused, "%s:%zu: %s", self->path, self->number + 1,
                     code == Z_ERRNO ? strerror(errno) : "the gzip file is cut off or damaged");
}

/* Reads a line without its end; `ended` is set instead behind the last one. What is stepped over may be anything. */
static int next_line(struct reader *self, bool stepped_over)
{
    if (!gzgets(self->file, self->text, line_size))
        return end_of_file(self);
    self->number++;
    size_t length = strlen(self->text);
    bool whole = length > 0 && self->text[length - 1] == '\n';
    while (length > 0 && strchr("\r\n\t ", self->text[length - 1]))
        self->text[--length] = '\0';
    if (whole || gzeof(self->file))
        return error_none;
    for (int c = 0; stepped_over && c != '\n' && c != -1;)
        c = gzgetc(self->file);
    if (stepped_over)
        return error_none;
    return refuse(self, "binary zeros, or a line of more than 500 characters: text was expected");
}

/* Every dataset begins and ends with a line that is -1 in the first six columns. */
static bool is_delimiter(const char *text)
{
    return strcmp(text + strspn(text, " "), "-1") == 0 && strlen(text) <= 6;
}

/* A line of a dataset, which may not end yet. */
static int record_line(struct reader *self, const char *what)
{
    int status = next_line(self, false);
    if (status)
        return status;
    if (self->ended)
        return cut_off(self, what);
    if (is_delimiter(self->text)) {
        self->text[0] = '\0';
        return error_set(self->out_error, error_refused, "%s:%zu: the dataset ends early: %s was expected", self->path,
                         self->number, what);
    }
    return error_none;
}

/* Columns start .. start + width of the line, without blanks around them; the line may end before. */
static void take_field(const struct reader *self, size_t start, size_t width, size_t size, char *out_text)
{
    size_t length = strlen(self->text);
    size_t from = start < length ? start : length, to = start + width < length ? start + width : length;
    while (from < to && self->text[from] == ' ')
        from++;
    while (to > from && self->text[to - 1] == ' ')
        to--;
    size_t kept = to - from < size ? to - from : size - 1;
    memcpy(out_text, self->text + from, kept);
    out_text[kept] = '\0';
}

static void take_text(const struct reader *self, size_t start, size_t width, size_t size, char *out_text)
{
    take_field(self, start, width, size, out_text);
    if (strcmp(out_text, "NONE") == 0)
        out_text[0] = '\0';
}

/* Fortran writes 1.0D+00 in double precision. */
static bool parse_number(const char *text, size_t length, double *out_value)
{
    char copy[64];
    if (length >= sizeof copy)
        return false;
    memcpy(copy, text, length);
    for (size_t i = 0; i < length; i++)
        copy[i] = copy[i] == 'D' || copy[i] == 'd' ? 'e' : copy[i];
    return number_parse(copy, length, out_value) == number_ok;
}

/* A whole number of at most 12 digits; an empty field is 0. */
static int take_integer(const struct reader *self, size_t start, size_t width, const char *what, long *out_value)
{
    char field[32];
    double value = 0;
    take_field(self, start, width, sizeof field, field);
    if (field[0] && (!parse_number(field, strlen(field), &value) || value != floor(value) || !(fabs(value) < 1e12)))
        return error_set(self->out_error, error_refused, "%s:%zu: %s: '%s': a whole number was expected", self->path,
                         self->number, what, field);
    *out_value = (long)value;
    return error_none;
}

/* All words of the line as numbers; false if one is none, or there are more than `most`. */
static bool split_words(const char *text, size_t most, double *out_values, size_t *out_count)
{
    *out_count = 0;
    for (const char *at = text + strspn(text, " \t"); *at; at += strspn(at, " \t")) {
        size_t length = strcspn(at, " \t");
        if (*out_count == most || !parse_number(at, length, &out_values[*out_count]))
            return false;
        ++*out_count;
        at += length;
    }
    return true;
}

enum { values_per_line_max = 6 };

/* The widths of the numbers of a line, 0 behind the last. */
struct widths {
    unsigned char of[values_per_line_max];
};

/* All fields of the line as numbers, by their widths. */
static bool split_fields(const struct reader *self, const struct widths *widths, double *out_values, size_t *out_count)
{
    char field[32];
    size_t at = 0;
    *out_count = 0;
    for (int i = 0; i < values_per_line_max && widths->of[i] > 0 && at < strlen(self->text); i++) {
        take_field(self, at, widths->of[i], sizeof field, field);
        if (!parse_number(field, strlen(field), &out_values[i]))
            return false;
        ++*out_count;
        at += widths->of[i];
    }
    return at >= strlen(self->text);
}

/* The numbers of a line: words first, because not every writer keeps the columns; where fields touch, by columns. */
static int split_line(const struct reader *self, const struct widths *widths, double out_values[values_per_line_max],
                      size_t *out_count)
{
    if (split_words(self->text, values_per_line_max, out_values, out_count) ||
        split_fields(self, widths, out_values, out_count))
        return error_none;
    return refuse(self, "numbers in the fields of dataset 58 were expected");
}

static int read_dof(struct reader *self, struct uff58 *f)
{
    long type = 0, direction = 0;
    int status = take_integer(self, 0, 5, "function type", &type);
    f->function_type = (int)type;
    if (!status)
        status = take_integer(self, 20, 10, "load case", &f->load_case);
    take_text(self, 31, 10, sizeof f->response.name, f->response.name);
    if (!status)
        status = take_integer(self, 41, 10, "response node", &f->response.node);
    if (!status)
        status = take_integer(self, 51, 4, "response direction", &direction);
    f->response.direction = (int)direction;
    take_text(self, 56, 10, sizeof f->reference.name, f->reference.name);
    if (!status)
        status = take_integer(self, 66, 10, "reference node", &f->reference.node);
    if (!status)
        status = take_integer(self, 76, 4, "reference direction", &direction);
    f->reference.direction = (int)direction;
    return status;
}

static int read_axis(struct reader *self, const char *what, struct uff_axis *out_axis)
{
    long values[4] = {0};
    static const size_t at[4] = {0, 10, 15, 20}, width[4] = {10, 5, 5, 5};
    int status = record_line(self, what);
    for (int i = 0; i < 4 && !status; i++)
        status = take_integer(self, at[i], width[i], what, &values[i]);
    if (status)
        return status;
    out_axis->quantity = (int)values[0];
    out_axis->length_exponent = (int)values[1];
    out_axis->force_exponent = (int)values[2];
    out_axis->temperature_exponent = (int)values[3];
    take_text(self, 26, 20, sizeof out_axis->label, out_axis->label);
    take_text(self, 47, 20, sizeof out_axis->units, out_axis->units);
    return error_none;
}

/* What record 7 says of the values. */
struct form {
    bool double_precision;
    size_t per_point; /* numbers of a point: abscissa if uneven, one or two of the ordinate */
    struct widths widths;
};

static struct form form_of(const struct uff58 *f, bool double_precision)
{
    struct form form = {.double_precision = double_precision,
                        .per_point = (f->even ? 0 : 1) + (f->complex ? 2 : 1),
                        .widths = {{13, 13, 13, 13, 13, 13}}};
    if (double_precision)
        form.widths = f->even      ? (struct widths){{20, 20, 20, 20}}
                      : f->complex ? (struct widths){{13, 20, 20}}
                                   : (struct widths){{13, 20, 13, 20}};
    return form;
}

/* What is wrong with the numbers of record 7; NULL if nothing is. */
static const char *judge_form(const double *v, size_t count)
{
    if (!(count >= 5 && (v[0] == 2 || v[0] == 4 || v[0] == 5 || v[0] == 6)))
        return "ordinate type 2, 4, 5 or 6 and five more numbers were expected";
    if (!(v[1] >= 1 && v[1] < 1e12 && v[1] == floor(v[1])))
        return "a number of values from 1 on was expected";
    bool even = v[2] == 1 && (v[4] != 0 || v[1] == 1);
    return v[2] == 0 || even ? NULL : "spacing 0, or 1 and a step other than 0, was expected";
}

static int read_form(struct reader *self, struct uff58 *f, struct form *out_form)
{
    static const struct widths widths = {{10, 10, 10, 13, 13, 13}};
    double v[values_per_line_max] = {0};
    size_t count;
    int status = record_line(self, "record 7, type and number of the values");
    if (!status)
        status = split_line(self, &widths, v, &count);
    if (status)
        return status;
    const char *wrong = judge_form(v, count);
    if (wrong)
        return refuse(self, wrong);
    f->complex = v[0] >= 5;
    f->count = (size_t)v[1];
    f->even = v[2] == 1;
    f->abscissa_min = v[3];
    f->abscissa_step = v[4];
    f->z_value = v[5];
    *out_form = form_of(f, v[0] == 4 || v[0] == 6);
    return error_none;
}

static bool grow(double **io_values, size_t capacity)
{
    double *grown = realloc(*io_values, capacity * sizeof *grown);
    if (grown)
        *io_values = grown;
    return grown != NULL;
}

/* Room for one point more than `points`; it grows with what was read, not with what record 7 promises. */
static bool make_room(struct uff58 *f, size_t points, size_t *io_capacity)
{
    if (points < *io_capacity)
        return true;
    size_t capacity = *io_capacity ? *io_capacity * 2 : 1024;
    capacity = capacity < f->count ? capacity : f->count;
    if (capacity > SIZE_MAX / sizeof(double) || !grow(&f->real, capacity) ||
        (f->complex && !grow(&f->imag, capacity)) || (!f->even && !grow(&f->abscissa_values, capacity)))
        return false;
    *io_capacity = capacity;
    return true;
}

static void store_value(struct uff58 *f, size_t point, size_t place, double value)
{
    if (!f->even && place == 0)
        f->abscissa_values[point] = value;
    else if (place == (f->even ? 0u : 1u))
        f->real[point] = value;
    else
        f->imag[point] = value;
}

static int read_text_values(struct reader *self, struct uff58 *f, const struct form *form)
{
    size_t capacity = 0, place = 0, point = 0;
    while (point < f->count) {
        double values[values_per_line_max];
        size_t count = 0;
        int status = record_line(self, "a line of values");
        if (!status)
            status = split_line(self, &form->widths, values, &count);
        if (status)
            return status;
        for (size_t i = 0; i < count; i++) {
            if (point == f->count)
                return refuse(self, "more values than record 7 says");
            if (!make_room(f, point, &capacity))
                return short_of_memory(self);
            store_value(f, point, place, values[i]);
            place = (place + 1) % form->per_point;
            point += place == 0;
        }
    }
    return error_none;
}

/* What the line with the dataset's number says of the bytes of a 58b. */
struct binary {
    bool on;
    bool big_endian;
    size_t bytes;
};

static int read_binary_head(struct reader *self, struct binary *out_binary)
{
    long order = 0, format = 0, lines = 0, bytes = 0;
    int status = take_integer(self, 7, 6, "byte ordering", &order);
    if (!status)
        status = take_integer(self, 13, 6, "floating-point format", &format);
    if (!status)
        status = take_integer(self, 19, 12, "number of text lines", &lines);
    if (!status)
        status = take_integer(self, 31, 12, "number of bytes", &bytes);
    if (status)
        return status;
    if ((order != 1 && order != 2) || format != 2 || lines != ascii_lines_of_58b || bytes < 1)
        return refuse(self, "byte ordering 1 or 2, floating-point format 2 (IEEE), 11 text lines and bytes from 1 on "
                            "were expected");
    *out_binary = (struct binary){.on = true, .big_endian = order == 2, .bytes = (size_t)bytes};
    return error_none;
}

static double decode(const unsigned char *bytes, size_t size, bool big_endian)
{
    uint64_t bits = 0;
    for (size_t i = 0; i < size; i++)
        bits |= (uint64_t)bytes[big_endian ? size - 1 - i : i] << (8 * i);
    if (size == 4) {
        uint32_t half = (uint32_t)bits;
        float value;
        memcpy(&value, &half, sizeof value);
        return value;
    }
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Bytes of an abscissa value, from the bytes that the head promises: single precision by the definition, that of the
 * ordinate with the usual writers, of which one counts the points' ordinates as if they were real. 0: none of these. */
static size_t abscissa_size(const struct uff58 *f, const struct form *form, size_t bytes)
{
    size_t ordinate = form->double_precision ? 8 : 4;
    size_t each = bytes % f->count == 0 ? bytes / f->count : 0, whole = form->per_point * ordinate;
    if (each == whole || each == ordinate)
        return ordinate;
    return !f->even && each == whole - ordinate + 4 ? 4 : 0;
}

static int read_binary_values(struct reader *self, struct uff58 *f, const struct form *form,
                              const struct binary *binary)
{
    size_t ordinate = form->double_precision ? 8 : 4, capacity = 0;
    size_t abscissa = abscissa_size(f, form, binary->bytes);
    size_t bytes = form->per_point * ordinate - (f->even ? 0 : ordinate - abscissa);
    if (abscissa == 0)
        return error_set(self->out_error, error_refused,
                         "%s:%zu: %zu bytes for %zu points: %zu for each point were expected", self->path, f->line,
                         binary->bytes, f->count, form->per_point * ordinate);
    for (size_t point = 0; point < f->count; point++) {
        unsigned char raw[3 * 8];
        if (gzread(self->file, raw, (unsigned)bytes) != (int)bytes) {
            int status = end_of_file(self);
            return status ? status : cut_off(self, "a binary value");
        }
        if (!make_room(f, point, &capacity))
            return short_of_memory(self);
        for (size_t place = 0, at = 0; place < form->per_point; place++) {
            size_t size = place == 0 && !f->even ? abscissa : ordinate;
            double value = decode(raw + at, size, binary->big_endian);
            if (!isfinite(value))
                return error_set(self->out_error, error_refused, "%s:%zu: value %zu of the function is not finite",
                                 self->path, f->line, point + 1);
            store_value(f, point, place, value);
            at += size;
        }
    }
    return error_none;
}

/* The end of a dataset; blank lines before it are stepped over. */
static int read_end(struct reader *self)
{
    do {
        int status = next_line(self, false);
        if (status)
            return status;
    } while (!self->ended && self->text[0] == '\0');
    if (self->ended)
        return cut_off(self, "'    -1'");
    return is_delimiter(self->text) ? error_none : refuse(self, "'    -1', the end of the dataset, was expected");
}

static int read_axes(struct reader *self, struct uff58 *f)
{
    int status = read_axis(self, "record 8, the abscissa's kind", &f->abscissa);
    if (!status)
        status = read_axis(self, "record 9, the ordinate's kind", &f->numerator);
    if (!status)
        status = read_axis(self, "record 10, the denominator's kind", &f->denominator);
    return status ? status : read_axis(self, "record 11, the z axis' kind", &f->z_axis);
}

static int read_function(struct reader *self, struct uff58 *f)
{
    struct binary binary = {0};
    struct form form;
    bool has_mark = strlen(self->text) > 6 && (self->text[6] == 'b' || self->text[6] == 'B');
    int status = has_mark ? read_binary_head(self, &binary) : error_none;
    f->line = self->number;
    for (int i = 0; i < uff_id_lines && !status; i++) {
        status = record_line(self, "an identification line");
        if (!status)
            take_text(self, 0, 80, sizeof f->id[i], f->id[i]);
    }
    if (!status)
        status = record_line(self, "record 6, function type and places");
    if (!status)
        status = read_dof(self, f);
    if (!status)
        status = read_form(self, f, &form);
    if (!status)
        status = read_axes(self, f);
    if (!status)
        status = binary.on ? read_binary_values(self, f, &form, &binary) : read_text_values(self, f, &form);
    return status ? status : read_end(self);
}

static int add_function(struct reader *self, struct uff_file *file)
{
    if (file->count == functions_max)
        return refuse(self, "the file has more than 65536 functions");
    struct uff58 *functions = realloc(file->functions, (file->count + 1) * sizeof *functions);
    if (!functions)
        return short_of_memory(self);
    file->functions = functions;
    functions[file->count] = (struct uff58){0};
    return read_function(self, &functions[file->count++]);
}

/* Dataset 151, the header; short ones end early. */
static int read_header(struct reader *self, struct uff_file *file)
{
    int status = error_none;
    for (int line = 1; !status; line++) {
        status = next_line(self, true);
        if (status || self->ended || is_delimiter(self->text))
            break;
        if (line == 2)
            take_text(self, 0, 80, sizeof file->description, file->description);
        if (line == 6)
            take_text(self, 0, 80, sizeof file->program, file->program);
    }
    return status ? status : self->ended ? cut_off(self, "'    -1'") : error_none;
}

/* Dataset 164, units; what has another form is left unread. */
static int read_units(struct reader *self, struct uff_file *file)
{
    int status = error_none;
    for (int line = 1; !status; line++) {
        double values[values_per_line_max];
        size_t count = 0;
        status = next_line(self, true);
        if (status || self->ended || is_delimiter(self->text))
            break;
        if (line == 1)
            take_text(self, 10, 20, sizeof file->units, file->units);
        if (line == 2 && split_words(self->text, values_per_line_max, values, &count) && count >= 2) {
            file->has_units = true;
            file->to_si[0] = values[0];
            file->to_si[1] = values[1];
        }
    }
    return status ? status : self->ended ? cut_off(self, "'    -1'") : error_none;
}

static int skip_dataset(struct reader *self, struct uff_file *file)
{
    file->skipped++;
    int status = error_none;
    do
        status = next_line(self, true);
    while (!status && !self->ended && !is_delimiter(self->text));
    return status ? status : self->ended ? cut_off(self, "'    -1'") : error_none;
}

/* The line behind a dataset's first delimiter: its number. */
static int read_dataset(struct reader *self, struct uff_file *file)
{
    long number = 0;
    int status = next_line(self, false);
    if (!status && self->ended)
        status = cut_off(self, "the number of a dataset");
    if (!status)
        status = take_integer(self, 0, 6, "number of the dataset", &number);
    if (status)
        return status;
    switch (number) {
    case 58:
        return add_function(self, file);
    case 151:
        return read_header(self, file);
    case 164:
        return read_units(self, file);
    default:
        return number > 0 ? skip_dataset(self, file) : refuse(self, "the number of a dataset was expected");
    }
}

static int read_all(struct reader *self, struct uff_file *file)
{
    for (;;) {
        int status = next_line(self, false);
        if (status || self->ended)
            return status;
        if (self->text[0] == '\0')
            continue;
        if (!is_delimiter(self->text))
            return refuse(self, "'    -1', the beginning of a dataset, was expected");
        status = read_dataset(self, file);
        if (status)
            return status;
    }
}

int uff_file_read(const char *path, struct uff_file *out_file, struct error *out_error)
{
    *out_file = (struct uff_file){0};
    struct reader reader = {.path = path, .out_error = out_error};
    errno = 0;
    reader.file = gzopen(path, "rb");
    if (!reader.file)
        return error_set(out_error, error_refused, "%s: cannot be read: %s", path,
                         errno ? strerror(errno) : "memory is short");
    int status = read_all(&reader, out_file);
    if (!status && out_file->count == 0)
        status = error_set(out_error, error_refused, "%s: has no dataset 58: signals or responses were expected", path);
    gzclose_r(reader.file);
    if (status)
        uff_file_free(out_file);
    return status;
}

void uff_file_free(struct uff_file *self)
{
    for (size_t i = 0; i < self->count; i++) {
        free(self->functions[i].abscissa_values);
        free(self->functions[i].real);
        free(self->functions[i].imag);
    }
    free(self->functions);
    *self = (struct uff_file){0};
}
