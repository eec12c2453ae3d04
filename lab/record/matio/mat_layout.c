/* SPDX-License-Identifier: MIT */
#include "lab/record/matio/mat_layout.h"

#include <errno.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <zlib.h>

/* Numbers of the file format: MathWorks, MAT-File Format, "Level 5 MAT-file format". */
enum {
    header_size = 128,
    tag_size = 8,
    type_int8 = 1,
    type_int32 = 5,
    type_uint32 = 6,
    type_matrix = 14,
    type_compressed = 15,
    class_cell = 1,
    class_struct = 2,
    class_object = 3,
    class_char = 4,
    class_sparse = 5,
    class_double = 6,
    class_uint64 = 15,
    class_function = 16,
    class_opaque = 17,
    flag_complex = 0x0800,
    depth_max = 16,
    rank_max = 32,
};

struct walker {
    const char *path;
    FILE *stream;
    bool swapped;
    struct error *out_error;
};

/* A piece of data with its tag. */
struct element {
    uint64_t at; /* of the tag */
    uint32_t type;
    uint64_t data, length; /* of the bytes behind the tag */
    uint64_t next;         /* where the next tag is */
};

static int refuse(const struct walker *self, uint64_t at, const char *what)
{
    return error_set(self->out_error, error_refused, "%s: byte %llu: %s", self->path, (unsigned long long)at, what);
}

static uint32_t load_u32(const unsigned char *at, bool swapped)
{
    return swapped ? (uint32_t)at[0] << 24 | (uint32_t)at[1] << 16 | (uint32_t)at[2] << 8 | at[3]
                   : (uint32_t)at[3] << 24 | (uint32_t)at[2] << 16 | (uint32_t)at[1] << 8 | at[0];
}

static bool read_at(const struct walker *self, uint64_t at, void *out_bytes, size_t size)
{
    return fseeko(self->stream, (off_t)at, SEEK_SET) == 0 && fread(out_bytes, 1, size, self->stream) == size;
}

/* The element at `at`, which has to end by `end`. Up to four bytes of data stand in the tag itself. */
static int read_element(const struct walker *self, uint64_t at, uint64_t end, struct element *out_element)
{
    unsigned char tag[tag_size];
    *out_element = (struct element){.at = at};
    if (at + tag_size > end || !read_at(self, at, tag, tag_size))
        return refuse(self, at, "the file is cut off: a variable or a part of one was expected");
    uint32_t word = load_u32(tag, self->swapped);
    bool small = word >> 16 != 0;
    *out_element = (struct element){.at = at,
                                    .type = small ? word & 0xffff : word,
                                    .length = small ? word >> 16 : load_u32(tag + 4, self->swapped),
                                    .data = at + (small ? 4 : tag_size)};
    uint64_t data_end = out_element->data + out_element->length;
    if (data_end > end || (small && out_element->length > 4))
        return error_set(self->out_error, error_refused,
                         "%s: byte %llu: the file is cut off or damaged: %llu bytes were expected, %llu are there",
                         self->path, (unsigned long long)at, (unsigned long long)out_element->length,
                         (unsigned long long)(end - out_element->data));
    out_element->next = small ? at + tag_size : (data_end + 7) / 8 * 8;
    out_element->next = out_element->next < end ? out_element->next : end;
    return error_none;
}

/* Bytes of one value of a type; 0 for what is no number. */
static unsigned value_size(uint32_t type)
{
    static const unsigned char sizes[] = {0, 1, 1, 2, 2, 4, 4, 4, 0, 8, 0, 0, 8, 8, 0, 0, 1, 2, 4};
    return type < sizeof sizes ? sizes[type] : 0;
}

/* What the head of a variable says. */
struct head {
    uint32_t class_type;
    bool complex;
    uint64_t values;
};

static int read_flags(const struct walker *self, uint64_t *io_at, uint64_t end, struct head *out_head)
{
    struct element flags;
    unsigned char bytes[4];
    int status = read_element(self, *io_at, end, &flags);
    if (status)
        return status;
    if (flags.type != type_uint32 || flags.length != 8 || !read_at(self, flags.data, bytes, sizeof bytes))
        return refuse(self, *io_at, "the flags of a variable were expected");
    uint32_t word = load_u32(bytes, self->swapped);
    *out_head = (struct head){.class_type = word & 0xff, .complex = (word & flag_complex) != 0, .values = 1};
    *io_at = flags.next;
    return error_none;
}

