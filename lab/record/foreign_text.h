/* SPDX-License-Identifier: MIT */
/// Text tables of other programs: cells between separators, a point or a comma as decimal mark, units in a header. What
/// formats of such files share. Internal to lab/record.
#ifndef SERVOSCOPE_RECORD_FOREIGN_TEXT_H
#define SERVOSCOPE_RECORD_FOREIGN_TEXT_H

#include "lab/record/error.h"
#include "lab/record/format.h"
#include "lab/record/text_table.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// ---- Lines (foreign_bytes.c)

enum foreign_encoding {
    foreign_utf8,
    foreign_utf16,
    foreign_windows, ///< no UTF-8, taken for Windows-1252, which holds Latin-1
};

/// A file's lines in memory.
struct foreign_text {
    const char *path;
    size_t count;
    char **lines; ///< UTF-8, terminated, without their ends; number i + 1 of the file
    char *bytes;  ///< that the lines stand in; owned
    enum foreign_encoding encoding;
};

/// Reads all lines, unpacked if the file is gzipped; UTF-8 and UTF-16 with or without byte order mark, else
/// Windows-1252; LF, CRLF or CR. A line end between quotes becomes a blank, and its line an empty one.
/// Errors: error_refused (cannot be read, binary, above 2 GiB); *out_self is empty then
int foreign_text_read(const char *path, struct foreign_text *out_self, struct error *out_error);
void foreign_text_free(struct foreign_text *self);

/// The first bytes of a file as such text, to tell a format by; NULL if they are binary or memory is short. The
/// caller's.
char *foreign_text_head(const unsigned char *head, size_t length);

// ---- Cells (foreign_cells.c)

/// Cells of one line, which is taken apart in place: blanks and quotes around them are gone.
struct foreign_cells {
    size_t count;
    char **items; ///< owned; they point into the line
};

/// A separator of a blank stands for any number of them.
/// Errors: error_refused if memory is short
int foreign_cells_split(char *line, char separator, struct foreign_cells *out_cells, struct error *out_error);
void foreign_cells_free(struct foreign_cells *self);

/// Whether a line has nothing but blanks and separators.
bool foreign_line_is_blank(const char *line);

enum foreign_value {
    foreign_value_number,
    foreign_value_grouped, ///< a number with marks between its thousands, which nothing proves to be such ("1.234")
    foreign_value_proven,  ///< the same where no other reading is left ("1.234,5", "1.234.567")
    foreign_value_missing, ///< empty, or a word for it: NaN, n/a, null, -
    foreign_value_text,
};

/// Reads a cell's number, whose decimal mark is `decimal`; marks between thousands are blanks, apostrophes and the
/// other of point and comma. *out_value is NaN where there is none.
enum foreign_value foreign_number(const char *cell, char decimal, double *out_value);

/// Whether the value is a number, marks between thousands or not.
bool foreign_is_number(enum foreign_value value);

// ---- Times (foreign_stamp.c)

/// A time of day, perhaps with its date.
struct foreign_stamp {
    int64_t day; ///< of some epoch; 0 without a date
    bool dated;
    int64_t ns; ///< of the day, or since a beginning
};

/// Reads "2026-03-01T14:21:04.123Z", "1.3.2026 14:21:04,123", "14:21:04.123", "2:21:04.5 PM" and the like; a date with
/// slashes that may be the day's or the month's first counts as none. false if it is no time of day.
bool foreign_stamp_read(const char *cell, struct foreign_stamp *out_stamp);

/// Seconds from one to a later one; times without a date pass midnight once.
double foreign_stamp_seconds(const struct foreign_stamp *from, const struct foreign_stamp *to);

// ---- Units and columns (foreign_run.c)

/// A column's name with its unit as words behind it, "pos [mm]"; characters that a map could not hold become '_'.
void foreign_name(const char *name, const char *unit, char *out_name, size_t size);

/// Makes a run of a table whose columns are called "NAME [unit]", or "NAME" where the file gives no unit: by --map,
/// whose COLUMN may leave the unit away, else by the units (run_guess.h). A unit in the header is honoured: where the
/// map gives no factor it brings the one to SI, where it gives one both are said. Rows with an empty cell (NaN) in a
/// column that the run knows are marked with `valid` 0 and repeat the values before; a column of which less than half
/// is there keeps its own name. The table is empty afterwards in every case.
/// Errors: error_refused, error_usage
int foreign_take_run(struct text_table *io_table, const struct format_options *options, struct run *out_run,
                     struct format_notes *io_notes, struct error *out_error);

/// Marks the rows in which one of the columns `used` has no value: `valid` is 0 there, and every used column repeats
/// its last value (the first ones: its next). Rows behind the last whole one are cut. Adds the column `valid_name` if
/// rows are to be marked and the table has none of that name.
/// Errors: error_refused (no whole row; memory)
int foreign_mark_gaps(struct text_table *io_table, const bool *used, const char *valid_name,
                      struct format_notes *io_notes, struct error *out_error);

#endif
