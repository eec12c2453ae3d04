/* SPDX-License-Identifier: MIT */
#include "lab/record/dft_header.h"

#include "frf/block_table.h"
#include "frf/twiddle.h"
#include "lab/record/atomic_file.h"
#include "lab/record/c_name.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { per_line = 8 };

static const struct {
    const char *name;
    unsigned kind;
} kinds_known[] = {
    {"block", dft_header_block}, {"folded", dft_header_folded}, {"q15", dft_header_q15}, {"q31", dft_header_q31}};

/* What is made before anything is written. */
struct content {
    const uint32_t *bins;
    uint32_t bin_count, period_samples;
    int32_t *coefficients; ///< of the block DFT; owned
    uint32_t coefficient_count;
    struct frf_block_table table;
    int16_t *q15; ///< owned
    struct frf_twiddles_q15 twiddles_q15;
    int32_t *q31; ///< owned
    struct frf_twiddles_q31 twiddles_q31;
};

/* The names' common beginning. */
struct names {
    char lower[c_name_size], upper[c_name_size];
};

int dft_header_parse(const char *name, const char *text, unsigned *out_kinds, struct error *out_error)
{
    unsigned kinds = 0;
    for (const char *word = text;; word++) {
        size_t length = strcspn(word, ","), i = 0;
        while (i < 4 && (strlen(kinds_known[i].name) != length || strncmp(word, kinds_known[i].name, length) != 0))
            i++;
        if (i == 4)
            return error_set(out_error, error_usage,
                             "%s: '%s': expected block, folded, q15, q31 with commas between them", name, text);
        kinds |= kinds_known[i].kind;
        word += length;
        if (*word == '\0')
            break;
    }
    if ((kinds & dft_header_block) && (kinds & dft_header_folded))
        return error_set(out_error, error_usage, "%s: '%s': expected block or folded, not both", name, text);
    *out_kinds = kinds;
    return error_none;
}

static int refuse(const char *path, enum core_status status, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s: %s", path, core_status_str(status));
}

static int make_block(const char *path, struct content *self, uint32_t part_samples_max, struct error *out_error)
{
    struct frf_block_layout layout;
    frf_block_choose(self->bins, self->bin_count, self->period_samples, part_samples_max, &layout);
    if (layout.block_samples == 0)
        return error_set(out_error, error_refused,
                         "%s: a period of %" PRIu32 " samples has no blocks: expected 64 to %d, or q15, q31", path,
                         self->period_samples, SERVOSCOPE_FRF_PERIOD_MAX);
    self->coefficient_count = FRF_BLOCK_TABLE_WORDS(self->bin_count, layout.block_samples, layout.terms);
    self->coefficients = malloc(self->coefficient_count * sizeof *self->coefficients);
    if (!self->coefficients)
        return error_set(out_error, error_refused, "%s: memory is short", path);
    enum core_status status = frf_block_build(self->coefficients, self->coefficient_count, self->bins, self->bin_count,
                                              self->period_samples, &layout, &self->table);
    return status == core_ok ? error_none : refuse(path, status, out_error);
}

static int make_sines(const char *path, struct content *self, unsigned kinds, struct error *out_error)
{
    uint32_t words = FRF_TWIDDLE_WORDS(self->period_samples);
    enum core_status status = core_ok;
    self->q15 = kinds & dft_header_q15 ? malloc(words * sizeof *self->q15) : NULL;
    self->q31 = kinds & dft_header_q31 ? malloc(words * sizeof *self->q31) : NULL;
    if ((!self->q15 && kinds & dft_header_q15) || (!self->q31 && kinds & dft_header_q31))
        return error_set(out_error, error_refused, "%s: memory is short", path);
    if (self->q15)
        status = frf_twiddles_build_q15(self->q15, words, self->period_samples, &self->twiddles_q15);
    if (status == core_ok && self->q31)
        status = frf_twiddles_build_q31(self->q31, words, self->period_samples, &self->twiddles_q31);
    return status == core_ok ? error_none : refuse(path, status, out_error);
}

static void begin_array(FILE *stream, const struct names *names, const char *type, const char *what, uint32_t count)
{
    fprintf(stream, "static const %s %s_%s[%" PRIu32 "] = {", type, names->lower, what, count);
}

/* The smallest integer is no constant of its own in C. */
static void write_value(FILE *stream, uint32_t i, int32_t value)
{
    const char *before = i % per_line == 0 ? "\n    " : " ";
    if (value == INT32_MIN)
        fprintf(stream, "%s-2147483647 - 1,", before);
    else
        fprintf(stream, "%s%" PRId32 ",", before, value);
}

static void write_words(FILE *stream, const struct names *names, const char *what, const int32_t *values,
                        uint32_t count)
{
    begin_array(stream, names, "int32_t", what, count);
    for (uint32_t i = 0; i < count; i++)
        write_value(stream, i, values[i]);
    fprintf(stream, "\n};\n\n");
}

static void write_bins(FILE *stream, const struct names *names, const struct content *self)
{
    begin_array(stream, names, "uint32_t", "bins", self->bin_count);
    for (uint32_t i = 0; i < self->bin_count; i++)
        fprintf(stream, "%s%" PRIu32 "u,", i % per_line == 0 ? "\n    " : " ", self->bins[i]);
    fprintf(stream, "\n};\n\n");
}

