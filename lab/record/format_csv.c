/* SPDX-License-Identifier: MIT */
/// servoscope's own text files: runs and responses (docs/files.md). The row of names tells which of the two a file is.
#include "lab/record/format.h"
#include "lab/record/record_table.h"
#include "lab/record/run_names.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

enum { names_size = 4096 }; /* a response has fewer names than fit in here */

static const char table_magic[] = {'M', 'S', 'T', 0x1a};

/* Anything that may be text; JSON, tables of samples and what is binary are not. */
static enum format_match recognise(const unsigned char *head, size_t length)
{
    size_t first = length >= 3 && memcmp(head, "\xEF\xBB\xBF", 3) == 0 ? 3 : 0;
    while (first < length && memchr(" \t\r\n", head[first], 4))
        first++;
    bool json = first < length && head[first] == '{';
    bool table = length >= sizeof table_magic && memcmp(head, table_magic, sizeof table_magic) == 0;
    return json || table || memchr(head, '\0', length) ? format_match_none : format_match_maybe;
}

/* The first line that is neither a key nor blank, without its end; "" if it is too long or the file cannot be read. */
static void read_names(const char *path, char out_names[names_size])
{
    gzFile file = gzopen(path, "rb");
    bool line_start = true, key = false;
    out_names[0] = '\0';
    while (file && gzgets(file, out_names, names_size)) {
        key = line_start ? out_names[0] == '#' : key;
        bool whole = strchr(out_names, '\n') || gzeof(file);
        bool blank = strspn(out_names, " \t\r\n") == strlen(out_names);
        if (line_start && !key && !blank) {
            out_names[whole ? strcspn(out_names, "\r\n") : 0] = '\0';
            break;
        }
        line_start = whole;
        out_names[0] = '\0';
    }
    if (file)
        gzclose_r(file);
}

/* A column that a run does not know is no loss, but one to know of. */
static void note_unnamed(const struct run *run, struct format_notes *io_notes)
{
    for (size_t c = 0; c < run->column_count; c++)
        if (run_name_axis(run->columns[c].name) == run_axis_unknown)
            format_notes_add(io_notes, format_kept, "%s under its own name: what it is can be said with --map",
                             run->columns[c].name);
}

/* Whether the columns that make a response are all there; those that it has no place for are noted. */
static bool is_response(char *names, struct format_notes *io_notes)
{
    static const char *const known[] = {"frequency_hz",    "real",  "imag",     "std", "noise_std", "odd_distortion",
                                        "even_distortion", "valid", "coherence"};
    enum { known_count = sizeof known / sizeof known[0], required_count = 3 };
    size_t required = 0;
    char *rest = NULL;
    for (char *name = strtok_r(names, ", \t\"", &rest); name; name = strtok_r(NULL, ", \t\"", &rest)) {
        size_t i = 0;
        while (i < known_count && strcmp(known[i], name) != 0)
            i++;
        required += i < required_count;
        if (io_notes && i == known_count)
            format_notes_add(io_notes, format_lost, "column %s: a frequency response has no place for it", name);
    }
    return required == required_count;
}

static int read_csv(const char *path, const struct format_options *options, struct record *out_record,
                    struct format_notes *io_notes, struct error *out_error)
{
    char names[names_size], copy[names_size];
    *out_record = (struct record){.kind = record_run};
    read_names(path, names);
    strcpy(copy, names);
    if (!is_response(copy, NULL)) {
        int status = run_read(path, &options->run, &out_record->run, out_error);
        if (!status && !options->run.map)
            note_unnamed(&out_record->run, io_notes);
        return status;
    }
    out_record->kind = record_frf;
    int status = frf_read(path, &out_record->frf, out_error);
    if (!status)
        (void)is_response(names, io_notes);
    return status;
}

static int write_csv(const char *path, const struct record *record, struct format_notes *io_notes,
                     struct error *out_error)
{
    (void)io_notes;
    return record->kind == record_run ? run_write(path, &record->run, out_error)
                                      : frf_write(path, &record->frf, out_error);
}

const struct record_format record_format_csv = {
    .name = "csv",
    .summary = "servoscope's run and frequency response files; read plain and gzipped",
    .endings = {".csv"},
    .recognise = recognise,
    .read = read_csv,
    .write = write_csv,
};
