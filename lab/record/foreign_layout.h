/* SPDX-License-Identifier: MIT */
/// How a text table of another program is laid out, found out from the file itself. Internal to lab/record.
#ifndef SERVOSCOPE_RECORD_FOREIGN_LAYOUT_H
#define SERVOSCOPE_RECORD_FOREIGN_LAYOUT_H

#include "lab/record/foreign_text.h"

enum foreign_kind {
    foreign_kind_empty, ///< no cell holds anything
    foreign_kind_number,
    foreign_kind_stamp, ///< times of day
    foreign_kind_text,
};

struct foreign_layout {
    char separator, decimal;
    size_t columns;
    enum foreign_kind *kinds;   ///< of each column; owned
    size_t names, units, first; ///< lines; names or units at SIZE_MAX: there are none
    bool names_behind_hash;     ///< the row of names is a comment, "# t u y"
};

/// Separator and decimal mark: those with which most cells of the last lines are numbers or times. First row: the first
/// line that is like those. Names: the last line in front of it that has as many cells; a line of units may stand
/// between.
/// Errors: error_refused (no rows of numbers; more cells than names)
int foreign_layout_find(const struct foreign_text *text, struct foreign_layout *out_self, struct error *out_error);
void foreign_layout_free(struct foreign_layout *self);

/// Whether a cell is a unit and not a name. Brackets around it say so of any word.
bool foreign_is_unit(const char *cell);

/// Copies a cell without the brackets around it.
void foreign_bare_unit(const char *cell, char *out_unit, size_t size);

#endif
