/* SPDX-License-Identifier: MIT */
/// Names in generated C headers.
#ifndef SERVOSCOPE_RECORD_C_NAME_H
#define SERVOSCOPE_RECORD_C_NAME_H

#include <stdbool.h>

enum { c_name_size = 64 };

/// A C name from a path: its last part up to the first dot, in lower case; `upper`: for macros. What no name can have
/// becomes an underscore, and what does not begin with a letter gets "table_" in front.
void c_name_from_path(const char *path, bool upper, char out_name[c_name_size]);

#endif
