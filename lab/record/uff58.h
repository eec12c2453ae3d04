/* SPDX-License-Identifier: MIT */
/// Universal file format, dataset 58: "function at nodal DOF", as vibration measurement systems exchange it, in text
/// and in binary, 58b. Other datasets are stepped over; of 151 (header) and 164 (units) what is needed is
/// read.
/// Source: SDRC I-DEAS universal file datasets, https://www.ceas3.uc.edu/sdrluff/ (datasets 58, 151, 164).
///
/// Numbers in text: ordinates in double precision have 13 significant digits (field E20.12), the abscissa's start and
/// step, and an uneven abscissa, have 6 (field E13.5).
#ifndef SERVOSCOPE_RECORD_UFF58_H
#define SERVOSCOPE_RECORD_UFF58_H

#include "lab/record/error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

enum { uff_text_size = 81, uff_label_size = 21, uff_name_size = 11, uff_id_lines = 5 };

/// Function types (record 6, field 1) that servoscope reads and writes.
enum { uff_general = 0, uff_time_response = 1, uff_frf = 4, uff_coherence = 6 };

/// Specific data types (records 8 to 11, field 1).
enum {
    uff_quantity_none = 0,
    uff_quantity_general = 1,
    uff_quantity_displacement = 8,
    uff_quantity_velocity = 11,
    uff_quantity_acceleration = 12,
    uff_quantity_excitation_force = 13,
    uff_quantity_time = 17,
    uff_quantity_frequency = 18,
};

/// Directions (record 6): 0 scalar, 1..3 translation along X, Y, Z, 4..6 rotation about them; negative the other way.
enum { uff_scalar = 0, uff_translation_x = 1, uff_rotation_z = 6 };

struct uff_axis {
    int quantity;
    int length_exponent, force_exponent, temperature_exponent;
    char label[uff_label_size];
    char units[uff_label_size];
};

struct uff_dof {
    char name[uff_name_size];
    long node;
    int direction;
};

/// One function.
struct uff58 {
    size_t line;                          ///< of the file where it begins; 0 when it is to be written
    char id[uff_id_lines][uff_text_size]; ///< without the blanks at their ends
    int function_type;
    long load_case;
    struct uff_dof response, reference;
    bool complex;
    bool even; ///< the abscissa is abscissa_min + n abscissa_step
    double abscissa_min, abscissa_step, z_value;
    struct uff_axis abscissa, numerator, denominator, z_axis;
    size_t count;
    double *abscissa_values; ///< NULL if even; owned by what uff_file_read gave
    double *real;
    double *imag; ///< NULL if not complex
};

struct uff_file {
    size_t count;
    struct uff58 *functions;
    char description[uff_text_size]; ///< dataset 151, record 2; "" if there is none
    char program[uff_text_size];     ///< dataset 151, record 6
    bool has_units;                  ///< a dataset 164 is there
    char units[uff_label_size];      ///< its description
    double to_si[2];                 ///< factors that its length and force are divided by to give m and N
    size_t skipped;                  ///< datasets of other kinds
};

/// Reads all functions of a file, plain or gzipped.
/// Errors: error_refused with file, line, value and expectation: cut off, a field that is no number, more values than
///         the file has; *out_file is empty then.
/// Test:   tests/unit/test_uff.c, tests/fault/test_convert_files.c
int uff_file_read(const char *path, struct uff_file *out_file, struct error *out_error);

void uff_file_free(struct uff_file *self);

/// Writes datasets 151 and 164 (SI). Texts longer than a line are cut.
void uff_write_header(FILE *stream, const char *description, const char *program);

/// Writes one function in double precision; its numbers have to be finite. Binary (58b): little-endian, an uneven
/// abscissa in double precision too, as the usual readers expect against the definition's single.
void uff_write_function(FILE *stream, const struct uff58 *function, bool binary);

/// The number that is read back from a field of the abscissa.
double uff_abscissa_rounded(double value);

#endif
