/* SPDX-License-Identifier: MIT */
/// File formats that `servoscope convert` knows. To add one, add one file format_NAME.c with one object
/// `record_format_NAME`; the build collects them and nothing else knows their names.
#ifndef SERVOSCOPE_RECORD_FORMAT_H
#define SERVOSCOPE_RECORD_FORMAT_H

#include "lab/record/error.h"
#include "lab/record/frf_file.h"
#include "lab/record/run.h"

#include <stdbool.h>
#include <stddef.h>

enum record_kind {
    record_run, ///< signals over time
    record_frf, ///< a frequency response
};

/// What a file holds, one of the two.
struct record {
    enum record_kind kind;
    struct run run; ///< empty for a response
    struct frf frf; ///< empty for a run
};

/// Frees what a format's read gave; harmless on a zeroed struct.
void record_free(struct record *self);

enum format_note {
    format_assumed, ///< what the file does not say
    format_kept,    ///< what the format has no place for, and where it was put
    format_lost,    ///< what is not in the result
};

enum { format_notes_max = 64 };

/// What a conversion has to say. Read-only for the application.
struct format_notes {
    size_t count;
    size_t dropped; ///< notes beyond the last place, or beyond memory
    struct {
        enum format_note kind;
        char *text; ///< one line without the newline; owned
    } items[format_notes_max];
};

/// Adds one line; a note that finds no place is counted.
#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
void format_notes_add(struct format_notes *self, enum format_note kind, const char *format, ...);

void format_notes_free(struct format_notes *self);

struct format_options {
    struct run_options run; ///< --map, --rate
    size_t function;        ///< which of several responses, from 1; 0: not said
};

/// How sure a format is that a file is its own.
enum format_match {
    format_match_none,
    format_match_maybe, ///< text
    format_match_sure,  ///< its first bytes are this format's alone
};

enum { format_head_size = 16384, format_endings_max = 4 };

struct record_format {
    const char *name;                        ///< of --to
    const char *summary;                     ///< for messages and --help
    const char *endings[format_endings_max]; ///< of file names, with the dot; NULL at the end

    /// Judges the first bytes of a file, unpacked if they were gzipped. NULL: another format reads these files.
    enum format_match (*recognise)(const unsigned char *head, size_t length);

    /// Reads a file. *out_record is empty on error; *io_notes is added to. NULL where `recognise` is.
    int (*read)(const char *path, const struct format_options *options, struct record *out_record,
                struct format_notes *io_notes, struct error *out_error);

    /// Writes a file that is whole or as it was (lab/record/atomic_file.h). NULL: files of others, which are only read.
    int (*write)(const char *path, const struct record *record, struct format_notes *io_notes, struct error *out_error);
};

/// NULL-terminated, sorted by file name, made by the build.
extern const struct record_format *const record_formats[];

/// The format of a --to, one that is written; NULL if there is none.
const struct record_format *format_by_name(const char *name);

/// The format that a file's name ends in; NULL if none does. Upper case counts as lower.
const struct record_format *format_by_ending(const char *path);

/// The format of a file by its content.
/// Errors: error_refused if it cannot be read or no format knows it.
int format_by_content(const char *path, const struct record_format **out_format, struct error *out_error);

/// Writes the names of the formats that are read, or of those that are written, "csv, mat or uff", into out_text.
void format_list(bool readers, size_t size, char *out_text);

#endif
