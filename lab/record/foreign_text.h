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

/// A file's lines in memory.
struct foreign_text {
    const char *path;
    size_t count;
    char **lines; ///< terminated, without their ends; number i + 1 of the file
};

/// Reads all lines, unpacked if the file is gzipped.
/// Errors: error_refused; *out_self is empty then
int foreign_text_read(const char *path, struct foreign_text *out_self, struct error *out_error);
void foreign_text_free(struct foreign_text *self);

/// Cells of one line, which is taken apart in place: blanks and quotes around them are gone.
struct foreign_cells {
    size_t count;
    char **items; ///< owned; they point into the line
};

/// Errors: error_refused if memory is short
int foreign_cells_split(char *line, char separator, struct foreign_cells *out_cells, struct error *out_error);
void foreign_cells_free(struct foreign_cells *self);

/// Reads a cell's number, whose decimal mark is a point or `decimal`; false if it is none. The cell may be changed.
bool foreign_number(char *cell, char decimal, double *out_value);

/// A column's name with its unit as words behind it, "pos [mm]"; characters that a map could not hold become '_'.
void foreign_name(const char *name, const char *unit, char *out_name, size_t size);

/// Makes a run of a table whose columns are called "NAME [unit]", or "NAME" where the file gives no unit: by --map,
/// whose COLUMN may leave the unit away, else by the units (run_guess.h). A unit in the header is honoured: where the
/// map gives no factor it brings the one to SI, where it gives one both are said. The table is empty afterwards in
/// every case.
/// Errors: error_refused, error_usage
int foreign_take_run(struct text_table *io_table, const struct format_options *options, struct run *out_run,
                     struct format_notes *io_notes, struct error *out_error);

#endif