static int read_sizes(const struct walker *self, uint64_t *io_at, uint64_t end, struct head *io_head)
{
    struct element sizes;
    unsigned char bytes[4 * rank_max];
    int status = read_element(self, *io_at, end, &sizes);
    if (status)
        return status;
    if (sizes.type != type_int32 || sizes.length < 8 || sizes.length % 4 != 0 || sizes.length > sizeof bytes ||
        !read_at(self, sizes.data, bytes, sizes.length))
        return refuse(self, *io_at, "the sizes of a variable were expected");
    for (size_t d = 0; d < sizes.length / 4; d++) {
        uint32_t size = load_u32(bytes + 4 * d, self->swapped);
        if (size > INT32_MAX || (size > 0 && io_head->values > UINT32_MAX / size))
            return refuse(self, sizes.data, "the sizes of a variable exceed what a file can hold");
        io_head->values *= size;
    }
    *io_at = sizes.next;
    return error_none;
}

/* Flags, sizes and name; *io_at ends behind them. */
static int read_head(const struct walker *self, uint64_t *io_at, uint64_t end, struct head *out_head)
{
    struct element name;
    int status = read_flags(self, io_at, end, out_head);
    if (status || out_head->class_type == class_opaque)
        return status;
    status = read_sizes(self, io_at, end, out_head);
    if (!status)
        status = read_element(self, *io_at, end, &name);
    if (status)
        return status;
    if (name.type != type_int8)
        return refuse(self, *io_at, "the name of a variable was expected");
    *io_at = name.next;
    return error_none;
}

/* One run of numbers: `values` of them, or at least as many bytes where `text`. */
static int check_numbers(const struct walker *self, uint64_t *io_at, uint64_t end, uint64_t values, bool text)
{
    struct element data;
    if (values == 0 && *io_at == end)
        return error_none;
    int status = read_element(self, *io_at, end, &data);
    if (status)
        return status;
    unsigned size = value_size(data.type);
    uint64_t held = size ? data.length / size : 0;
    if (size == 0 || data.length % size != 0 || (text ? held < values : held != values))
        return error_set(self->out_error, error_refused,
                         "%s: byte %llu: %llu bytes of type %u: %llu values were expected", self->path,
                         (unsigned long long)*io_at, (unsigned long long)data.length, (unsigned)data.type,
                         (unsigned long long)values);
    *io_at = data.next;
    return error_none;
}

static int check_matrix(const struct walker *self, const struct element *matrix, int depth);

/* Variables in a variable: cells, fields. */
static int check_inner(const struct walker *self, uint64_t *io_at, uint64_t end, uint64_t count, int depth)
{
    int status = error_none;
    for (uint64_t i = 0; i < count && !status; i++) {
        struct element inner;
        status = read_element(self, *io_at, end, &inner);
        if (!status && inner.type != type_matrix)
            status = refuse(self, *io_at, "a variable in a variable was expected");
        if (!status && inner.length > 0)
            status = check_matrix(self, &inner, depth + 1);
        *io_at = status ? *io_at : inner.next;
    }
    return status;
}

/* Elements whose content is not judged. */
static int step_over(const struct walker *self, uint64_t *io_at, uint64_t end, int count)
{
    int status = error_none;
    for (int i = 0; i < count && !status; i++) {
        struct element skipped;
        status = read_element(self, *io_at, end, &skipped);
        *io_at = status ? *io_at : skipped.next;
    }
    return status;
}

/* The length of field names, the names, then the fields. */
static int check_struct(const struct walker *self, uint64_t *io_at, uint64_t end, const struct head *head, int depth)
{
    struct element length, names;
    unsigned char bytes[4];
    int status = read_element(self, *io_at, end, &length);
    if (!status && (length.type != type_int32 || length.length != 4 || !read_at(self, length.data, bytes, 4)))
        status = refuse(self, *io_at, "the length of field names was expected");
    if (!status)
        status = read_element(self, length.next, end, &names);
    if (status)
        return status;
    uint32_t each = load_u32(bytes, self->swapped);
    *io_at = names.next;
    if (names.type == type_int8 && names.length == 0)
        return error_none;
    if (each == 0 || each > 4096 || names.type != type_int8 || names.length % each != 0)
        return refuse(self, length.next, "the names of fields were expected");
    return check_inner(self, io_at, end, head->values * (names.length / each), depth);
}

