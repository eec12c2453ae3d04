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

enum { per_line = 8, sine_kinds = 6, kinds_count = sine_kinds + 2 };

/* In the header's order: first those of sines. */
static const struct {
    const char *name;
    unsigned kind;
} kinds_known[kinds_count] = {{"q15", dft_header_q15},
                              {"q23", dft_header_q23},
                              {"q31", dft_header_q31},
                              {"quarter-q15", dft_header_quarter_q15},
                              {"quarter-q23", dft_header_quarter_q23},
                              {"quarter-q31", dft_header_quarter_q31},
                              {"block", dft_header_block},
                              {"folded", dft_header_folded}};

/* A table of sines: of a whole period, and where in it sine and cosine begin; or of a quarter, and its steps. */
struct sines {
    int32_t *words; ///< owned; Q15 in them too
    uint32_t count;
    int sine, cosine;
    uint32_t quarter_steps, sample_steps;
};

/* What is made before anything is written. */
struct content {
    const uint32_t *bins;
    uint32_t bin_count, period_samples;
    int32_t *coefficients; ///< of the block DFT; owned
    uint32_t coefficient_count;
    struct frf_block_table table;
    struct sines sines[sine_kinds]; ///< empty where not asked for
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
        while (i < kinds_count &&
               (strlen(kinds_known[i].name) != length || strncmp(word, kinds_known[i].name, length) != 0))
            i++;
        if (i == kinds_count)
            return error_set(out_error, error_usage,
                             "%s: '%s': expected block or folded, q15, q23, q31, quarter-q15, quarter-q23, quarter-q31 "
                             "with commas between them",
                             name, text);
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

/* Q15 is made in its own width. */
static enum core_status build_q15(struct sines *self, bool quarter, uint32_t period, int16_t *narrow)
{
    struct frf_quarter_q15 of_quarter;
    struct frf_twiddles_q15 full;
    enum core_status status = quarter ? frf_quarter_build_q15(narrow, self->count, period, &of_quarter)
                                      : frf_twiddles_build_q15(narrow, self->count, period, &full);
    if (status != core_ok)
        return status;
    if (quarter) {
        self->quarter_steps = of_quarter.quarter_steps;
        self->sample_steps = of_quarter.sample_steps;
    } else {
        self->sine = (int)(full.sine - narrow);
        self->cosine = (int)(full.cosine - narrow);
    }
    for (uint32_t i = 0; i < self->count; i++)
        self->words[i] = narrow[i];
    return core_ok;
}

static enum core_status build_quarter(struct sines *self, bool is_q23, uint32_t period)
{
    struct frf_quarter_q23 q23;
    struct frf_quarter_q31 q31;
    enum core_status status = is_q23 ? frf_quarter_build_q23(self->words, self->count, period, &q23)
                                     : frf_quarter_build_q31(self->words, self->count, period, &q31);
    if (status == core_ok) {
        self->quarter_steps = is_q23 ? q23.quarter_steps : q31.quarter_steps;
        self->sample_steps = is_q23 ? q23.sample_steps : q31.sample_steps;
    }
    return status;
}

static enum core_status build_full(struct sines *self, bool is_q23, uint32_t period)
{
    struct frf_twiddles_q23 q23;
    struct frf_twiddles_q31 q31;
    enum core_status status = is_q23 ? frf_twiddles_build_q23(self->words, self->count, period, &q23)
                                     : frf_twiddles_build_q31(self->words, self->count, period, &q31);
    if (status == core_ok) {
        self->sine = (int)((is_q23 ? q23.sine : q31.sine) - self->words);
        self->cosine = (int)((is_q23 ? q23.cosine : q31.cosine) - self->words);
    }
    return status;
}

static bool is_quarter(unsigned kind)
{
    return kind == dft_header_quarter_q15 || kind == dft_header_quarter_q23 || kind == dft_header_quarter_q31;
}

static int make_sines(const char *path, struct sines *self, unsigned kind, uint32_t period, struct error *out_error)
{
    bool quarter = is_quarter(kind), is_q15 = kind == dft_header_q15 || kind == dft_header_quarter_q15;
    bool is_q23 = kind == dft_header_q23 || kind == dft_header_quarter_q23;
    self->count = quarter ? FRF_QUARTER_WORDS(period) : FRF_TWIDDLE_WORDS(period);
    self->words = malloc(self->count * sizeof *self->words);
    int16_t *narrow = is_q15 ? malloc(self->count * sizeof *narrow) : NULL;
    enum core_status status = core_err_storage;
    bool memory = self->words && (narrow || !is_q15);
    if (memory)
        status = is_q15    ? build_q15(self, quarter, period, narrow)
                 : quarter ? build_quarter(self, is_q23, period)
                           : build_full(self, is_q23, period);
    free(narrow);
    if (!memory)
        return error_set(out_error, error_refused, "%s: memory is short", path);
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

static void write_sines(FILE *stream, const struct names *names, size_t kind, const struct sines *self, uint32_t period)
{
    const char *name = names->lower, *format = kinds_known[kind].name;
    bool quarter = is_quarter(kinds_known[kind].kind);
    format += quarter ? strlen("quarter-") : 0;
    char array[32];
    snprintf(array, sizeof array, "%s_%s", quarter ? "quarter_sines" : "sines", format);
    begin_array(stream, names, strcmp(format, "q15") == 0 ? "int16_t" : "int32_t", array, self->count);
    for (uint32_t i = 0; i < self->count; i++)
        write_value(stream, i, self->words[i]);
    fprintf(stream, "\n};\n\n");
    if (quarter)
        fprintf(stream,
                "static const struct frf_quarter_%s %s_quarter_%s = {\n"
                "    %s_%s, %" PRIu32 "u, %" PRIu32 "u, %" PRIu32 "u};\n\n",
                format, name, format, name, array, period, self->quarter_steps, self->sample_steps);
    else
        fprintf(stream,
                "static const struct frf_twiddles_%s %s_twiddles_%s = {\n"
                "    %s_%s + %d, %s_%s + %d, %" PRIu32 "u};\n\n",
                format, name, format, name, array, self->sine, name, array, self->cosine, period);
}

static void write_text(FILE *stream, const char *path, const struct content *self)
{
    struct names names = {"", ""};
    c_name_from_path(path, false, names.lower);
    c_name_from_path(path, true, names.upper);
    bool has_sines = false;
    for (size_t n = 0; n < sine_kinds; n++)
        has_sines = has_sines || self->sines[n].words;
    fprintf(stream,
            "/* Const tables of a DFT at the excited bins, made by servoscope. */\n"
            "#ifndef %s_H\n#define %s_H\n\n%s%s\n#include <stdint.h>\n\n"
            "#define %s_PERIOD_SAMPLES %" PRIu32 "u\n#define %s_BIN_COUNT      %" PRIu32 "u\n",
            names.upper, names.upper, self->coefficients ? "#include \"frf/block_table.h\"\n" : "",
            has_sines ? "#include \"frf/twiddle.h\"\n" : "", names.upper, self->period_samples, names.upper,
            self->bin_count);
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
    for (size_t n = 0; n < sine_kinds; n++) {
        if (self->sines[n].words)
            write_sines(stream, &names, n, &self->sines[n], self->period_samples);
    }
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
    for (size_t n = 0; !status && n < sine_kinds; n++) {
        if (kinds & kinds_known[n].kind)
            status = make_sines(path, &content.sines[n], kinds_known[n].kind, period_samples, out_error);
    }
    struct atomic_file file;
    FILE *stream = status ? NULL : atomic_file_open(&file, path, out_error);
    if (stream)
        write_text(stream, path, &content);
    free(content.coefficients);
    for (size_t n = 0; n < sine_kinds; n++)
        free(content.sines[n].words);
    return stream ? atomic_file_commit(&file, out_error) : error_refused;
}
