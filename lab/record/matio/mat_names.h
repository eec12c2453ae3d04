/* SPDX-License-Identifier: MIT */
/// What the variables of a MATLAB file of ours are called. Internal to this folder.
#ifndef SERVOSCOPE_RECORD_MATIO_MAT_NAMES_H
#define SERVOSCOPE_RECORD_MATIO_MAT_NAMES_H

#include "lab/record/format.h"

#include <stddef.h>

enum { mat_name_size = 64 }; /* MATLAB's namelengthmax and a zero */

/// The structure that says what the file holds.
extern const char mat_structure_name[];

/// How a key is kept in it.
enum mat_key {
    mat_key_other,  ///< in the cell array `keys`
    mat_key_number, ///< as a field of its own
    mat_key_text,   ///< the same
    mat_key_list,   ///< the same, a row of numbers
};

enum mat_key mat_key_kind(enum record_kind holds, const char *key);

/// The keys with a field of their own, by number; NULL behind the last.
const char *mat_key_name(enum record_kind holds, size_t i);

/// The variable for column `index` (from 0): its name, where MATLAB takes that for a name.
void mat_name_variable(const char *column, size_t index, char out_name[mat_name_size]);

#endif