static int check_values(const struct walker *self, uint64_t at, uint64_t end, const struct head *head)
{
    if (head->class_type < class_double || head->class_type > class_uint64)
        return refuse(self, at, "a variable of a known class was expected");
    int status = check_numbers(self, &at, end, head->values, false);
    return status || !head->complex ? status : check_numbers(self, &at, end, head->values, false);
}

static int check_matrix(const struct walker *self, const struct element *matrix, int depth)
{
    uint64_t at = matrix->data, end = matrix->data + matrix->length;
    struct head head = {0};
    if (depth > depth_max)
        return refuse(self, at, "variables in variables more than 16 deep");
    int status = read_head(self, &at, end, &head);
    if (status)
        return status;
    switch (head.class_type) {
    case class_cell:
        return check_inner(self, &at, end, head.values, depth);
    case class_object: // the name of its class comes first
        status = step_over(self, &at, end, 1);
        return status ? status : check_struct(self, &at, end, &head, depth);
    case class_struct:
        return check_struct(self, &at, end, &head, depth);
    case class_char:
        return head.values == 0 ? error_none : check_numbers(self, &at, end, head.values, true);
    case class_sparse: // row and column indices of its values, and these
        return step_over(self, &at, end, head.complex ? 4 : 3);
    case class_function:
    case class_opaque: // matio steps over what is in them
        return error_none;
    default:
        return check_values(self, at, end, &head);
    }
}

/* A compressed variable has a check sum at its end. */
static int check_compressed(const struct walker *self, const struct element *element)
{
    unsigned char in[1 << 14], out[1 << 15];
    z_stream stream = {0};
    uint64_t left = element->length;
    int code = inflateInit(&stream);
    if (code != Z_OK || fseeko(self->stream, (off_t)element->data, SEEK_SET) != 0)
        return refuse(self, element->at, "memory is short");
    while (code == Z_OK) {
        if (stream.avail_in == 0) {
            size_t wanted = left < sizeof in ? (size_t)left : sizeof in;
            stream.avail_in = (uInt)fread(in, 1, wanted, self->stream);
            stream.next_in = in;
            left -= stream.avail_in;
        }
        stream.next_out = out;
        stream.avail_out = sizeof out;
        code = inflate(&stream, Z_NO_FLUSH);
    }
    (void)inflateEnd(&stream);
    return code == Z_STREAM_END ? error_none : refuse(self, element->at, "a compressed variable is damaged");
}

static int walk(const struct walker *self, uint64_t size)
{
    uint64_t at = header_size;
    int status = at < size ? error_none : refuse(self, at, "the file ends: a variable was expected");
    while (at < size && !status) {
        struct element element;
        status = read_element(self, at, size, &element);
        if (!status && element.type == type_matrix)
            status = check_matrix(self, &element, 0);
        else if (!status && element.type == type_compressed)
            status = check_compressed(self, &element);
        else if (!status)
            status = refuse(self, at, "a variable (type 14 or 15) was expected");
        // Compressed variables are not filled up to eight bytes.
        at = element.type == type_compressed ? element.data + element.length : element.next;
    }
    return status;
}

static int check(struct walker *self)
{
    unsigned char header[header_size];
    struct stat file;
    size_t got = fread(header, 1, header_size, self->stream);
    if (got >= 2 && header[0] == 0x1f && header[1] == 0x8b)
        return error_set(self->out_error, error_refused, "%s: is gzipped: unpack it first (gunzip)", self->path);
    if (got < header_size || fstat(fileno(self->stream), &file) != 0)
        return error_set(self->out_error, error_refused,
                         "%s: the file is cut off: a header of %d bytes was expected, %zu are there", self->path,
                         header_size, got);
    bool little = memcmp(header + 126, "IM", 2) == 0, big = memcmp(header + 126, "MI", 2) == 0;
    unsigned version = little ? header[125] : header[124];
    if ((!little && !big) || (version != 1 && version != 2))
        return refuse(self, 124, "a MATLAB file of version 5 or 7.3 was expected");
    self->swapped = big;
    return version == 2 ? error_none : walk(self, (uint64_t)file.st_size);
}

int mat_check_layout(const char *path, struct error *out_error)
{
    struct walker walker = {.path = path, .stream = fopen(path, "rb"), .out_error = out_error};
    if (!walker.stream)
        return error_set(out_error, error_refused, "%s: cannot be read: %s", path, strerror(errno));
    int status = check(&walker);
    fclose(walker.stream);
    return status;
}