/* Members in their order, because C++ names none before C++20. */
static void write_block(FILE *stream, const struct names *names, const struct content *self)
{
    const struct frf_block_table *table = &self->table;
    const char *name = names->lower;
    write_words(stream, names, "coefficients", self->coefficients, self->coefficient_count);
    fprintf(stream,
            "static const struct frf_block_table %s_block_table = {\n"
            "    %s_coefficients + %d, /* rows */\n    %s_coefficients + %d, /* restore */\n",
            name, name, (int)(table->rows - self->coefficients), name, (int)(table->restore - self->coefficients));
    if (table->basis)
        fprintf(stream, "    %s_coefficients + %d, /* basis */\n", name, (int)(table->basis - self->coefficients));
    else
        fprintf(stream, "    0, /* no basis */\n");
    fprintf(stream,
            "    %s_bins, %" PRIu32 "u, %" PRIu32 "u, /* period */\n"
            "    %" PRIu32 "u, %" PRIu32 "u, %s, /* part, lead, alternate */\n"
            "    {%" PRIu32 "u, %" PRIu32 "u, %" PRIu32 "u}, %" PRIu32 "u /* layout, gain_shift */\n};\n\n",
            name, self->bin_count, self->period_samples, table->part_samples, table->lead_samples,
            table->alternate ? "true" : "false", table->layout.block_samples, table->layout.terms,
            table->layout.repeats, table->gain_shift);
}

static void write_twiddles(FILE *stream, const struct names *names, const char *format, uint32_t period, int sine,
                           int cosine)
{
    const char *name = names->lower;
    fprintf(stream,
            "static const struct frf_twiddles_%s %s_twiddles_%s = {\n"
            "    %s_sines_%s + %d, %s_sines_%s + %d, %" PRIu32 "u};\n\n",
            format, name, format, name, format, sine, name, format, cosine, period);
}

static void write_sines(FILE *stream, const struct names *names, const struct content *self)
{
    uint32_t words = FRF_TWIDDLE_WORDS(self->period_samples);
    if (self->q15) {
        begin_array(stream, names, "int16_t", "sines_q15", words);
        for (uint32_t i = 0; i < words; i++)
            write_value(stream, i, self->q15[i]);
        fprintf(stream, "\n};\n\n");
        write_twiddles(stream, names, "q15", self->period_samples, (int)(self->twiddles_q15.sine - self->q15),
                       (int)(self->twiddles_q15.cosine - self->q15));
    }
    if (self->q31) {
        write_words(stream, names, "sines_q31", self->q31, words);
        write_twiddles(stream, names, "q31", self->period_samples, (int)(self->twiddles_q31.sine - self->q31),
                       (int)(self->twiddles_q31.cosine - self->q31));
    }
}

static void write_text(FILE *stream, const char *path, const struct content *self)
{
    struct names names;
    c_name_from_path(path, false, names.lower);
    c_name_from_path(path, true, names.upper);
    fprintf(stream,
            "/* Const tables of a DFT at the excited bins, made by servoscope: %s_bins%s%s%s. */\n"
            "#ifndef %s_H\n#define %s_H\n\n%s%s\n#include <stdint.h>\n\n"
            "#define %s_PERIOD_SAMPLES %" PRIu32 "u\n#define %s_BIN_COUNT      %" PRIu32 "u\n",
            names.lower, self->coefficients ? ", _block_table" : "", self->q15 ? ", _twiddles_q15" : "",
            self->q31 ? ", _twiddles_q31" : "", names.upper, names.upper,
            self->coefficients ? "#include \"frf/block_table.h\"\n" : "",
            self->q15 || self->q31 ? "#include \"frf/twiddle.h\"\n" : "", names.upper, self->period_samples,
            names.upper, self->bin_count);
    if (self->coefficients)
        fprintf(stream,
                "#define %s_BLOCK_SAMPLES  %" PRIu32 "u\n#define %s_BLOCK_TERMS    %" PRIu32
                "u\n#define %s_BLOCK_REPEATS  %" PRIu32 "u\n",
                names.upper, self->table.layout.block_samples, names.upper, self->table.layout.terms, names.upper,
                self->table.layout.repeats);
    fprintf(stream, "\n");
    write_bins(stream, &names, self);
    if (self->coefficients)
        write_block(stream, &names, self);
    write_sines(stream, &names, self);
    fprintf(stream, "#endif\n");
}

int dft_header_write(const char *path, const uint32_t *bins, uint32_t bin_count, uint32_t period_samples,
                     unsigned kinds, struct error *out_error)
{
    struct content content = {.bins = bins, .bin_count = bin_count, .period_samples = period_samples};
    uint32_t part_samples_max = kinds & dft_header_folded ? period_samples : 0;
    int status = error_none;
    if (period_samples > SERVOSCOPE_FRF_PERIOD_MAX)
        status = error_set(out_error, error_refused, "%s: a period of %" PRIu32 " samples: expected at most %d", path,
                           period_samples, SERVOSCOPE_FRF_PERIOD_MAX);
    if (!status && kinds & (dft_header_block | dft_header_folded))
        status = make_block(path, &content, part_samples_max, out_error);
    status = status ? status : make_sines(path, &content, kinds, out_error);
    struct atomic_file file;
    FILE *stream = status ? NULL : atomic_file_open(&file, path, out_error);
    if (stream)
        write_text(stream, path, &content);
    free(content.coefficients);
    free(content.q15);
    free(content.q31);
    return stream ? atomic_file_commit(&file, out_error) : error_refused;
}
