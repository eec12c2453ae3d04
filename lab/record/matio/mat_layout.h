/* SPDX-License-Identifier: MIT */
/// Whether a MATLAB file is whole, before matio takes its word for the sizes in it and reads past what is there.
/// Internal to this folder.
#ifndef SERVOSCOPE_RECORD_MATIO_MAT_LAYOUT_H
#define SERVOSCOPE_RECORD_MATIO_MAT_LAYOUT_H

#include "lab/record/error.h"

/// Walks a version 5 file down to each number's size; compressed variables are unpacked to see their check sums. Of a
/// version 7.3 file the header alone is judged (HDF5 knows its own end).
/// Errors: error_refused with the byte: cut off, sizes that do not fit each other, gzipped, not a MATLAB file.
/// Test:   tests/fault/test_convert_files.c
int mat_check_layout(const char *path, struct error *out_error);

#endif
